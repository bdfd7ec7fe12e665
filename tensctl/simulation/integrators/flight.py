"""Exact motion of rods on which nothing acts, and the kick of a force: the two flows that splittings compose.

    flight   q1 += h v1,   q2 <- c q2 + h s v2,   v2 <- c v2 - (x^2 s/h) q2,   x = h |v2|/L,  c = cos x,  s = sin x/x
    kick     v += h a(q)

Both cosine and sine are power series in x^2, so short flights need neither a square root nor a division.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import part

# Up to this x^2 at the start of a step the series are taken. Eight terms leave 2e-22 there, and 1e-17 where rods have
# become twice as fast within the step.
_SHORT = 0.09


@part
def kick(v, push, h):
    """Change velocities by accelerations that act for a time h."""
    for i in range(6):
        for r in range(v.shape[1]):
            v[i, r] += h * push[i, r]


@part
def swift(rows, v, drifts, h):
    """Whether some rod turns too far in the longest flight of a step h for the series."""
    inverse, fastest, longest = rows.over, 0.0, 0.0
    for r in range(rows.rods):
        fastest = max(fastest, inverse[r] * (v[3, r] * v[3, r] + v[4, r] * v[4, r] + v[5, r] * v[5, r]))
    for part_of_step in drifts:
        longest = max(longest, abs(part_of_step))
    return (longest * h) ** 2 * fastest > _SHORT


@part
def fly(rows, q, v, h, far):
    """Move every rod on its own for a time h: centres straight, directions on great circles; `far` as `swift` says."""
    inverse = rows.over
    for r in range(inverse.size):
        x, y, z, a, b, d = q[3, r], q[4, r], q[5, r], v[3, r], v[4, r], v[5, r]
        spin = inverse[r] * (a * a + b * b + d * d)
        if far:
            angle = abs(h) * np.sqrt(spin)
            c, s = np.cos(angle), np.sin(angle) / angle if angle > 0.0 else 1.0
        else:
            t = h * h * spin
            c = 1 - t * (1 / 2) * (
                1
                - t
                * (1 / 12)
                * (
                    1
                    - t * (1 / 30) * (1 - t * (1 / 56) * (1 - t * (1 / 90) * (1 - t * (1 / 132) * (1 - t * (1 / 182)))))
                )
            )
            s = 1 - t * (1 / 6) * (
                1
                - t
                * (1 / 20)
                * (
                    1
                    - t
                    * (1 / 42)
                    * (1 - t * (1 / 72) * (1 - t * (1 / 110) * (1 - t * (1 / 156) * (1 - t * (1 / 210)))))
                )
            )
        over, fall = h * s, h * s * spin
        q[3, r], q[4, r], q[5, r] = c * x + over * a, c * y + over * b, c * z + over * d
        v[3, r], v[4, r], v[5, r] = c * a - fall * x, c * b - fall * y, c * d - fall * z
    drift(rows, q, v, h)


@part
def drift(rows, q, v, h):
    """Move centres: straight where the rod is free, with its direction where the ground holds an end."""
    keep, base, sign = rows.keep, rows.base, rows.sign
    for i in range(3):
        if rows.held:
            for r in range(keep.size):
                q[i, r] = keep[r] * (q[i, r] + h * v[i, r]) + base[i, r] + sign[r] * q[i + 3, r]
                v[i, r] = keep[r] * v[i, r] + sign[r] * v[i + 3, r]
        else:
            for r in range(keep.size):
                q[i, r] += h * v[i, r]


@part
def trim(rows, q, v):
    """Take rounding out of rod lengths and out of velocities along rods: one Newton step of 1/sqrt."""
    inverse = rows.over
    for r in range(inverse.size):
        over, x, y, z, a, b, d = inverse[r], q[3, r], q[4, r], q[5, r], v[3, r], v[4, r], v[5, r]
        scale = 1.5 - 0.5 * over * (x * x + y * y + z * z)
        along = over * (x * a + y * b + z * d)
        v[3, r], v[4, r], v[5, r] = a - along * x, b - along * y, d - along * z
        q[3, r], q[4, r], q[5, r] = scale * x, scale * y, scale * z
    if rows.held:
        drift(rows, q, v, 0.0)
