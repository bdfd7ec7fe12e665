"""The splitting's own arrangement of a structure: every component of all rods in one row, so that lanes work at once.

    q = (q1x of all rods, q1y, q1z, q2x, q2y, q2z),   nodes = (x of tails, x of heads, x of the rest, y ..., z ...)

Then nodes are (q1 -+ q2)/2 row by row, without an index, and the compiler turns flights, kicks and pushes into vector
instructions: 5 instead of 17 ns a rod. Rows are filled up to whole lanes with rods of zero force that stay where they
are. A rod held at one end has q1 = base + sign q2, with base = 2 p_held; a free one keeps q1, with sign = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import part
from tensctl.model import Dynamics

# Doubles in a vector register of common processors, or half of them.
_LANES = 4
_FREE, _TAIL, _HEAD = 0, 1, 2


class Rows(NamedTuple):
    """A structure for the splitting; what tendons are made of has the names of `KernelData`.

    Attributes
    ----------
    stiffness : (nt,) N/m, or N for law EA
    by_strain, cables : bool
    tail_at, head_at : (segments,) uint64
        Places of a segment's ends in the first row of nodes.
    row : int
        Nodes in a row.
    pieces : (nt,) int
    rods : int
        How many rods are real.
    over : (lanes,) 1/L^2, 1/m^2
    tail, head, centre : (lanes,) 1/kg
        q2'' by the forces on each end, and q1'' by their sum.
    held : bool
        Whether the ground holds any end.
    keep, sign : (lanes,)
    base : (3, lanes) m
    where : (N,) int
        Place of each of the kernel's nodes in a row.
    """

    stiffness: np.ndarray
    by_strain: bool
    cables: bool
    tail_at: np.ndarray
    head_at: np.ndarray
    row: int
    pieces: np.ndarray
    rods: int
    over: np.ndarray
    tail: np.ndarray
    head: np.ndarray
    centre: np.ndarray
    held: bool
    keep: np.ndarray
    sign: np.ndarray
    base: np.ndarray
    where: np.ndarray

    @property
    def lanes(self) -> int:
        """Rods in a row, the filling included."""
        return self.over.size

    def filled(self, q: np.ndarray, into: np.ndarray) -> None:
        """Write rod coordinates (nr, 6) into rows (6, lanes)."""
        into[:, : self.rods] = q.T

    def taken(self, rows: np.ndarray) -> np.ndarray:
        """Rod coordinates (nr, 6) from rows."""
        return rows[:, : self.rods].T

    def nodal(self, nodes: np.ndarray) -> np.ndarray:
        """Nodal vectors (N, 3) as rows (3 row,)."""
        rows = np.zeros((3, self.row))
        rows[:, self.where] = nodes.T
        return rows.ravel()


def rows_of(dynamics: Dynamics) -> Rows:
    """Arrange a structure whose rods share no node."""
    kernel, count = dynamics.kernel, len(dynamics.kernel.mass)
    lanes = -(-count // _LANES) * _LANES
    hold, free = kernel.hold, kernel.hold == _FREE
    where = np.full(len(kernel.anchor), -1)
    where[kernel.rod_tail], where[kernel.rod_head] = np.arange(count), lanes + np.arange(count)
    alone = where < 0
    where[alone] = 2 * lanes + np.arange(alone.sum())
    sign = np.select([hold == _TAIL, hold == _HEAD], [1.0, -1.0])
    ends = kernel.anchor[kernel.rod_tail], kernel.anchor[kernel.rod_head]
    tails, heads = (hold == _TAIL)[:, None], (hold == _HEAD)[:, None]
    base = np.where(tails, 2 * ends[0], np.where(heads, 2 * ends[1], ends[0] + ends[1]))

    def row(values: np.ndarray, filling: float = 0.0) -> np.ndarray:
        return np.concatenate([values, np.full(lanes - count, filling)])

    return Rows(
        stiffness=kernel.stiffness,
        by_strain=kernel.by_strain,
        cables=kernel.cables,
        tail_at=where[kernel.tail_at // 3].astype(np.uint64),
        head_at=where[kernel.head_at // 3].astype(np.uint64),
        row=int(2 * lanes + alone.sum()),
        pieces=kernel.pieces,
        rods=count,
        over=row(1 / kernel.lengths**2, 1.0),
        tail=row(np.select([free, hold == _HEAD], [6.0, 3.0]) / kernel.mass),
        head=row(np.select([free, hold == _TAIL], [6.0, 3.0]) / kernel.mass),
        centre=row(np.where(free, 2.0, 0.0) / kernel.mass),
        held=bool((~free).any()),
        keep=row(free.astype(float)),
        sign=row(sign),
        base=np.stack([row(np.where(free, 0.0, base[:, i])) for i in range(3)]),
        where=where,
    )


@part
def place_rows(rows, q, place):
    """Write nodes, or their velocities, from rod coordinates; nodes without a rod stay as they are."""
    n, row = np.uint64(rows.over.size), np.uint64(rows.row)
    for i in range(3):
        tails, heads = np.uint64(i) * row, np.uint64(i) * row + n
        for r in range(n):
            first, second = q[i, r], q[i + 3, r]
            place[tails + r], place[heads + r] = 0.5 * (first - second), 0.5 * (first + second)


@part
def push_rows(rows, q, force, push):
    """Acceleration of each rod by the forces on its ends, without the centripetal part."""
    n, row = np.uint64(rows.over.size), np.uint64(rows.row)
    two, tail, head, centre, sign = row + row, rows.tail, rows.head, rows.centre, rows.sign
    for r in range(n):
        u, v, w = q[3, r], q[4, r], q[5, r]
        x = head[r] * force[n + r] - tail[r] * force[r]
        y = head[r] * force[row + n + r] - tail[r] * force[row + r]
        z = head[r] * force[two + n + r] - tail[r] * force[two + r]
        along = (u * x + v * y + w * z) / (u * u + v * v + w * w)
        push[3, r], push[4, r], push[5, r] = x - along * u, y - along * v, z - along * w
    for i in range(3):
        first = np.uint64(i) * row
        for r in range(n):
            push[i, r] = centre[r] * (force[first + r] + force[first + n + r])
    if rows.held:
        for i in range(3):
            for r in range(n):
                push[i, r] += sign[r] * push[i + 3, r]
