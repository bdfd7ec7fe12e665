"""What was measured, as a file of numbers and a figure."""

from __future__ import annotations

import json
from pathlib import Path

from matplotlib.figure import Figure

from tensctl.errors import OutputError


def write_measured(name: str, numbers: dict, figure: Figure, folder: Path) -> None:
    """Write name.json and name.svg into a folder, which is made when missing.

    Raises
    ------
    OutputError
        When they cannot be written.
    """
    text = json.dumps(numbers, indent=2, allow_nan=False) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.json").write_text(text, encoding="utf-8")
        figure.savefig(folder / f"{name}.svg")
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}.") from None
