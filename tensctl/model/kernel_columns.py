"""The compiled kernel's exact derivative: columns of small changes carried along with the state.

    q'' = a(q, q', L),   columns   da = a_q dq + a_v dq' + a_L dL

A column is one direction in which the state and the rest lengths change; columns stand last in every array, so the
innermost loops run over them. A slack tendon carries nothing and its columns are zero, a clamped damper's likewise: the
derivative is that of the side on which the state is, exactly. Nothing is smoothed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare
from tensctl.model.kernel import NOTHING, KernelData, tidy

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3


class ColumnRoom(NamedTuple):
    """Flat nodal arrays (3N,) and their columns (3N, nc); `pull` holds the columns of one tendon's tension."""

    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    places: np.ndarray
    speeds: np.ndarray
    forces: np.ndarray
    pull: np.ndarray


def column_room(data: KernelData, columns: int) -> ColumnRoom:
    """Room for so many columns."""
    size = data.anchor.size
    places, speeds, forces = (np.zeros((size, columns)) for _ in range(3))
    place, speed, force = data.anchor.ravel().copy(), np.zeros(size), np.zeros(size)
    return ColumnRoom(place, speed, force, places, speeds, forces, np.zeros(columns))


@bare
def copy_columns(source, target, count):
    """Write the first columns of one (nr, 6, nc) array over those of another."""
    for r in range(source.shape[0]):
        for i in range(6):
            for c in range(count):
                target[r, i, c] = source[r, i, c]


@bare
def place_columns(data, q, dq, count, place, places):
    """Fill node positions (or velocities) and their columns from rod coordinates."""
    for r in range(data.mass.size):
        a, b = 3 * data.rod_tail[r], 3 * data.rod_head[r]
        for i in range(3):
            place[a + i], place[b + i] = 0.5 * (q[r, i] - q[r, 3 + i]), 0.5 * (q[r, i] + q[r, 3 + i])
            for c in range(count):
                places[a + i, c] = 0.5 * (dq[r, i, c] - dq[r, 3 + i, c])
                places[b + i, c] = 0.5 * (dq[r, i, c] + dq[r, 3 + i, c])


@bare
def segment(data, s, room):
    """A segment's ends, direction and length, and how fast its ends move apart."""
    a, b = int(data.tail_at[s]), int(data.head_at[s])
    x = room.place[b] - room.place[a]
    y = room.place[b + 1] - room.place[a + 1]
    z = room.place[b + 2] - room.place[a + 2]
    length = np.sqrt(x * x + y * y + z * z + NOTHING)
    u = room.speed[b] - room.speed[a]
    v = room.speed[b + 1] - room.speed[a + 1]
    w = room.speed[b + 2] - room.speed[a + 2]
    return a, b, x / length, y / length, z / length, length, u, v, w


@bare
def lengthened(data, t, first, room):
    """Length of a tendon whose segments begin at `first`, and its rate."""
    length, growing = 0.0, 0.0
    for s in range(first, first + data.pieces[t]):
        _, _, x, y, z, part, u, v, w = segment(data, s, room)
        length += part
        growing += x * u + y * v + z * w
    return length, growing


@bare
def stretched(data, t, first, room, dL, begins, count, slope, by_rest, damping, pull):
    """Fill the columns of slope l + damping l' - by_rest L of a tendon whose segments begin at `first`.

    Columns before `begins` do not change its rest length.
    """
    for c in range(count):
        pull[c] = 0.0
    for c in range(begins, count):
        pull[c] = -by_rest * dL[t, c]
    for s in range(first, first + data.pieces[t]):
        a, b, x, y, z, length, u, v, w = segment(data, s, room)
        places, speeds = room.places, room.speeds
        for c in range(count):
            pull[c] += slope * (
                x * (places[b, c] - places[a, c])
                + y * (places[b + 1, c] - places[a + 1, c])
                + z * (places[b + 2, c] - places[a + 2, c])
            )
        if damping > 0.0:
            along = x * u + y * v + z * w
            p, q, r = (u - along * x) / length, (v - along * y) / length, (w - along * z) / length
            for c in range(count):
                pull[c] += damping * (
                    x * (speeds[b, c] - speeds[a, c])
                    + y * (speeds[b + 1, c] - speeds[a + 1, c])
                    + z * (speeds[b + 2, c] - speeds[a + 2, c])
                    + p * (places[b, c] - places[a, c])
                    + q * (places[b + 1, c] - places[a + 1, c])
                    + r * (places[b + 2, c] - places[a + 2, c])
                )


