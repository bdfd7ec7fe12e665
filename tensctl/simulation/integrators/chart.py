"""Rods in the coordinates that they have: a chart about the present state, made anew for every step.

    z = (q1, tau),   q2 = T tau + n sqrt(L^2 - tau^2),   y = (z, z')

n = q2/L at the centre of the chart, T spans the plane across it. Rod lengths hold by construction, and at the centre
(tau = 0) the mass matrix is diagonal: m/4 and m/12, or m/3 for a rod that turns about a held end. A one-step method
may change its chart at every step, so no chart has to cover more than one step's turning.

Coordinates are flat, five a rod; those that a held rod does not have (q1, and tau of a rod held at both ends) stay zero
and have the mass 1.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import part

_FREE, _TAIL, _FIXED = 0, 1, 3


@part
def centre_chart(data, q, v, frame, y):
    """Set the frames (nr, 3, 3), rows n and T', at the state q, v, and its coordinates y."""
    half = y.size // 2
    for r in range(data.mass.size):
        if data.hold[r] == _FIXED:
            continue
        x, s, w = q[r, 3] / data.lengths[r], q[r, 4] / data.lengths[r], q[r, 5] / data.lengths[r]
        if abs(x) <= abs(s) and abs(x) <= abs(w):
            a, b, c = 0.0, -w, s
        elif abs(s) <= abs(w):
            a, b, c = w, 0.0, -x
        else:
            a, b, c = -s, x, 0.0
        norm = np.sqrt(a * a + b * b + c * c)
        a, b, c = a / norm, b / norm, c / norm
        axes = frame[r]
        axes[0, 0], axes[0, 1], axes[0, 2] = x, s, w
        axes[1, 0], axes[1, 1], axes[1, 2] = a, b, c
        axes[2, 0], axes[2, 1], axes[2, 2] = s * c - w * b, w * a - x * c, x * b - s * a
        k = 5 * r
        if data.hold[r] == _FREE:
            for i in range(3):
                y[k + i], y[half + k + i] = q[r, i], v[r, i]
        for j in range(2):
            y[k + 3 + j] = 0.0
            y[half + k + 3 + j] = axes[1 + j, 0] * v[r, 3] + axes[1 + j, 1] * v[r, 4] + axes[1 + j, 2] * v[r, 5]


@part
def place_ends(data, frame, y, place, speed):
    """Fill places and speeds of moving nodes, flat (3N,), at y; False where a rod turned out of the chart."""
    half, inside = y.size // 2, True
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        k, length, axes = 5 * r, data.lengths[r], frame[r]
        a, b = np.int64(data.rod_tail_at[r]), np.int64(data.rod_head_at[r])
        lean, tip, lean_rate, tip_rate = y[k + 3], y[k + 4], y[half + k + 3], y[half + k + 4]
        square = length * length - lean * lean - tip * tip
        if not square > 0.0:
            inside, square = False, length * length
        along = np.sqrt(square)
        fall = -(lean * lean_rate + tip * tip_rate) / along
        for i in range(3):
            x = along * axes[0, i] + lean * axes[1, i] + tip * axes[2, i]
            u = fall * axes[0, i] + lean_rate * axes[1, i] + tip_rate * axes[2, i]
            if hold == _FREE:
                place[a + i], place[b + i] = 0.5 * (y[k + i] - x), 0.5 * (y[k + i] + x)
                speed[a + i], speed[b + i] = 0.5 * (y[half + k + i] - u), 0.5 * (y[half + k + i] + u)
            elif hold == _TAIL:
                place[b + i], speed[b + i] = place[a + i] + x, u
            else:
                place[a + i], speed[a + i] = place[b + i] - x, -u
    return inside


@part
def leave_chart(data, y, place, speed, q, v):
    """Fill q and v of moving rods from what `place_ends` filled for y."""
    half = y.size // 2
    for r in range(data.mass.size):
        hold, k = data.hold[r], 5 * r
        if hold == _FIXED:
            continue
        a, b = np.int64(data.rod_tail_at[r]), np.int64(data.rod_head_at[r])
        for i in range(3):
            q[r, 3 + i], v[r, 3 + i] = place[b + i] - place[a + i], speed[b + i] - speed[a + i]
            if hold == _FREE:
                q[r, i], v[r, i] = y[k + i], y[half + k + i]
            else:
                q[r, i], v[r, i] = place[a + i] + place[b + i], speed[a + i] + speed[b + i]


@part
def accelerate(data, frame, y, place, speed, force, out):
    """Accelerations z'' from nodal forces, off the centre too: the tangential part of [S] Theorem 3.1."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        m, k, length, axes = data.mass[r], 5 * r, data.lengths[r], frame[r]
        a, b = np.int64(data.rod_tail_at[r]), np.int64(data.rod_head_at[r])
        scale = (6.0 if hold == _FREE else 3.0) / m
        pull, lean, tip = 0.0, 0.0, 0.0
        for i in range(3):
            if hold == _FREE:
                out[k + i] = 2.0 / m * (force[a + i] + force[b + i])
                f = force[b + i] - force[a + i]
            else:
                f = force[b + i] if hold == _TAIL else -force[a + i]
            spin = speed[b + i] - speed[a + i]
            pull += scale * (place[b + i] - place[a + i]) * f + spin * spin
            lean += axes[1, i] * f
            tip += axes[2, i] * f
        pull /= length * length
        out[k + 3], out[k + 4] = scale * lean - pull * y[k + 3], scale * tip - pull * y[k + 4]


def chart_mass(data) -> np.ndarray:
    """Diagonal of the mass matrix at the centre of a chart, (5 nr,)."""
    mass = np.ones((data.mass.size, 5))
    free, held = data.hold == _FREE, (data.hold != _FREE) & (data.hold != _FIXED)
    mass[free] = data.mass[free, None] / [4, 4, 4, 12, 12]
    mass[held, 3:] = data.mass[held, None] / 3
    return mass.ravel()


def chart_drag(data) -> np.ndarray:
    """Diagonal of the matrix of drag at the centre of a chart, (5 nr,) N s/m."""
    drag = np.zeros((data.mass.size, 5))
    free, held = data.hold == _FREE, (data.hold != _FREE) & (data.hold != _FIXED)
    drag[free] = 0.5 * data.drag
    drag[held, 3:] = data.drag
    return drag.ravel()
