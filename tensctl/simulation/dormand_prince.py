"""Damped motion: Dormand and Prince's explicit pair of order 5(4) with projection on the rods' manifold.

After every accepted step q2 is put back to its rod's length and velocities along rods are taken away, so lengths hold
to rounding. Where a damped tendon becomes taut the force jumps; the step-size control finds the place.

Explicit: the step is bounded by about 3 over the fastest decay rate, which makes very stiff dampers slow, not wrong.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import jit
from tensctl.model.kernel import accelerations, tidy

A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])


@jit
def advance(data, q, v, t0, t1, first, rest0, rate, external, table, error, nodes, q_scale, v_scale):
    """Move q and v from t0 to t1; returns the next step, right-hand sides, refused steps; step < 0 on failure.

    Parameters
    ----------
    first : float, s
        Step to try first.
    q_scale, v_scale : float, m, m/s
        Errors allowed in a step.
    """
    kq, kv = np.zeros((7, *q.shape)), np.zeros((7, *q.shape))
    q1, v1, rest = q.copy(), v.copy(), rest0.copy()
    t, h, sides, refused = t0, min(first, t1 - t0), 0, 0
    suggestion = first
    while t < t1:
        h = min(h, t1 - t)
        if not h > 1e-14 * max(abs(t0), abs(t1)):
            return -1.0, sides, refused
        last = t + h >= t1
        for s in range(7):
            q1[:], v1[:] = q, v
            for k in range(s):
                if table[s, k] != 0.0:
                    q1 += h * table[s, k] * kq[k]
                    v1 += h * table[s, k] * kv[k]
            for k in range(rest.size):
                rest[k] = rest0[k] + (t + nodes[s] * h - t0) * rate[k]
            kq[s] = v1
            accelerations(data, q1, v1, rest, external, kv[s])
            sides += 1
        worst = 0.0
        for r in range(q.shape[0]):
            for i in range(6):
                eq, ev = 0.0, 0.0
                for s in range(7):
                    eq += error[s] * kq[s, r, i]
                    ev += error[s] * kv[s, r, i]
                worst = max(worst, abs(h * eq) / q_scale, abs(h * ev) / v_scale)
        factor = 5.0 if worst == 0.0 else min(5.0, max(0.2, 0.9 * worst**-0.2))
        if worst <= 1.0:
            q[:], v[:] = q1, v1
            tidy(data, q, v)
            t = t1 if last else t + h
            if not last:
                suggestion = h * factor
        else:
            refused += 1
            factor = min(factor, 0.9) if worst == worst else 0.2
        h *= factor
        if worst <= 1.0 and last:
            suggestion = max(suggestion, h)
    return suggestion, sides, refused