@bare
def haul_columns(data, s, tension, count, room):
    """Add a segment's pull and its columns to the forces on the nodes at its ends."""
    a, b, x, y, z, length, _, _, _ = segment(data, s, room)
    force, forces, places, pull = room.force, room.forces, room.places, room.pull
    across = tension / length
    for i, n in enumerate((x, y, z)):
        force[a + i] += tension * n
        force[b + i] -= tension * n
    for c in range(count):
        p = places[b, c] - places[a, c]
        q = places[b + 1, c] - places[a + 1, c]
        r = places[b + 2, c] - places[a + 2, c]
        along = pull[c] - across * (x * p + y * q + z * r)
        p, q, r = across * p + along * x, across * q + along * y, across * r + along * z
        forces[a, c] += p
        forces[a + 1, c] += q
        forces[a + 2, c] += r
        forces[b, c] -= p
        forces[b + 1, c] -= q
        forces[b + 2, c] -= r


@bare
def force_columns(data, rest, dL, begins, count, load, room):
    """Fill nodal forces and their columns."""
    for i in range(load.size):
        room.force[i] = load[i] - data.drag * room.speed[i]
        for c in range(count):
            room.forces[i, c] = -data.drag * room.speeds[i, c]
    first = 0
    for t in range(rest.size):
        length, growing = lengthened(data, t, first, room)
        if length > rest[t]:
            k = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t]
            tension = k * (length - rest[t]) + data.damping[t] * growing
            if tension > 0.0 or not data.clamped:
                by_rest = k * length / rest[t] if data.by_strain else k
                stretched(data, t, first, room, dL, begins, count, k, by_rest, data.damping[t], room.pull)
                for s in range(first, first + data.pieces[t]):
                    haul_columns(data, s, tension, count, room)
        first += data.pieces[t]


@bare
def turn_columns(data, q, v, dq, dv, r, count, room, a, da):
    """Fill a rod's q2'' = c (f - (q2.f) q2/|q2|^2) - |q2'|^2 q2/|q2|^2 and its columns, f the pull that turns it."""
    tail, head, hold = 3 * data.rod_tail[r], 3 * data.rod_head[r], data.hold[r]
    scale = (6.0 if hold == _FREE else 3.0) / data.mass[r]
    to, fro = (0.0 if hold == _HEAD else 1.0), (0.0 if hold == _TAIL else 1.0)
    force, forces = room.force, room.forces
    x = scale * (to * force[head] - fro * force[tail])
    y = scale * (to * force[head + 1] - fro * force[tail + 1])
    z = scale * (to * force[head + 2] - fro * force[tail + 2])
    b1, b2, b3, w1, w2, w3 = q[r, 3], q[r, 4], q[r, 5], v[r, 3], v[r, 4], v[r, 5]
    square = b1 * b1 + b2 * b2 + b3 * b3
    along = (b1 * x + b2 * y + b3 * z + w1 * w1 + w2 * w2 + w3 * w3) / square
    a[r, 3], a[r, 4], a[r, 5] = x - along * b1, y - along * b2, z - along * b3
    for c in range(count):
        d1, d2, d3 = dq[r, 3, c], dq[r, 4, c], dq[r, 5, c]
        p = scale * (to * forces[head, c] - fro * forces[tail, c])
        s = scale * (to * forces[head + 1, c] - fro * forces[tail + 1, c])
        t = scale * (to * forces[head + 2, c] - fro * forces[tail + 2, c])
        change = d1 * x + d2 * y + d3 * z + b1 * p + b2 * s + b3 * t
        change += 2.0 * (w1 * dv[r, 3, c] + w2 * dv[r, 4, c] + w3 * dv[r, 5, c])
        change = (change - 2.0 * along * (b1 * d1 + b2 * d2 + b3 * d3)) / square
        da[r, 3, c] = p - change * b1 - along * d1
        da[r, 4, c] = s - change * b2 - along * d2
        da[r, 5, c] = t - change * b3 - along * d3


