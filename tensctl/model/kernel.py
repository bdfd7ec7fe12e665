"""The compiled kernel: the same physics as the CasADi elements, looped over topology arrays.

State of the rods: q = (q1, q2), v = (q1', q2') as (nr, 6) arrays ([S] Theorem 3.1); nodes p = (q1 -+ q2)/2. A rod held
at one end keeps q1 = 2 p_held + s q2. Code size does not depend on the structure; `tests/test_model.py` holds the
kernel to the CasADi model to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare, jit, part

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3
# m^2, added to a squared length so that a tendon whose ends meet (it is slack) has a direction of zero, not 0/0.
NOTHING = 1e-300


class KernelData(NamedTuple):
    """Topology and coefficients as flat arrays, the only argument that describes the structure.

    Tendons are given by their segments, one each without `cables`; `pieces` says how many each has, in order. Nodal
    arrays are flat, (3N,): node after node here, so that y is `row` = 1 place behind x. `tail_at`, `head_at` and the
    rods' are places in them, 3 node; unsigned, since an index that may be negative costs a comparison at every access
    (6 instead of 4.5 ns a tendon). `clamped` holds a damped tendon at T >= 0; without it a taut damper may push, as
    STEDY has it.

    Where rods share nodes, every rod keeps two ends of its own and the kernel's nodes are these ends; `first` to
    `place` are the rows that tie them together (`model.constraints`), empty where no joint or guide is.
    """

    stiffness: np.ndarray
    by_strain: bool
    damping: np.ndarray
    drag: float
    rod_tail: np.ndarray
    rod_head: np.ndarray
    hold: np.ndarray
    anchor: np.ndarray
    mass: np.ndarray
    lengths: np.ndarray
    tail_at: np.ndarray
    head_at: np.ndarray
    row: int
    rod_tail_at: np.ndarray
    rod_head_at: np.ndarray
    clamped: bool
    cables: bool
    pieces: np.ndarray
    first: np.ndarray
    second: np.ndarray
    target: np.ndarray
    couples: np.ndarray
    low: np.ndarray
    place: np.ndarray


@bare
def copy(source, target):
    """Write one (nr, 6) array over another. What numba has for slices of any shape takes seconds to compile."""
    for r in range(source.shape[0]):
        for i in range(6):
            target[r, i] = source[r, i]


@part
def place_nodes(data, q, place):
    """Write node positions (or velocities, with anchors at rest left out) from rod coordinates into a flat array."""
    one, two = np.uint64(1), np.uint64(2)
    for r in range(data.mass.size):
        a, b = data.rod_tail_at[r], data.rod_head_at[r]
        x, y, z, u, v, w = q[r, 0], q[r, 1], q[r, 2], q[r, 3], q[r, 4], q[r, 5]
        place[a], place[a + one], place[a + two] = 0.5 * (x - u), 0.5 * (y - v), 0.5 * (z - w)
        place[b], place[b + one], place[b + two] = 0.5 * (x + u), 0.5 * (y + v), 0.5 * (z + w)


@bare
def springs(data, rest, on, spring):
    """Stiffness of each tendon as it is now, N/m: none while it is slack."""
    for t in range(rest.size):
        spring[t] = on[t] * (data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t])


@part
def tug(data, force, a, b, x, y, z):
    """Add a force to the node at place a and take it from the one at b."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    force[a] += x
    force[a + one] += y
    force[a + two] += z
    force[b] -= x
    force[b + one] -= y
    force[b + two] -= z


@bare
def haul(data, s, pull, place, force):
    """Add what a segment under a tension does to the nodes at its ends."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    a, b = data.tail_at[s], data.head_at[s]
    x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
    pull /= np.sqrt(x * x + y * y + z * z + NOTHING)
    tug(data, force, a, b, pull * x, pull * y, pull * z)


@bare
def cable_forces(data, place, rest, spring, least, load, force, gap):
    """External forces and those of cables on each node: the gap of all of a cable's segments, then the pull of each.

    gap = length - rest length, of which at least `least` counts. With least = 0 a slack cable carries nothing. With
    -inf a spring pushes: whoever calls then sets `spring` to zero for slack ones and sees to it that none changes over.
    """
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    for i in range(force.size):
        force[i] = load[i]
    first = 0
    for t in range(rest.size):
        last = first + data.pieces[t]
        total = 0.0
        for s in range(first, last):
            a, b = data.tail_at[s], data.head_at[s]
            x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
            total += np.sqrt(x * x + y * y + z * z + NOTHING)
        gap[t] = total - rest[t]
        pull = spring[t] * max(gap[t], least)
        for s in range(first, last):
            haul(data, s, pull, place, force)
        first = last


@part
def gap_rates(data, place, speed, rest_rate, rate):
    """How fast each tendon's gap grows, m/s."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    for t in range(rate.size):
        a, b = data.tail_at[t], data.head_at[t]
        x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
        rate[t] = (x * u + y * v + z * w) / np.sqrt(x * x + y * y + z * z + NOTHING) - rest_rate[t]


