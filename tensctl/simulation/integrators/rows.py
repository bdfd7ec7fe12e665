"""The splitting's own arrangement of a structure: every component of all rods in one row, so that lanes work at once.

    q = (q1, q2),   nodes = (tails, heads, the rest),   each of them x of all in a row, then y, then z

Then nodes are (q1 -+ q2)/2 in one stroke, without an index, and the compiler turns flights, kicks and pushes into
vector instructions. Everything lies flat: what is done to every component alike is one loop. Rows are filled up to
whole lanes with rods of zero force that stay where they are. A rod held at one end has q1 = base + sign q2, with
base = 2 p_held; a free one keeps q1, with sign = 0.
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
        Places of x of a segment's ends among nodes.
    row : int
        Places from x to y, and from y to z; as many as there are lanes.
    pieces : (nt,) int
    rods : int
        How many rods are real.
    over : (lanes,) 1/L^2, 1/m^2
    tail, head : (lanes,) 1/kg
        q2'' by the force on each end.
    centre : (3 lanes,) 1/kg
        q1'' by the sum of both.
    held : bool
        Whether the ground holds any end.
    keep, sign : (3 lanes,)
    base : (3 lanes,) m
    where : (N,) int
        Place of x of each of the kernel's nodes.
    size : int
        Places of all nodes.
    ends : (2 rods,) uint64
        Places of x of the rods' ends.
    last : (2 rods,) uint64
        Entries of `meeting` and `side` up to those of each end.
    meeting : (2 nt,) uint64
        Tendons at one rod end after another.
    side : (2 nt,)
        1 where it is the tendon's tail, -1 where it is its head.
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
    size: int
    ends: np.ndarray
    last: np.ndarray
    meeting: np.ndarray
    side: np.ndarray

    def nodal(self, nodes: np.ndarray) -> np.ndarray:
        """Nodal vectors (N, 3) in rows, (size,)."""
        rows = np.zeros(self.size)
        for i in range(3):
            rows[self.where + i * self.row] = nodes[:, i]
        return rows


def rows_of(dynamics: Dynamics) -> Rows:
    """Arrange a structure whose rods share no node."""
    kernel, count = dynamics.kernel, len(dynamics.kernel.mass)
    lanes = -(-count // _LANES) * _LANES
    hold, free = kernel.hold, kernel.hold == _FREE
    where = np.full(len(kernel.anchor), -1)
    where[kernel.rod_tail], where[kernel.rod_head] = np.arange(count), 3 * lanes + np.arange(count)
    alone = np.flatnonzero(where < 0)
    block, place = np.divmod(np.arange(alone.size), lanes)
    where[alone] = (6 + 3 * block) * lanes + place
    sign = np.select([hold == _TAIL, hold == _HEAD], [1.0, -1.0])
    ends = kernel.anchor[kernel.rod_tail], kernel.anchor[kernel.rod_head]
    tails, heads = (hold == _TAIL)[:, None], (hold == _HEAD)[:, None]
    base = np.where(tails, 2 * ends[0], np.where(heads, 2 * ends[1], ends[0] + ends[1]))

    tail_at, head_at = where[kernel.tail_at // 3], where[kernel.head_at // 3]
    rod_ends = np.concatenate([where[kernel.rod_tail], where[kernel.rod_head]])
    last, meeting, side = meetings(rod_ends, tail_at, head_at)

    def row(values: np.ndarray, filling: float = 0.0) -> np.ndarray:
        return np.concatenate([values, np.full(lanes - count, filling)])

    return Rows(
        stiffness=kernel.stiffness,
        by_strain=kernel.by_strain,
        cables=kernel.cables,
        tail_at=tail_at.astype(np.uint64),
        head_at=head_at.astype(np.uint64),
        row=lanes,
        pieces=kernel.pieces,
        rods=count,
        over=row(1 / kernel.lengths**2, 1.0),
        tail=row(np.select([free, hold == _HEAD], [6.0, 3.0]) / kernel.mass),
        head=row(np.select([free, hold == _TAIL], [6.0, 3.0]) / kernel.mass),
        centre=np.tile(row(np.where(free, 2.0, 0.0) / kernel.mass), 3),
        held=bool((~free).any()),
        keep=np.tile(row(free.astype(float)), 3),
        sign=np.tile(row(sign), 3),
        base=np.concatenate([row(np.where(free, 0.0, base[:, i])) for i in range(3)]),
        where=where,
        size=(6 + 3 * -(-alone.size // lanes)) * lanes,
        ends=rod_ends.astype(np.uint64),
        last=last.astype(np.uint64),
        meeting=meeting.astype(np.uint64),
        side=side,
    )


def meetings(ends: np.ndarray, tail_at: np.ndarray, head_at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`last`, `meeting` and `side` of `Rows`: who ends where, the ground left out."""
    tendons, places = np.tile(np.arange(tail_at.size), 2), np.concatenate([tail_at, head_at])
    side, order = np.repeat([1.0, -1.0], tail_at.size), np.argsort(ends)
    end = order[np.minimum(np.searchsorted(ends, places, sorter=order), ends.size - 1)]
    met = np.flatnonzero(ends[end] == places)
    met = met[np.argsort(end[met], kind="stable")]
    return np.cumsum(np.bincount(end[met], minlength=ends.size)), tendons[met], side[met]


@part
def place_rows(rows, q, place):
    """Write nodes, or their velocities, from rod coordinates; nodes without a rod stay as they are."""
    half = np.uint64(3 * rows.row)
    for i in range(half):
        first, second = q[i], q[half + i]
        place[i], place[half + i] = 0.5 * (first - second), 0.5 * (first + second)


@part
def push_rows(rows, q, force, push):
    """Acceleration of each rod by the forces on its ends, without the centripetal part."""
    n, tail, head, over = np.uint64(rows.row), rows.tail, rows.head, rows.over
    two, half = n + n, n + n + n
    direction, other, swing = q[half:], force[half:], push[half:]
    for r in range(n):
        u, v, w = direction[r], direction[n + r], direction[two + r]
        x = head[r] * other[r] - tail[r] * force[r]
        y = head[r] * other[n + r] - tail[r] * force[n + r]
        z = head[r] * other[two + r] - tail[r] * force[two + r]
        along = over[r] * (u * x + v * y + w * z)
        swing[r], swing[n + r], swing[two + r] = x - along * u, y - along * v, z - along * w
    for i in range(half):
        push[i] = rows.centre[i] * (force[i] + other[i])
    if rows.held:
        for i in range(half):
            push[i] += rows.sign[i] * swing[i]


@part
def fill(rows, rods, into):
    """Write rod coordinates (nr, 6) into rows."""
    for r in range(rows.rods):
        for i in range(6):
            into[i * rows.row + r] = rods[r, i]


@part
def take(rows, values, rods):
    """Write rows as rod coordinates (nr, 6)."""
    for r in range(rows.rods):
        for i in range(6):
            rods[r, i] = values[i * rows.row + r]
