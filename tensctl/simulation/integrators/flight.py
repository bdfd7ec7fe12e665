"""Exact motion of rods on which nothing acts, and the kick of a force: the two flows that splittings compose.

    flight   q1 += h v1,   q2 <- c q2 + h s v2,   v2 <- c v2 - (x^2 s/h) q2,   x = h |v2|/L,  c = cos x,  s = sin x/x
    kick     v += h a(q)

Both cosine and sine are power series in x^2, so short flights need neither a square root nor a division.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import part

_FREE, _TAIL, _FIXED = 0, 1, 3
# Up to this x^2 five terms leave less than 3e-17.
_SHORT = 0.01


@part
def fly(data, q, v, h):
    """Move every rod on its own for a time h: centres straight, directions on great circles."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        spin = (v[r, 3] * v[r, 3] + v[r, 4] * v[r, 4] + v[r, 5] * v[r, 5]) / (data.lengths[r] * data.lengths[r])
        y = h * h * spin
        if y < _SHORT:
            c = 1 - y * (1 / 2) * (1 - y * (1 / 12) * (1 - y * (1 / 30) * (1 - y * (1 / 56))))
            s = 1 - y * (1 / 6) * (1 - y * (1 / 20) * (1 - y * (1 / 42) * (1 - y * (1 / 72))))
        else:
            x = np.sqrt(y)
            c, s = np.cos(x), np.sin(x) / x
        over, fall = h * s, h * s * spin
        for i in range(3, 6):
            a, b = q[r, i], v[r, i]
            q[r, i] = c * a + over * b
            v[r, i] = c * b - fall * a
        if hold == _FREE:
            for i in range(3):
                q[r, i] += h * v[r, i]
        else:
            sign = 1.0 if hold == _TAIL else -1.0
            held = data.rod_tail[r] if hold == _TAIL else data.rod_head[r]
            for i in range(3):
                q[r, i] = 2.0 * data.anchor[held, i] + sign * q[r, 3 + i]
                v[r, i] = sign * v[r, 3 + i]


@part
def kick(data, v, push, h):
    """Change velocities by accelerations that act for a time h."""
    for r in range(data.mass.size):
        if data.hold[r] != _FIXED:
            for i in range(6):
                v[r, i] += h * push[r, i]
