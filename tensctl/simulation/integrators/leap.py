"""One step of a splitting: kicks by forces between exact flights of the rods, with the tendons' springs as they are.

    for each stage:  v += b h a(q),   fly for a h,   t += a h

Rest lengths and loads may change with time: time flies along with the rods. Springs are frozen for the step, so the
force is smooth and the step has its full order; `switching` sees to tendons that go slack or taut.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit, part
from tensctl.model.kernel import cable_forces, cable_rates, elastic_forces, gap_rates, place_nodes, pushes, springs
from tensctl.simulation.drive import drive_at, drive_rate
from tensctl.simulation.integrators.flight import fly, kick

_FREE, _TAIL, _FIXED = 0, 1, 3


class Moment(NamedTuple):
    """The structure at one time: what a step starts from and ends with; arrays are changed in place.

    Attributes
    ----------
    q, v, push : (nr, 6) rods' coordinates, rates, and accelerations without the centripetal part
    gap, rate : (nt,) length less rest length, and how it grows
    """

    q: np.ndarray
    v: np.ndarray
    push: np.ndarray
    gap: np.ndarray
    rate: np.ndarray


class Scratch(NamedTuple):
    """Working memory and the springs of the present step.

    Attributes
    ----------
    on, spring : (nt,) 1 while taut, and the stiffness that goes with it
    rest, rest_rate : (nt,)
    load, load_rate, place, speed, force : (3N,)
    least : float, m
        Gap that a tendon at least counts: 0 when slack is seen to stage by stage, -inf when springs are frozen.
    """

    on: np.ndarray
    spring: np.ndarray
    rest: np.ndarray
    rest_rate: np.ndarray
    load: np.ndarray
    load_rate: np.ndarray
    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    least: float


def moment(rods: int, tendons: int) -> Moment:
    """Room for one moment."""
    q, v, push = (np.zeros((rods, 6)) for _ in range(3))
    return Moment(q, v, push, np.zeros(tendons), np.zeros(tendons))


def scratch(anchor: np.ndarray, rest: np.ndarray, load: np.ndarray, *, frozen: bool) -> Scratch:
    """Room to work in, with rest lengths and loads that do not change already in place."""
    on, spring, rest_rate = (np.zeros_like(rest) for _ in range(3))
    load_rate, speed, force = (np.zeros(anchor.size) for _ in range(3))
    least = -np.inf if frozen else 0.0
    return Scratch(on, spring, rest.copy(), rest_rate, load.flatten(), load_rate, anchor.flatten(), speed, force, least)


@jit
def copy_moment(source, target):
    """Write one moment over another."""
    for r in range(source.q.shape[0]):
        for i in range(6):
            target.q[r, i], target.v[r, i], target.push[r, i] = source.q[r, i], source.v[r, i], source.push[r, i]
    for t in range(source.gap.size):
        target.gap[t], target.rate[t] = source.gap[t], source.rate[t]


@part
def push_at(data, drive, t, now, work):
    """Accelerations and gaps at time t."""
    if drive.ramped or drive.swept:
        drive_at(drive, t, work.rest, work.load)
    if drive.ramped and data.by_strain:
        springs(data, work.rest, work.on, work.spring)
    place_nodes(data, now.q, work.place)
    if data.cables:
        cable_forces(data, work.place, work.rest, work.spring, work.least, work.load, work.force, now.gap)
    else:
        elastic_forces(data, work.place, work.rest, work.spring, work.least, work.load, work.force, now.gap)
    pushes(data, now.q, work.force, now.push)


@jit
def refresh(data, drive, t, now, work):
    """`push_at` on its own."""
    push_at(data, drive, t, now, work)


@jit
def rates_at(data, drive, t, now, work):
    """How fast gaps grow at time t, from nodes that `push_at` placed."""
    if drive.ramped:
        drive_rate(drive, t, work.rest_rate, work.load_rate)
    place_nodes(data, now.v, work.speed)
    if data.cables:
        cable_rates(data, work.place, work.speed, work.rest_rate, now.rate)
    else:
        gap_rates(data, work.place, work.speed, work.rest_rate, now.rate)


@part
def trim(data, q, v):
    """Take rounding out of rod lengths and out of velocities along rods: one Newton step of 1/sqrt."""
    for r in range(data.mass.size):
        if data.hold[r] == _FIXED:
            continue
        over = 1.0 / (data.lengths[r] * data.lengths[r])
        x, y, z = q[r, 3], q[r, 4], q[r, 5]
        scale = 1.5 - 0.5 * over * (x * x + y * y + z * z)
        along = over * (x * v[r, 3] + y * v[r, 4] + z * v[r, 5])
        for i in range(3, 6):
            v[r, i] -= along * q[r, i]
            q[r, i] *= scale
        if data.hold[r] != _FREE:
            sign = 1.0 if data.hold[r] == _TAIL else -1.0
            held = data.rod_tail[r] if data.hold[r] == _TAIL else data.rod_head[r]
            for i in range(3):
                q[r, i] = 2.0 * data.anchor[held, i] + sign * q[r, 3 + i]
                v[r, i] = sign * v[r, 3 + i]


@jit
def leap(data, drive, t, h, kicks, drifts, now, work):
    """Take one step of length h from time t; `now.push` is that of the start, and of the end afterwards."""
    kick(data, now.v, now.push, kicks[0] * h)
    at = t
    for stage in range(drifts.size):
        fly(data, now.q, now.v, drifts[stage] * h)
        at += drifts[stage] * h
        if stage == drifts.size - 1:
            trim(data, now.q, now.v)
            at = t + h
        push_at(data, drive, at, now, work)
        kick(data, now.v, now.push, kicks[stage + 1] * h)
