"""The linear model as a MATLAB file: matrices, labels and the point of linearisation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from tensctl.errors import OutputError
from tensctl.linear import LinearModel, linearize
from tensctl.model import build_dynamics
from tensctl.statics import find_equilibrium

if TYPE_CHECKING:
    from tensctl.scene import Scene


def write_mat(scene: Scene, path: str | Path) -> Path:
    """Find the scene's equilibrium, linearise about it and write a .mat file.

    The file holds A, B, C, D, the labels `states`, `inputs`, `outputs`, the frequencies of the modes in Hz, and the
    equilibrium's `nodes`, `rest_lengths`, `lengths` and `tensions`.

    Raises
    ------
    OutputError
        When the file cannot be written.
    """
    from scipy.io import savemat

    path, asked = Path(path), scene.linearize
    if path.is_dir() or not path.parent.is_dir():
        raise OutputError(f"{path} cannot be written: give a file in a folder that exists.")
    outputs = ("nodes", "tensions") if asked is None else asked.outputs
    linear = linearize(build_dynamics(scene), find_equilibrium(scene), outputs=outputs)
    try:
        with path.open("wb") as stream:
            savemat(cast("Any", stream), _contents(linear))
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from None
    return path


def _contents(linear: LinearModel) -> dict[str, np.ndarray]:
    equilibrium = linear.equilibrium
    return {
        "A": linear.A,
        "B": linear.B,
        "C": linear.C,
        "D": linear.D,
        "states": np.array(linear.states, object),
        "inputs": np.array(linear.inputs, object),
        "outputs": np.array(linear.outputs, object),
        "frequencies": np.array([mode.frequency for mode in linear.modes]),
        "nodes": equilibrium.nodes,
        "rest_lengths": equilibrium.rest_lengths,
        "lengths": equilibrium.lengths,
        "tensions": equilibrium.tensions,
    }