@bare
def acceleration_columns(data, q, v, rest, load, dq, dv, dL, begins, count, room, a, da):
    """Fill q'' (nr, 6) of [S] (5.21) and its columns (nr, 6, nc), of which the first `count` are carried.

    Rest lengths change in the columns from `begins` on, dL (nt, nc).
    """
    place_columns(data, q, dq, count, room.place, room.places)
    place_columns(data, v, dv, count, room.speed, room.speeds)
    force_columns(data, rest, dL, begins, count, load, room)
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        turn_columns(data, q, v, dq, dv, r, count, room, a, da)
        if hold == _FREE:
            tail, head, scale = 3 * data.rod_tail[r], 3 * data.rod_head[r], 2.0 / data.mass[r]
            for i in range(3):
                a[r, i] = scale * (room.force[tail + i] + room.force[head + i])
                for c in range(count):
                    da[r, i, c] = scale * (room.forces[tail + i, c] + room.forces[head + i, c])
        else:
            sign = 1.0 if hold == _TAIL else -1.0
            for i in range(3):
                a[r, i] = sign * a[r, 3 + i]
                for c in range(count):
                    da[r, i, c] = sign * da[r, 3 + i, c]


@bare
def tidy_columns(data, q, v, dq, dv, count):
    """`tidy` of the kernel and its derivative: rods back to their lengths, no velocity along them."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        b1, b2, b3, w1, w2, w3 = q[r, 3], q[r, 4], q[r, 5], v[r, 3], v[r, 4], v[r, 5]
        square = b1 * b1 + b2 * b2 + b3 * b3
        along = (b1 * w1 + b2 * w2 + b3 * w3) / square
        scale = data.lengths[r] / np.sqrt(square)
        sign = 1.0 if hold == _TAIL else -1.0
        for c in range(count):
            d1, d2, d3 = dq[r, 3, c], dq[r, 4, c], dq[r, 5, c]
            e1, e2, e3 = dv[r, 3, c], dv[r, 4, c], dv[r, 5, c]
            longer = (b1 * d1 + b2 * d2 + b3 * d3) / square
            faster = (d1 * w1 + d2 * w2 + d3 * w3 + b1 * e1 + b2 * e2 + b3 * e3) / square - 2.0 * along * longer
            dq[r, 3, c], dv[r, 3, c] = scale * (d1 - longer * b1), e1 - faster * b1 - along * d1
            dq[r, 4, c], dv[r, 4, c] = scale * (d2 - longer * b2), e2 - faster * b2 - along * d2
            dq[r, 5, c], dv[r, 5, c] = scale * (d3 - longer * b3), e3 - faster * b3 - along * d3
            if hold != _FREE:
                for i in range(3):
                    dq[r, i, c], dv[r, i, c] = sign * dq[r, 3 + i, c], sign * dv[r, 3 + i, c]
    tidy(data, q, v)


@bare
def stretch_columns(data, rest, natural, dL, begins, count, room, stretch, stretches):
    """Fill each tendon's tension as it would be were it taut, and its columns, over k or EA/L0, m; L0 is `natural`.

    A slack tendon's is negative and says how far it is from pulling. Positions and speeds are those in the room.
    """
    first = 0
    for t in range(rest.size):
        length, growing = lengthened(data, t, first, room)
        k = data.stiffness[t] / natural[t] if data.by_strain else data.stiffness[t]
        damping = data.damping[t] / k if length > rest[t] else 0.0
        slope = natural[t] / rest[t] if data.by_strain else 1.0
        by_rest = slope * length / rest[t] if data.by_strain else 1.0
        stretch[t] = slope * (length - rest[t]) + damping * growing
        stretched(data, t, first, room, dL, begins, count, slope, by_rest, damping, room.pull)
        for c in range(count):
            stretches[t, c] = room.pull[c]
        first += data.pieces[t]
