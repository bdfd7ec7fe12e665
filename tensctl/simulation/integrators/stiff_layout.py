"""Which pairs of rods a stiff step has blocks for, how they are eliminated, and its working memory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import part
from tensctl.model.kernel import KernelData
from tensctl.simulation.integrators.block_lu import Elimination, plan
from tensctl.simulation.integrators.chart import chart_drag, chart_mass
from tensctl.simulation.integrators.kept import Kept, opened
from tensctl.simulation.integrators.rodas import Table

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3


class Plan(NamedTuple):
    """What a structure's stiff steps share.

    Attributes
    ----------
    rod : (nt, 2) rod that each end of a tendon moves with; -1 for the ground
    centre, lever : (nt, 2) how it moves with the rod's q1 and q2, the tail's sign turned: d = p_head - p_tail
    slots : (nt, 2, 2) block of the rods at two ends; -1 where one is the ground
    mass, drag : (5 nr,)
    decay : (nt,) rate at which a tendon's damper stops its ends when they are free, 1/s, or a bound on it
    elimination : order and blocks of the factorisation
    """

    rod: np.ndarray
    centre: np.ndarray
    lever: np.ndarray
    slots: np.ndarray
    mass: np.ndarray
    drag: np.ndarray
    decay: np.ndarray
    elimination: Elimination


def plan_steps(data) -> Plan:
    """Plan for a structure's kernel data."""
    count = data.mass.size
    rod, sign = np.full(len(data.anchor), -1), np.zeros(len(data.anchor))
    for ends, held, side in ((data.rod_tail, _TAIL, -1.0), (data.rod_head, _HEAD, 1.0)):
        moving = np.flatnonzero((data.hold != held) & (data.hold != _FIXED))
        rod[ends[moving]], sign[ends[moving]] = moving, side
    nodes = np.stack([data.tail_at // 3, data.head_at // 3], axis=1).astype(int)
    ends, free = rod[nodes], data.hold[rod[nodes]] == _FREE
    way = np.where(ends < 0, 0.0, np.array([-1.0, 1.0]))
    real = (ends[:, :, None] >= 0) & (ends[:, None, :] >= 0)
    keys = np.where(real, ends[:, :, None] * count + ends[:, None, :], 0)
    diagonal = np.arange(count) * (count + 1)
    every = np.concatenate([diagonal, np.setdiff1d(keys[real], diagonal)])
    elimination = plan(every // count, every % count, count)
    order = np.argsort(every)
    slots = elimination.place[order[np.searchsorted(every, keys, sorter=order)]]
    return Plan(
        rod=ends, centre=np.where(free, 0.5, 0.0) * way, lever=np.where(free, 0.5, 1.0) * way * sign[nodes],
        slots=np.where(real, slots, -1), mass=chart_mass(data), drag=chart_drag(data),
        decay=data.damping * _mobility(data, ends).sum(axis=1), elimination=elimination,
    )  # fmt: skip


def _mobility(data, rod: np.ndarray) -> np.ndarray:
    """How fast the ends of tendons give way at most, (nt, 2) 1/kg; nothing on the ground."""
    return np.where(rod < 0, 0.0, np.where(data.hold[rod] == _FREE, 4.0, 3.0) / data.mass[rod])


class Room(NamedTuple):
    """Working memory of a run, overwritten at every step.

    Attributes
    ----------
    frame : (nr, 3, 3)
    place, speed, force, load, load_rate : (3N,) of nodes
    rest, rest_rate, side, on, press : (nt,) of tendons; `on` says which pull
    pull, turn : (nt, 2, 5), own : (nr,), see `blocks`
    A : (blocks, 5, 5), the factors
    y, end, right : (10 nr,) start of the step, state of a stage and at last the new state, right-hand side
    start, by_time : (5 nr,) accelerations at the start, and their derivative by time alone
    U : (stages, 10 nr)
    """

    frame: np.ndarray
    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    load: np.ndarray
    load_rate: np.ndarray
    rest: np.ndarray
    rest_rate: np.ndarray
    side: np.ndarray
    on: np.ndarray
    press: np.ndarray
    pull: np.ndarray
    turn: np.ndarray
    own: np.ndarray
    A: np.ndarray
    y: np.ndarray
    end: np.ndarray
    right: np.ndarray
    start: np.ndarray
    by_time: np.ndarray
    U: np.ndarray


def room_for(data, plan: Plan, stages: int) -> Room:
    """Working memory for a structure and a number of stages."""
    nodes, nr, nt = len(data.anchor), data.mass.size, data.tail_at.size
    shapes = {
        "frame": (nr, 3, 3), "pull": (nt, 2, 5), "turn": (nt, 2, 5), "own": (nr,),
        "A": (plan.elimination.size, 5, 5), "U": (stages, 10 * nr),
    }  # fmt: skip
    shapes |= dict.fromkeys(("speed", "force", "load", "load_rate"), (3 * nodes,))
    shapes |= dict.fromkeys(("rest", "rest_rate", "side", "press"), (nt,))
    shapes |= dict.fromkeys(("y", "end", "right"), (10 * nr,)) | dict.fromkeys(("start", "by_time"), (5 * nr,))
    zeros = {name: np.zeros(shape) for name, shape in shapes.items()}
    return Room(place=data.anchor.ravel().copy(), on=np.zeros(nt, np.bool_), **zeros)


class Task(NamedTuple):
    """All that a march works on, handed from kernel to kernel as a `Kept`.

    Attributes
    ----------
    data : KernelData
    plan : Plan
    drive : Kept of Drive
    table : Table
    room : Room
    """

    data: KernelData
    plan: Plan
    drive: Kept
    table: Table
    room: Room


@part
def unpacked(task):
    """Its parts, the drive opened as well."""
    data, plan, drive, table, room = opened(task)
    return data, plan, opened(drive), table, room
