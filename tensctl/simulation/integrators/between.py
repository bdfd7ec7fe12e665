"""States between two steps: the quintic that has positions, velocities and accelerations at both ends.

Its error is (omega h)^6 / 46080 of an oscillation of frequency omega, below that of a step of order 5, so a recorded
time need not be stepped on, and recording does not change the motion.
"""

from __future__ import annotations

from tensctl.jit import bare
from tensctl.model.kernel import tidy


@bare
def between(data, q0, v0, a0, q1, v1, a1, h, x, q, v):
    """Fill q and v with the state a part x into a step of length h, rods put to their lengths."""
    for r in range(q.shape[0]):
        for i in range(6):
            p0, d0, c0 = q0[r, i], h * v0[r, i], 0.5 * h * h * a0[r, i]
            d1, c1 = h * v1[r, i], 0.5 * h * h * a1[r, i]
            gap = q1[r, i] - p0 - d0 - c0
            slope = d1 - d0 - 2.0 * c0
            bend = c1 - c0
            e3 = 10.0 * gap - 4.0 * slope + bend
            e4 = -15.0 * gap + 7.0 * slope - 2.0 * bend
            e5 = 6.0 * gap - 3.0 * slope + bend
            q[r, i] = p0 + x * (d0 + x * (c0 + x * (e3 + x * (e4 + x * e5))))
            v[r, i] = (d0 + x * (2.0 * c0 + x * (3.0 * e3 + x * (4.0 * e4 + x * 5.0 * e5)))) / h
    tidy(data, q, v)
