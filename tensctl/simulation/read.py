"""A run from the file that it was written to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import SimulationError
from tensctl.scene import Scene
from tensctl.simulation.journal import mend
from tensctl.simulation.run import Run
from tensctl.structure import build_structure

if TYPE_CHECKING:
    import xarray

_ARRAYS = (
    "time", "nodes", "velocities", "lengths", "tensions", "rest_lengths", "inputs", "solve_time", "kkt", "relaxed",
)  # fmt: skip


def read_run(path: Path) -> Run:
    """The run in a file, whole or up to its last chunk.

    Raises
    ------
    SimulationError
        When the file holds no run.
    """
    import xarray as xr

    if not path.is_file():
        raise SimulationError(
            f"there is no file {path}; a file of Run.save or of simulate(..., store=...) is expected."
        )
    try:
        mend(path)
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as data:
            return _run(data)
    except (OSError, KeyError, ValueError):
        raise SimulationError(
            f"{path} holds no run; a file of Run.save or of simulate(..., store=...) is expected."
        ) from None


def _run(data: xarray.Dataset) -> Run:
    arrays = {name: data[name].values for name in _ARRAYS}
    return Run(
        structure=build_structure(Scene(structure=json.loads(str(data["structure"].values)))),
        sample_time=data["sample"].values,
        margin_gap=data["margin_gap"].values if "margin_gap" in data else np.full(data.sizes["sample"], np.nan),
        parted=data["parted"].values if "parted" in data else np.full(data.sizes["sample"], -1),
        status=data["status"].values.astype(str),
        input_labels=tuple(data["input"].values.tolist()),
        method=data.attrs["method"],
        why=data.attrs["why"],
        evaluations=int(data.attrs["evaluations"]),
        switches=int(data.attrs["switches"]),
        local_errors=float(data.attrs.get("local_errors", np.nan)),
        commands=data["commands"].values if "commands" in data else None,
        **arrays,
    )
