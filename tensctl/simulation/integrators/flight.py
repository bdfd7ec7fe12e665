"""Exact motion of rods on which nothing acts, and the kick of a force: the two flows that splittings compose.

    flight   q1 += h v1,   q2 += h s v2 - b q2,   v2 -= (x^2 s/h) q2 + b v2
             x = h |v2|/L,   b = 1 - cos x,   s = sin x/x
    kick     v += h a(q)

Both b and s are power series in x^2, so short flights need neither a square root nor a division. What changes is added
last: a cosine that is rounded next to one loses the same part of every slow turn, and angular momentum with it.
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
    for i in range(v.size):
        v[i] += h * push[i]


@part
def swift(rows, v, drifts, h):
    """Whether some rod turns too far in the longest flight of a step h for the series."""
    n, fastest, longest = np.uint64(rows.row), 0.0, 0.0
    a, b, d = v[3 * n :], v[4 * n :], v[5 * n :]
    for r in range(n):
        fastest = max(fastest, rows.over[r] * (a[r] * a[r] + b[r] * b[r] + d[r] * d[r]))
    for part_of_step in drifts:
        longest = max(longest, abs(part_of_step))
    return (longest * h) ** 2 * fastest > _SHORT


@part
def fly(rows, q, v, h, far):
    """Move every rod on its own for a time h: centres straight, directions on great circles; `far` as `swift` says."""
    n = np.uint64(rows.row)
    if far:
        turn_far(n, rows.over, q[3 * n :], v[3 * n :], h)
    else:
        turn(n, rows.over, q[3 * n :], v[3 * n :], h)
    drift(rows, q, v, h)


@part
def turn(n, over, direction, rate, h):
    """Turn rods by the series; apart from `turn_far`, so that the compiler takes four at once."""
    two = n + n
    for r in range(n):
        x, y, z = direction[r], direction[n + r], direction[two + r]
        a, b, d = rate[r], rate[n + r], rate[two + r]
        spin = over[r] * (a * a + b * b + d * d)
        back, ahead = versine(h * h * spin), h * sine(h * h * spin)
        direction[r], rate[r] = turned(x, a, back, ahead, spin)
        direction[n + r], rate[n + r] = turned(y, b, back, ahead, spin)
        direction[two + r], rate[two + r] = turned(z, d, back, ahead, spin)


@part
def turn_far(n, over, direction, rate, h):
    """Turn rods by any angle."""
    two = n + n
    for r in range(n):
        x, y, z = direction[r], direction[n + r], direction[two + r]
        a, b, d = rate[r], rate[n + r], rate[two + r]
        spin = over[r] * (a * a + b * b + d * d)
        angle = abs(h) * np.sqrt(spin)
        back, ahead = 1.0 - np.cos(angle), h * (np.sin(angle) / angle if angle > 0.0 else 1.0)
        direction[r], rate[r] = turned(x, a, back, ahead, spin)
        direction[n + r], rate[n + r] = turned(y, b, back, ahead, spin)
        direction[two + r], rate[two + r] = turned(z, d, back, ahead, spin)


@part
def turned(x, a, back, ahead, spin):
    """A component of a direction and of its rate after a turn."""
    return x + (ahead * a - back * x), a - (ahead * spin * x + back * a)


@part
def versine(t):
    """1 - cos sqrt(t) by its series, in pairs of terms, which take half as long as one after another."""
    t2 = t * t
    low = ((1 / 2) - (1 / 24) * t) + t2 * ((1 / 720) - (1 / 40320) * t)
    high = ((1 / 3628800) - (1 / 479001600) * t) + t2 * (1 / 87178291200)
    return t * (low + t2 * t2 * high)


@part
def sine(t):
    """Sin sqrt(t) / sqrt(t) by its series."""
    t2 = t * t
    t4 = t2 * t2
    low = (1.0 - (1 / 6) * t) + t2 * ((1 / 120) - (1 / 5040) * t)
    high = ((1 / 362880) - (1 / 39916800) * t) + t2 * ((1 / 6227020800) - (1 / 1307674368000) * t)
    return low + t4 * high


@part
def drift(rows, q, v, h):
    """Move centres: straight where the rod is free, with its direction where the ground holds an end."""
    half = np.uint64(3 * rows.row)
    if rows.held:
        direction, rate = q[half:], v[half:]
        for i in range(half):
            q[i] = rows.keep[i] * (q[i] + h * v[i]) + rows.base[i] + rows.sign[i] * direction[i]
            v[i] = rows.keep[i] * v[i] + rows.sign[i] * rate[i]
    else:
        for i in range(half):
            q[i] += h * v[i]


@part
def trim(rows, q, v):
    """Take rounding out of rod lengths and out of velocities along rods: one Newton step of 1/sqrt."""
    n = np.uint64(rows.row)
    two, half = n + n, n + n + n
    direction, rate = q[half:], v[half:]
    for r in range(n):
        x, y, z = direction[r], direction[n + r], direction[two + r]
        a, b, d = rate[r], rate[n + r], rate[two + r]
        over = rows.over[r]
        scale = 1.5 - 0.5 * over * (x * x + y * y + z * z)
        along = over * (x * a + y * b + z * d)
        rate[r], rate[n + r], rate[two + r] = a - along * x, b - along * y, d - along * z
        direction[r], direction[n + r], direction[two + r] = scale * x, scale * y, scale * z
    if rows.held:
        drift(rows, q, v, 0.0)
