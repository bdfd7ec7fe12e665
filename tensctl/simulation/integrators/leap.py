"""One step of a splitting: kicks by forces between exact flights of the rods, with the tendons' springs as they are.

    for each stage:  v += b h a(q),   fly for a h,   t += a h

Rest lengths and loads may change with time: time flies along with the rods. Springs are frozen for the step, so the
force is smooth and the step has its full order; `switching` sees to tendons that go slack or taut.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare, part
from tensctl.model.kernel import cable_forces, cable_rates, gap_rates, springs
from tensctl.simulation.drive import drive_at, drive_rate
from tensctl.simulation.integrators.flight import fly, kick, swift, trim
from tensctl.simulation.integrators.kept import Kept, opened
from tensctl.simulation.integrators.pulls import tendon_forces
from tensctl.simulation.integrators.rows import Rows, place_rows, push_rows
from tensctl.simulation.integrators.tables import Table


class Moment(NamedTuple):
    """The structure at one time: what a step starts from and ends with; arrays are changed in place.

    Attributes
    ----------
    q, v, push : (6 lanes,) rods' coordinates, rates, and accelerations without the centripetal part, in rows
    gap, rate : (nt,) length less rest length, and how it grows
    whole : (18 lanes + 2 nt,) all of them, to be copied at once
    """

    q: np.ndarray
    v: np.ndarray
    push: np.ndarray
    gap: np.ndarray
    rate: np.ndarray
    whole: np.ndarray


class Scratch(NamedTuple):
    """Working memory and the springs of the present step.

    Attributes
    ----------
    on, spring : (nt,) 1 while taut, and the stiffness that goes with it
    closest : (nt,) m
        How near each tendon came to its boundary at the stages of the last step; below zero on the wrong side.
    rest, rest_rate : (nt,)
    load, place, speed, force : (size,) nodal vectors in rows
    nodal, nodal_rate : (3N,)
        Loads node by node, where they change.
    span : (3 nt,)
        Room of `tendon_forces`, unless there are cables.
    least : float, m
        Gap that a tendon at least counts: 0 when slack is seen to stage by stage, -inf when springs are frozen.
    """

    on: np.ndarray
    spring: np.ndarray
    closest: np.ndarray
    rest: np.ndarray
    rest_rate: np.ndarray
    load: np.ndarray
    nodal: np.ndarray
    nodal_rate: np.ndarray
    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    span: np.ndarray
    least: float


class Scene(NamedTuple):
    """What does not change from step to step, handed from kernel to kernel as a `Kept`: headers are not copied then.

    Attributes
    ----------
    rows : Rows
    drive : Kept of Drive
    work : Scratch
    table : Table
    """

    rows: Rows
    drive: Kept
    work: Scratch
    table: Table


def scenes(
    rows: Rows, anchor: np.ndarray, drive: Kept, tables: tuple[Table, Table], *, frozen: bool
) -> tuple[Kept, Kept]:
    """A scene with each of two tables, and the room that both work in."""
    work = scratch(rows, anchor, frozen=frozen)
    return Kept(Scene(rows, drive, work, tables[0])), Kept(Scene(rows, drive, work, tables[1]))


def moment(rows: Rows) -> Moment:
    """Room for one moment."""
    rods, tendons = 6 * rows.row, rows.stiffness.size
    whole = np.zeros(3 * rods + 2 * tendons)
    q, v, push, gap, rate = np.split(whole, np.cumsum([rods, rods, rods, tendons]))
    q.reshape(6, -1)[3, rows.rods :] = 1.0
    return Moment(q, v, push, gap, rate, whole)


def scratch(rows: Rows, anchor: np.ndarray, *, frozen: bool) -> Scratch:
    """Room to work in; `begin` makes it ready for a drive."""
    on, spring, closest, rest, rest_rate = (np.zeros(rows.stiffness.size) for _ in range(5))
    nodal, nodal_rate = (np.zeros(anchor.size) for _ in range(2))
    load, speed, force = (np.zeros(rows.size) for _ in range(3))
    return Scratch(
        on, spring, closest, rest, rest_rate, load, nodal, nodal_rate, rows.nodal(anchor), speed, force,
        np.zeros(0 if rows.cables else 3 * rows.stiffness.size), -np.inf if frozen else 0.0,
    )  # fmt: skip


@bare
def begin(scene):
    """Put rest lengths and loads in place that do not change; nothing is left of what an earlier drive changed."""
    rows, kept, work, _ = opened(scene)
    drive = opened(kept)
    for k in range(work.rest.size):
        work.rest[k], work.rest_rate[k] = drive.rest[k], 0.0
    for a in range(rows.where.size):
        for i in range(3):
            work.load[rows.where[a] + i * rows.row] = drive.force[a, i]


@bare
def copy_moment(source, target):
    """Write one moment over another."""
    for i in range(source.whole.size):
        target.whole[i] = source.whole[i]


@part
def loads_at(rows, drive, t, work):
    """Rest lengths and loads at time t, where they change."""
    drive_at(drive, t, work.rest, work.nodal)
    if drive.swept:
        for a in range(rows.where.size):
            for i in range(3):
                work.load[rows.where[a] + i * rows.row] = work.nodal[3 * a + i]


@part
def push_at(rows, drive, t, now, work):
    """Accelerations and gaps at time t."""
    if drive.ramped or drive.swept:
        loads_at(rows, drive, t, work)
    if drive.ramped and rows.by_strain:
        springs(rows, work.rest, work.on, work.spring)
    place_rows(rows, now.q, work.place)
    if rows.cables:
        cable_forces(rows, work.place, work.rest, work.spring, work.least, work.load, work.force, now.gap)
    else:
        tendon_forces(rows, work.place, work.rest, work.spring, work.least, work.load, work.span, work.force, now.gap)
    push_rows(rows, now.q, work.force, now.push)


@bare
def refresh(scene, t, now):
    """`push_at` on its own."""
    rows, drive, work, _ = opened(scene)
    push_at(rows, opened(drive), t, now, work)


@bare
def rates_at(scene, t, now):
    """How fast gaps grow at time t."""
    rows, kept, work, _ = opened(scene)
    drive = opened(kept)
    if drive.ramped:
        drive_rate(drive, t, work.rest_rate, work.nodal_rate)
    place_rows(rows, now.q, work.place)
    place_rows(rows, now.v, work.speed)
    if rows.cables:
        cable_rates(rows, work.place, work.speed, work.rest_rate, now.rate)
    else:
        gap_rates(rows, work.place, work.speed, work.rest_rate, now.rate)


@part
def watch(work, gap):
    """Keep how near tendons came to their boundaries."""
    for t in range(gap.size):
        here = (2.0 * work.on[t] - 1.0) * gap[t]
        work.closest[t] = work.closest[t] if work.closest[t] < here else here


@bare
def leap(scene, t, h, now):
    """Take one step of length h from time t; `now.push` is that of the start, and of the end afterwards."""
    rows, kept, work, table = opened(scene)
    drive, (kicks, drifts, _) = opened(kept), table
    for j in range(work.closest.size):
        work.closest[j] = np.inf
    watch(work, now.gap)
    kick(now.v, now.push, kicks[0] * h)
    at, far = t, swift(rows, now.v, drifts, h)
    for stage in range(drifts.size):
        fly(rows, now.q, now.v, drifts[stage] * h, far)
        at += drifts[stage] * h
        if stage == drifts.size - 1:
            trim(rows, now.q, now.v)
            at = t + h
        push_at(rows, drive, at, now, work)
        watch(work, now.gap)
        kick(now.v, now.push, kicks[stage + 1] * h)
