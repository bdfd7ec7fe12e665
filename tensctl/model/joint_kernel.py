"""Forces of joints and guides in the compiled kernel: S mu = -C p'', factored within its profile.

The mobility of a free rod, from a force at end s to the acceleration of end s', is (1/m) I + s s' (3/m) (I - e e'),
and that of a rod held at one end (3/m) (I - e e') at the other; S = C W C' adds these up for the rows that share a
rod.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import bare
from tensctl.model.kernel import tidy

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3
# Closing joints: Newton's method converges from anything an integrator leaves in two or three rounds.
_ROUNDS = 20
_CLOSED = 2e-16


@bare
def _mobility(data, q, c, d):
    """Acceleration of end coordinate c by a unit force on end coordinate d of the same rod, 1/kg."""
    r, s, i, t, j = c // 6, (c // 3) % 2, c % 3, (d // 3) % 2, d % 3
    hold = data.hold[r]
    if hold == _FIXED or (hold == _TAIL and (s == 0 or t == 0)) or (hold == _HEAD and (s == 1 or t == 1)):
        return 0.0
    x, y = q[r, 3 + i], q[r, 3 + j]
    square = q[r, 3] * q[r, 3] + q[r, 4] * q[r, 4] + q[r, 5] * q[r, 5]
    same = 1.0 if i == j else 0.0
    across = 3.0 * (same - x * y / square)
    if hold != _FREE:
        return across / data.mass[r]
    return (same + (across if s == t else -across)) / data.mass[r]


@bare
def factor(data, q, values):
    """Cholesky factor of S in its profile; false where a pivot is not positive: joints that lock."""
    for i in range(values.size):
        values[i] = 0.0
    for n in range(data.couples.shape[0]):
        j, k = data.couples[n, 0], data.couples[n, 1]
        total = 0.0
        for a in range(2):
            c = data.first[j] if a == 0 else data.second[j]
            for b in range(2):
                d = data.first[k] if b == 0 else data.second[k]
                if c >= 0 and d >= 0 and c // 6 == d // 6:
                    total += (1.0 if a == b else -1.0) * _mobility(data, q, c, d)
        values[data.place[j] + k - data.low[j]] = total
    for j in range(data.first.size):
        row = data.place[j] - data.low[j]
        for k in range(data.low[j], j + 1):
            column = data.place[k] - data.low[k]
            total = values[row + k]
            for i in range(max(data.low[j], data.low[k]), k):
                total -= values[row + i] * values[column + i]
            if k < j:
                values[row + k] = total / values[column + k]
            elif total > 0.0:
                values[row + k] = np.sqrt(total)
            else:
                return False
    return True


@bare
def solve(data, values, x):
    """Solve S x = x in place."""
    for j in range(x.size):
        row = data.place[j] - data.low[j]
        for k in range(data.low[j], j):
            x[j] -= values[row + k] * x[k]
        x[j] /= values[row + j]
    for j in range(x.size - 1, -1, -1):
        row = data.place[j] - data.low[j]
        x[j] /= values[row + j]
        for k in range(data.low[j], j):
            x[k] -= values[row + k] * x[j]


@bare
def across_rows(data, q, x):
    """Fill x with C p: p_first - p_second of every row, of positions, velocities or accelerations."""
    for j in range(x.size):
        total = 0.0
        for a in range(2):
            c = data.first[j] if a == 0 else data.second[j]
            if c >= 0:
                r, s, i = c // 6, (c // 3) % 2, c % 3
                end = 0.5 * (q[r, i] + q[r, 3 + i]) if s == 1 else 0.5 * (q[r, i] - q[r, 3 + i])
                total += end if a == 0 else -end
        x[j] = total


@bare
def push_rows(data, q, mu, out):
    """Add to rod coordinates out what forces C' mu on the ends accelerate them by."""
    for j in range(mu.size):
        for a in range(2):
            c = data.first[j] if a == 0 else data.second[j]
            if c < 0:
                continue
            r, s, i = c // 6, (c // 3) % 2, c % 3
            hold, force = data.hold[r], mu[j] if a == 0 else -mu[j]
            if hold == _FIXED or (hold == _TAIL and s == 0) or (hold == _HEAD and s == 1):
                continue
            sign = 1.0 if s == 1 else -1.0
            square = q[r, 3] * q[r, 3] + q[r, 4] * q[r, 4] + q[r, 5] * q[r, 5]
            scale = (6.0 if hold == _FREE else 3.0) * sign * force / data.mass[r]
            for k in range(3):
                turn = scale * ((1.0 if k == i else 0.0) - q[r, 3 + i] * q[r, 3 + k] / square)
                out[r, 3 + k] += turn
                if hold == _TAIL:
                    out[r, k] += turn
                elif hold == _HEAD:
                    out[r, k] -= turn
            if hold == _FREE:
                out[r, i] += 2.0 * force / data.mass[r]


@bare
def constraint_forces(data, q, acceleration, values, mu):
    """Fill mu for the accelerations that rods would have without joints and guides; false where they lock."""
    if not factor(data, q, values):
        return False
    across_rows(data, acceleration, mu)
    for j in range(mu.size):
        mu[j] = -mu[j]
    solve(data, values, mu)
    return True


@bare
def constrain(data, q, acceleration, values, mu):
    """Add what joints and guides do to accelerations; false where they lock."""
    if not constraint_forces(data, q, acceleration, values, mu):
        return False
    push_rows(data, q, mu, acceleration)
    return True


@bare
def close(data, q, v, values, mu):
    """Close joints and guides again, square to them in the mass metric, and take velocities across them away."""
    size, before = 0.0, np.inf
    for r in range(data.mass.size):
        size = max(size, data.lengths[r])
    for _ in range(_ROUNDS):
        across_rows(data, q, mu)
        worst = 0.0
        for j in range(mu.size):
            mu[j] = data.target[j] - mu[j]
            worst = max(worst, abs(mu[j]))
        if worst <= _CLOSED * size or not worst < before:
            break
        before = worst
        if not factor(data, q, values):
            return False
        solve(data, values, mu)
        push_rows(data, q, mu, q)
        tidy(data, q, v)
    if not constraint_forces(data, q, v, values, mu):
        return False
    push_rows(data, q, mu, v)
    return True