@bare
def cable_rates(data, place, speed, rest_rate, rate):
    """`gap_rates` of a structure with cables."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    first = 0
    for t in range(rate.size):
        last = first + data.pieces[t]
        rate[t] = -rest_rate[t]
        for s in range(first, last):
            a, b = data.tail_at[s], data.head_at[s]
            x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
            u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
            rate[t] += (x * u + y * v + z * w) / np.sqrt(x * x + y * y + z * z + NOTHING)
        first = last


@bare
def damped_cable_forces(data, place, speed, rest, load, force):
    """`damped_forces` of a structure with cables: a damper acts on the rate of the whole length."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    for i in range(force.size):
        force[i] = load[i] - data.drag * speed[i]
    first = 0
    for t in range(rest.size):
        last = first + data.pieces[t]
        total, growing = 0.0, 0.0
        for s in range(first, last):
            a, b = data.tail_at[s], data.head_at[s]
            x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
            u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
            length = np.sqrt(x * x + y * y + z * z + NOTHING)
            total += length
            growing += (x * u + y * v + z * w) / length
        if total > rest[t]:
            k = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t]
            pull = k * (total - rest[t]) + data.damping[t] * growing
            if data.clamped:
                pull = max(0.0, pull)
            for s in range(first, last):
                haul(data, s, pull, place, force)
        first = last


@bare
def damped_forces(data, place, speed, rest, load, force):
    """External, tendon, damper and drag forces on each node."""
    one, two = np.uint64(data.row), np.uint64(2 * data.row)
    for i in range(force.size):
        force[i] = load[i] - data.drag * speed[i]
    for t in range(rest.size):
        a, b = data.tail_at[t], data.head_at[t]
        x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        length = np.sqrt(x * x + y * y + z * z)
        limit = rest[t]
        if length > limit:
            k = data.stiffness[t] / limit if data.by_strain else data.stiffness[t]
            u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
            pull = k * (length - limit) + data.damping[t] * (x * u + y * v + z * w) / length
            if data.clamped:
                pull = max(0.0, pull)
            pull /= length
            tug(data, force, a, b, pull * x, pull * y, pull * z)


@part
def pushes(data, q, force, push):
    """Acceleration of each rod by the forces on its ends, without the centripetal part, as (nr, 6)."""
    one, two = np.uint64(1), np.uint64(2)
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        a, b, m = data.rod_tail_at[r], data.rod_head_at[r], data.mass[r]
        if hold == _FREE:
            scale = 6.0 / m
            x, y, z = force[b] - force[a], force[b + one] - force[a + one], force[b + two] - force[a + two]
        elif hold == _TAIL:
            scale = 3.0 / m
            x, y, z = force[b], force[b + one], force[b + two]
        else:
            scale = 3.0 / m
            x, y, z = -force[a], -force[a + one], -force[a + two]
        u, v, w = q[r, 3], q[r, 4], q[r, 5]
        along = (u * x + v * y + w * z) / (u * u + v * v + w * w)
        push[r, 3] = scale * (x - along * u)
        push[r, 4] = scale * (y - along * v)
        push[r, 5] = scale * (z - along * w)
        if hold == _FREE:
            push[r, 0] = 2.0 / m * (force[a] + force[b])
            push[r, 1] = 2.0 / m * (force[a + one] + force[b + one])
            push[r, 2] = 2.0 / m * (force[a + two] + force[b + two])
        else:
            sign = 1.0 if hold == _TAIL else -1.0
            for i in range(3):
                push[r, i] = sign * push[r, 3 + i]


@jit
def accelerations(data, q, v, rest, external, acceleration):
    """Full right-hand side q'' of [S] (5.21) with dampers and drag, as (nr, 6)."""
    size = external.size
    place, speed, force = data.anchor.reshape(size).copy(), np.zeros(size), np.empty(size)
    place_nodes(data, q, place)
    place_nodes(data, v, speed)
    if data.cables:
        damped_cable_forces(data, place, speed, rest, external.reshape(size), force)
    else:
        damped_forces(data, place, speed, rest, external.reshape(size), force)
    pushes(data, q, force, acceleration)
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        spin = v[r, 3] ** 2 + v[r, 4] ** 2 + v[r, 5] ** 2
        spin /= q[r, 3] ** 2 + q[r, 4] ** 2 + q[r, 5] ** 2
        for i in range(3, 6):
            acceleration[r, i] -= spin * q[r, i]
            if hold == _TAIL:
                acceleration[r, i - 3] -= spin * q[r, i]
            elif hold == _HEAD:
                acceleration[r, i - 3] += spin * q[r, i]


@bare
def tidy(data, q, v):
    """Put rods back to their lengths and held ends back to the ground; take velocities along rods away."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == 3:
            continue
        square = q[r, 3] ** 2 + q[r, 4] ** 2 + q[r, 5] ** 2
        along = (q[r, 3] * v[r, 3] + q[r, 4] * v[r, 4] + q[r, 5] * v[r, 5]) / square
        scale = data.lengths[r] / np.sqrt(square)
        for i in range(3, 6):
            v[r, i] -= along * q[r, i]
            q[r, i] *= scale
        if hold != 0:
            sign = 1.0 if hold == 1 else -1.0
            held = data.rod_tail[r] if hold == 1 else data.rod_head[r]
            for i in range(3):
                q[r, i] = 2.0 * data.anchor[held, i] + sign * q[r, 3 + i]
                v[r, i] = sign * v[r, 3 + i]
