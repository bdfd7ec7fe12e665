"""Joints and guides in the exact derivative: columns of what their forces do, beside `model.joint_kernel`.

    x+ = x + W C' mu,   C x+ = b      so, with W' the change of W as rods turn,   dx+ = dx + W' C' mu + W C' dmu,
    S dmu = -C (dx + W' C' mu),   S = C W C'

Accelerations (b = 0), velocities (b = 0) and positions (b of the rows, round after round) are all brought to their rows
in this way, so one derivative serves the three.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare
from tensctl.model.joint_kernel import across_rows, factor, push_rows, solve
from tensctl.model.kernel import KernelData, copy
from tensctl.model.kernel_columns import copy_columns, tidy_columns

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3
# Closing joints: Newton's method converges from anything that a step leaves in two or three rounds.
_ROUNDS = 20
_CLOSED = 2e-16


class TieRoom(NamedTuple):
    """Room to work in: the factor of S, forces on rows (nc,) and their columns (nc, columns), a state to come from.

    `still` holds the zeros (nc,) that accelerations and velocities across rows are brought to.
    """

    values: np.ndarray
    mu: np.ndarray
    dmu: np.ndarray
    still: np.ndarray
    longer: np.ndarray
    at: np.ndarray
    at_columns: np.ndarray


def tie_room(data: KernelData, columns: int) -> TieRoom:
    """Room for so many columns."""
    rows, rods = data.first.size, data.mass.size
    values, mu, dmu, still = np.zeros(data.place[-1]), np.zeros(rows), np.zeros((rows, columns)), np.zeros(rows)
    return TieRoom(values, mu, dmu, still, np.zeros(columns), np.zeros((rods, 6)), np.zeros((rods, 6, columns)))


@bare
def _end(data, j, a):
    """One end of row j: rod, axis, whether it moves, what q2'' is for a force on it, and how q1'' follows q2''."""
    at = data.first[j] if a == 0 else data.second[j]
    if at < 0:
        return 0, 0, False, 0.0, 0.0
    r, s, i = at // 6, (at // 3) % 2, at % 3
    hold = data.hold[r]
    moves = not (hold == _FIXED or (hold == _TAIL and s == 0) or (hold == _HEAD and s == 1))
    scale = (1.0 if a == 0 else -1.0) * (1.0 if s == 1 else -1.0) * (6.0 if hold == _FREE else 3.0) / data.mass[r]
    return r, i, moves, scale, (1.0 if hold == _TAIL else -1.0 if hold == _HEAD else 0.0)


@bare
def _turned_columns(data, q, dq, mu, count, longer, dx):
    """Add W' C' mu: columns of `push_rows` of the same forces on rods that turn; `longer` is room for one row."""
    for j in range(mu.size):
        for a in range(2):
            r, i, moves, scale, follows = _end(data, j, a)
            if not moves:
                continue
            b, db = q[r, 3:], dq[r, 3:]
            square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
            scale *= mu[j] / square
            for c in range(count):
                longer[c] = 2.0 * b[i] * (b[0] * db[0, c] + b[1] * db[1, c] + b[2] * db[2, c]) / square - db[i, c]
            for k in range(3):
                for c in range(count):
                    turn = scale * (longer[c] * b[k] - b[i] * db[k, c])
                    dx[r, 3 + k, c] += turn
                    dx[r, k, c] += follows * turn


@bare
def _pushed_columns(data, q, dmu, count, dx):
    """Add W C' dmu: columns of `push_rows` of other forces on the same rods."""
    for j in range(dmu.shape[0]):
        for a in range(2):
            r, i, moves, scale, follows = _end(data, j, a)
            if not moves:
                continue
            b = q[r, 3:]
            square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
            for k in range(3):
                part = scale * ((1.0 if k == i else 0.0) - b[i] * b[k] / square)
                for c in range(count):
                    dx[r, 3 + k, c] += part * dmu[j, c]
                    dx[r, k, c] += follows * part * dmu[j, c]
            if follows == 0.0:
                centre = (1.0 if a == 0 else -1.0) * 2.0 / data.mass[r]
                for c in range(count):
                    dx[r, i, c] += centre * dmu[j, c]


@bare
def _across_columns(data, dx, count, out):
    """Fill out (nc, count) with -C dx of every row."""
    for j in range(out.shape[0]):
        for c in range(count):
            out[j, c] = 0.0
        for a in range(2):
            at = data.first[j] if a == 0 else data.second[j]
            if at < 0:
                continue
            r, s, i = at // 6, (at // 3) % 2, at % 3
            side, end = -0.5 if a == 0 else 0.5, 1.0 if s == 1 else -1.0
            for c in range(count):
                out[j, c] += side * (dx[r, i, c] + end * dx[r, 3 + i, c])


@bare
def _solve_columns(data, values, x, count):
    """Solve S x = x in place for the first columns."""
    for j in range(x.shape[0]):
        row = data.place[j] - data.low[j]
        for k in range(data.low[j], j):
            for c in range(count):
                x[j, c] -= values[row + k] * x[k, c]
        for c in range(count):
            x[j, c] /= values[row + j]
    for j in range(x.shape[0] - 1, -1, -1):
        row = data.place[j] - data.low[j]
        for c in range(count):
            x[j, c] /= values[row + j]
        for k in range(data.low[j], j):
            for c in range(count):
                x[k, c] -= values[row + k] * x[j, c]


@bare
def tie_columns(data, q, dq, target, count, tie, x, dx):
    """Bring x to C x = target by forces on the rows at q, and its columns along; false where rows lock.

    Parameters
    ----------
    tie : TieRoom
    """
    values, mu, dmu = tie.values, tie.mu, tie.dmu
    if not factor(data, q, values):
        return False
    across_rows(data, x, mu)
    for j in range(mu.size):
        mu[j] = target[j] - mu[j]
    solve(data, values, mu)
    _turned_columns(data, q, dq, mu, count, tie.longer, dx)
    _across_columns(data, dx, count, dmu)
    _solve_columns(data, values, dmu, count)
    _pushed_columns(data, q, dmu, count, dx)
    push_rows(data, q, mu, x)
    return True


@bare
def close_columns(data, q, v, dq, dv, count, tie):
    """Close joints and guides again, take velocities across them away, and the columns of both along."""
    size, before, gap, at, at_columns = 0.0, np.inf, tie.mu, tie.at, tie.at_columns
    for r in range(data.mass.size):
        size = max(size, data.lengths[r])
    for _ in range(_ROUNDS):
        across_rows(data, q, gap)
        worst = 0.0
        for j in range(gap.size):
            worst = max(worst, abs(gap[j] - data.target[j]))
        if worst <= _CLOSED * size or not worst < before:
            break
        before = worst
        copy(q, at)
        copy_columns(dq, at_columns, count)
        if not tie_columns(data, at, at_columns, data.target, count, tie, q, dq):
            return False
        tidy_columns(data, q, v, dq, dv, count)
    return tie_columns(data, q, dq, tie.still, count, tie, v, dv)
