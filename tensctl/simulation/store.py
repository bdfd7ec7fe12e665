"""A run on disk while it goes on: a netCDF file that grows by chunks and holds what going on from its end needs.

Dimensions `time` and `sample` are unlimited and everything stands as `Run.save` writes it; a group `resume` holds the
request, a fingerprint of the model, and the state at the last record. A chunk and its state go in as one change.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import OutputError, SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.journal import mend, staged
from tensctl.simulation.request import Request
from tensctl.simulation.run import Run

if TYPE_CHECKING:
    import h5py

State = dict[str, np.ndarray]
_GROUP, _GROWING = "resume", ("time", "sample")


@dataclass(frozen=True, eq=False)
class Stored:
    """What a file holds of an unfinished run.

    Attributes
    ----------
    request : Request
    state : dict of arrays
        At the last record.
    count : int
        Records.
    status : str
        What the controller said last.
    """

    request: Request
    state: State
    count: int
    status: str


class Store:
    """The file of one run, begun with its first chunk unless it is there already."""

    def __init__(self, path: Path, dynamics: Dynamics, request: Request, *, begun: bool = False) -> None:
        self._path, self._dynamics, self._request, self._begun = path, dynamics, request, begun
        if not path.parent.is_dir():
            raise OutputError(f"{path} cannot be written: there is no folder {path.parent}.")
        if path.is_dir():
            raise OutputError(f"{path} cannot be written: it is a folder; give a file in it, such as run.nc.")

    def keep(self, part: Run, state: State) -> None:
        """Add a chunk, and the state at its end.

        Raises
        ------
        OutputError
            When the file cannot be written.
        """
        try:
            if self._begun:
                self._append(part, state)
            else:
                self._begin(part, state)
        except OSError as error:
            raise OutputError(f"{self._path} cannot be written: {error.strerror or error}.") from None
        self._begun = True

    def _begin(self, part: Run, state: State) -> None:
        import h5py

        aside = self._path.with_name(f"{self._path.name}.new")
        part.to_dataset().to_netcdf(aside, engine="h5netcdf", unlimited_dims=_GROWING)
        with h5py.File(aside, "r+") as file:
            group = file.create_group(_GROUP)
            for name, text in (fingerprints(self._dynamics) | {"request": self._request.as_text()}).items():
                group.create_dataset(name, data=text)
            group["times"] = self._request.times
            _write(group.create_group("state"), state)
        mend(self._path)  # a journal that an earlier file left must not outlive it
        aside.replace(self._path)

    def _append(self, part: Run, state: State) -> None:
        import h5py

        with staged(self._path) as change, h5py.File(change, "r+") as file:
            for name, variable in part.to_dataset().variables.items():
                if variable.dims and variable.dims[0] in _GROWING:
                    _grow(_dataset(file, str(name)), variable.values)
            for name in ("evaluations", "switches", "local_errors"):
                file.attrs.modify(name, getattr(part, name))
            _write(_group(file, f"{_GROUP}/state"), state)


def read_stored(path: Path, dynamics: Dynamics) -> Stored:
    """What is needed to go on with a run.

    Raises
    ------
    SimulationError
        No such file, no stored run, one that is complete, or one of another model.
    """
    import h5py

    if not path.is_file():
        raise SimulationError(
            f"there is no file {path}; a run that was stored with simulate(..., store=...) is expected."
        )
    mend(path)
    try:
        with h5py.File(path, "r") as file:
            group, held = _group(file, _GROUP), _group(file, f"{_GROUP}/state")
            prints = {name: str(_dataset(group, name).asstr()[()]) for name in fingerprints(dynamics)}
            asked = Request.of_text(str(_dataset(group, "request").asstr()[()]), _dataset(group, "times")[:])
            request = replace(asked, method=file.attrs["method"])  # what "auto" took, should it take another now
            state = {name: np.asarray(_dataset(held, name)[()]) for name in map(str, held)}
            count, status = len(_dataset(file, "time")), str(_dataset(file, "status").asstr()[-1])
    except (OSError, KeyError, ValueError):
        raise SimulationError(
            f"{path} is no run that can go on; one stored with simulate(..., store=...) is expected."
        ) from None
    for name, value in fingerprints(dynamics).items():
        if prints[name] != value:
            raise SimulationError(f"{path} was recorded with other {name}; resume with the scene that it began with.")
    if count == request.times.size:
        raise SimulationError(f"{path} is complete: all {count} records are there; read it with Run.load.")
    return Stored(request, state, count, status)


def is_complete(path: Path) -> bool:
    """Whether every record that was asked for is in a stored run."""
    import h5py

    mend(path)
    with h5py.File(path, "r") as file:
        return len(_dataset(file, "time")) == len(_dataset(_group(file, _GROUP), "times"))


def fingerprints(dynamics: Dynamics) -> dict[str, str]:
    """Hashes of what must be the same when a run goes on."""
    members = dynamics.members
    materials = (
        members.mass, members.stiffness, members.rest_lengths, members.floors, members.inputs, dynamics.damping,
        dynamics.drag, dynamics.clamped, members.lag, members.law == "EA",
    )  # fmt: skip
    if not members.gearing.plain:
        materials += (members.gearing.motor, members.gearing.ratio)
    return {
        "nodes and members": hashlib.sha256(json.dumps(dynamics.structure.as_recipe()).encode()).hexdigest(),
        "materials": _hash(materials),
        "loads": _hash((members.forces,)),
    }


def _hash(values: tuple) -> str:
    made = hashlib.sha256()
    for value in values:
        made.update(np.ascontiguousarray(value).tobytes())
    return made.hexdigest()


def _write(group: h5py.Group, state: State) -> None:
    for name, value in state.items():
        if name in group and _dataset(group, name).shape == np.shape(value):
            _dataset(group, name)[()] = value
        else:
            group.pop(name, None)
            group[name] = value


def _grow(kept: h5py.Dataset, values: np.ndarray) -> None:
    before = len(kept)
    kept.resize(before + len(values), axis=0)
    kept[before:] = values


def _group(parent: h5py.Group, name: str) -> h5py.Group:
    import h5py

    found = parent[name]
    if not isinstance(found, h5py.Group):
        raise KeyError(name)
    return found


def _dataset(parent: h5py.Group, name: str) -> h5py.Dataset:
    import h5py

    found = parent[name]
    if not isinstance(found, h5py.Dataset):
        raise KeyError(name)
    return found
