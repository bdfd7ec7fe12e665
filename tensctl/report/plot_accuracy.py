"""Error against run time as a plot of its own, beside the same numbers as JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from tensctl.errors import OutputError

if TYPE_CHECKING:
    from tensctl.accuracy import WorkPrecision


def write_accuracy(measured: WorkPrecision, folder: Path) -> None:
    """Write accuracy.json and accuracy.svg into a folder, which is made when missing.

    Raises
    ------
    OutputError
        When they cannot be written.
    """
    text = json.dumps(measured.to_dict(), indent=2, allow_nan=False) + "\n"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "accuracy.json").write_text(text, encoding="utf-8")
        _drawn(measured).savefig(folder / "accuracy.svg")
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}.") from None


def _drawn(measured: WorkPrecision) -> Figure:
    """A line a method; points that the reference cannot tell apart stand on its own error, the dashed line."""
    figure = Figure(figsize=(7.6, 4.2), layout="constrained")
    axes = figure.subplots()
    least = max(measured.reference_error, 1e-16)
    done = [a for a in measured.attempts if not a.failure]
    for method in dict.fromkeys(a.method for a in done):
        points = [(a.seconds, max(a.error, least)) for a in done if a.method == method]
        axes.plot(*zip(*points, strict=True), marker="o", label=method)
    axes.axhline(least, color="0.4", linestyle="--", linewidth=1.0, label="error of the reference")
    axes.set(xscale="log", yscale="log", xlabel="Run time, s", ylabel="Largest distance of a node, m")
    axes.set_title(f"Error against run time, {measured.t_end:g} s of motion", loc="left")
    figure.legend(loc="outside right upper", frameon=False)
    return figure
