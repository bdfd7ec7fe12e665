"""What is kept of a run while it goes on: rods' states and rest lengths; all else follows from them at the end."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.model import Dynamics
from tensctl.model.tensions import tensions_at
from tensctl.simulation.propagate import leave
from tensctl.structure import Structure


class Record:
    """Room for the states at given times, filled from front to back; with `room`, for so many of them at once."""

    def __init__(
        self, times: np.ndarray, rods: int, tendons: int, room: int | None = None, *, lags: bool = False
    ) -> None:
        self.times, self.first = times, 0
        room = times.size if room is None else min(room, times.size)
        self._q, self._v = (np.empty((room, rods, 6)) for _ in range(2))
        self._rest, self._asked = (np.empty((room, kept)) for kept in (tendons, tendons if lags else 0))
        self._status = np.full(room, "", object)

    @property
    def here(self) -> np.ndarray:
        """Times that there is room for now."""
        return self.times[self.first : self.first + len(self._q)]

    def turn_to(self, first: int) -> None:
        """Make room for the times from `first` on; those before are forgotten."""
        self.first, room = first, min(len(self._q), self.times.size - first)
        kept = self._q, self._v, self._rest, self._asked, self._status
        self._q, self._v, self._rest, self._asked, self._status = (a[:room] for a in kept)

    def between(self, t0: float, t1: float) -> slice:
        """Rows of the times after t0 up to t1."""
        return slice(*np.searchsorted(self.times, [t0, t1], side="right"))

    def put(
        self, rows: slice, q: np.ndarray, v: np.ndarray, rest: np.ndarray, asked: np.ndarray | None, status: str
    ) -> None:  # fmt: skip
        """Keep some rows; of what is asked for only where rest lengths lag."""
        rows = slice(rows.start - self.first, rows.stop - self.first)
        self._q[rows], self._v[rows], self._rest[rows], self._status[rows] = q, v, rest, status
        if self._asked.size:
            self._asked[rows] = asked

    def mark(self, t: float, status: str) -> None:
        """Say what a controller said at time t, when that is kept."""
        row = int(np.searchsorted(self.here, t))
        if row < self.here.size and self.here[row] == t:
            self._status[row] = status

    def motion(self, dynamics: Dynamics) -> dict[str, Any]:
        """What a `Run` holds of all rows: times, states, lengths, tensions, rest lengths, inputs, commands, status."""
        structure, members = dynamics.structure, dynamics.members
        nodes, velocities = placed(structure, self._q, self._v)
        length = structure.lengths_at(nodes)
        return {
            "time": self.here,
            "nodes": nodes,
            "velocities": velocities,
            "lengths": length,
            "tensions": tensions_at(dynamics, nodes, velocities, length, self._rest),
            "rest_lengths": self._rest,
            "inputs": members.inputs_of(self._rest),
            "commands": members.inputs_of(self._asked) if members.lag else None,
            "status": self._status.astype(str),
        }


def placed(
    structure: Structure, q: Float[np.ndarray, "t rods 6"], v: Float[np.ndarray, "t rods 6"]
) -> tuple[Float[np.ndarray, "t nodes 3"], Float[np.ndarray, "t nodes 3"]]:
    """Nodes and velocities from rods' coordinates and rates; what no rod moves stays where the structure has it."""
    nodes, velocities = (np.empty((len(q), *structure.nodes.shape)) for _ in range(2))
    leave(structure.rods, structure.nodes, structure.held, q, v, nodes, velocities)
    return nodes, velocities
