"""The compiled kernel: the same physics as the CasADi elements, looped over topology arrays.

State of the rods: q = (q1, q2), v = (q1', q2') as (nr, 6) arrays ([S] Theorem 3.1); nodes p = (q1 -+ q2)/2. A rod held
at one end keeps q1 = 2 p_held + s q2. Code size does not depend on the structure; `tests/test_model.py` holds the
kernel to the CasADi model to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3


class KernelData(NamedTuple):
    """Topology and coefficients as flat arrays, the only argument that describes the structure."""

    tail: np.ndarray
    head: np.ndarray
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


@jit
def place_nodes(data, q, nodes):
    """Write node positions (or velocities, with anchors at rest left out) from rod coordinates."""
    for r in range(data.mass.size):
        a, b = data.rod_tail[r], data.rod_head[r]
        for i in range(3):
            nodes[a, i] = 0.5 * (q[r, i] - q[r, 3 + i])
            nodes[b, i] = 0.5 * (q[r, i] + q[r, 3 + i])


@jit
def elastic_forces(data, nodes, rest, external, forces, taut):
    """Sum of external and tendon forces on each node; returns how many tendons changed between slack and taut."""
    for a in range(nodes.shape[0]):
        for i in range(3):
            forces[a, i] = external[a, i]
    flips = 0
    for t in range(data.tail.size):
        a, b = data.tail[t], data.head[t]
        x, y, z = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1], nodes[b, 2] - nodes[a, 2]
        square = x * x + y * y + z * z
        limit = rest[t]
        if square > limit * limit:
            length = np.sqrt(square)
            k = data.stiffness[t] / limit if data.by_strain else data.stiffness[t]
            pull = k * (length - limit) / length
            x, y, z = pull * x, pull * y, pull * z
            forces[a, 0] += x
            forces[a, 1] += y
            forces[a, 2] += z
            forces[b, 0] -= x
            forces[b, 1] -= y
            forces[b, 2] -= z
            flips += 1 - taut[t]
            taut[t] = 1
        else:
            flips += taut[t]
            taut[t] = 0
    return flips


@jit
def damped_forces(data, nodes, velocities, rest, external, forces):
    """External, tendon, damper and drag forces on each node."""
    for a in range(nodes.shape[0]):
        for i in range(3):
            forces[a, i] = external[a, i] - data.drag * velocities[a, i]
    for t in range(data.tail.size):
        a, b = data.tail[t], data.head[t]
        x, y, z = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1], nodes[b, 2] - nodes[a, 2]
        length = np.sqrt(x * x + y * y + z * z)
        limit = rest[t]
        if length > limit:
            k = data.stiffness[t] / limit if data.by_strain else data.stiffness[t]
            rate = (
                x * (velocities[b, 0] - velocities[a, 0])
                + y * (velocities[b, 1] - velocities[a, 1])
                + z * (velocities[b, 2] - velocities[a, 2])
            ) / length
            pull = max(0.0, k * (length - limit) + data.damping[t] * rate) / length
            x, y, z = pull * x, pull * y, pull * z
            forces[a, 0] += x
            forces[a, 1] += y
            forces[a, 2] += z
            forces[b, 0] -= x
            forces[b, 1] -= y
            forces[b, 2] -= z


@jit
def pushes(data, q, forces, push):
    """Acceleration of each rod by the forces on its ends, without the centripetal part, as (nr, 6)."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        a, b, m = data.rod_tail[r], data.rod_head[r], data.mass[r]
        if hold == _FREE:
            scale = 6.0 / m
            x, y, z = forces[b, 0] - forces[a, 0], forces[b, 1] - forces[a, 1], forces[b, 2] - forces[a, 2]
        elif hold == _TAIL:
            scale = 3.0 / m
            x, y, z = forces[b, 0], forces[b, 1], forces[b, 2]
        else:
            scale = 3.0 / m
            x, y, z = -forces[a, 0], -forces[a, 1], -forces[a, 2]
        u, v, w = q[r, 3], q[r, 4], q[r, 5]
        along = (u * x + v * y + w * z) / (u * u + v * v + w * w)
        push[r, 3] = scale * (x - along * u)
        push[r, 4] = scale * (y - along * v)
        push[r, 5] = scale * (z - along * w)
        if hold == _FREE:
            for i in range(3):
                push[r, i] = 2.0 / m * (forces[a, i] + forces[b, i])
        else:
            sign = 1.0 if hold == _TAIL else -1.0
            for i in range(3):
                push[r, i] = sign * push[r, 3 + i]


@jit
def accelerations(data, q, v, rest, external, acceleration):
    """Full right-hand side q'' of [S] (5.21) with dampers and drag, as (nr, 6)."""
    count = external.shape[0]
    nodes, velocities, forces = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    nodes[:] = data.anchor
    velocities[:] = 0.0
    place_nodes(data, q, nodes)
    place_nodes(data, v, velocities)
    damped_forces(data, nodes, velocities, rest, external, forces)
    pushes(data, q, forces, acceleration)
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


@jit
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
