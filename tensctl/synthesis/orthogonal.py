"""The dual active set on orthogonal factors: for limits so nearly dependent that their products lose all digits.

With G = L L', rows N = L^-1 (I, M)' of what is bounded, and N_W = Q R those that act, all of W is just kept at

    c = R^-T (limits - values without limits)_W,   f_W = R^-1 c,   values = those without limits + N' Q c,

and a broken limit p moves along what Q leaves of its row, z = N_p - Q d with d = Q' N_p, while f_W follow by R^-1 d
[Goldfarb and Idnani 1983]. Errors grow with the condition of N_W, those of `synthesis.dual` with its square. Columns
of Q are found by two passes of Gram and Schmidt; rotations close the gap where one leaves [Daniel, Gragg, Kaufman and
Stewart 1976].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit
from tensctl.synthesis.dual import BUSY, INFEASIBLE, SOLVED, first_to_vanish, furthest, row_of, running, value

# What is left of a row below this part of its square is rounding.
NO_PIVOT = 1e-22
# No plan keeps all limits where it takes a force this many times the one that would put right alone what the minimum
# without limits breaks most. A millionth below the edge of what can be kept it takes up to 1e7 times.
TOO_DEAR = 1e8


class Factors(NamedTuple):
    """Limits that act, and their rows N_W = Q R; Q column by column, each column of R in a row."""

    acting: np.ndarray
    Q: np.ndarray
    R: np.ndarray
    d: np.ndarray
    z: np.ndarray


class Limits(NamedTuple):
    """Of rates, tensions and inputs, (n + r + n,) each; and how many inputs a stage has."""

    lower: np.ndarray
    upper: np.ndarray
    inputs: int


@jit
def search(
    rows: np.ndarray, free: np.ndarray, limits: Limits, forces: np.ndarray, tol: float, work: float
) -> tuple[int, np.ndarray]:
    """Go on from the limits that forces act on.

    Parameters
    ----------
    rows : (n + r, n)
        N', of rates and tensions.
    free : (n + r,)
        Rates and tensions of the minimum without limits.
    limits : Limits
    forces : (n + r + n,)
        Positive at lower limits; become those of the answer.
    tol : float
        Largest violation.
    work : float
        Multiplications after which it gives up.

    Returns
    -------
    ended : SOLVED, BUSY or INFEASIBLE
    values : (n + r,)
        Rates and tensions.
    """
    known, n = rows.shape
    W = Factors(np.empty(n + 1, np.int64), np.empty((n + 1, n)), np.zeros((n + 1, n + 1)), np.empty(n + 1), np.empty(n))
    own, follow, sums = np.empty(n), np.empty(n + 1), np.empty(n)
    too_dear = TOO_DEAR * _alone(rows, free, limits, sums, own)
    m = _taken_over(W, rows, limits, forces, own)
    done, exact = 2.0 * m * m * n, True
    m = _keep_right_ones(W, m, free, limits, forces)
    values = _settle(W, m, rows, free, limits, forces)
    while True:
        running(values, limits.inputs, sums)
        p, out = furthest(values, sums, limits.lower, limits.upper, tol)
        if p < 0 or forces[p] != 0.0:  # one that acts is out by rounding
            if exact:
                return SOLVED, values
            m = _keep_right_ones(W, m, free, limits, forces)
            values = _settle(W, m, rows, free, limits, forces)
            exact = True
            continue
        exact = False
        row_of(rows, p, limits.inputs, own)
        itself = np.dot(own, own)
        way = 1.0 if out > 0.0 else -1.0
        while out != 0.0:
            done += 6.0 * m * n + 1.0 * known * n
            if done > work:
                return BUSY, values
            curvature = _split(W, m, own)
            follow[:m] = W.d[:m]
            _back(W, m, follow)
            push = abs(out) / curvature if curvature > NO_PIVOT * itself else np.inf
            push, leaves = first_to_vanish(forces, W.acting, follow, m, way, push)
            if abs(forces[p]) + push > too_dear:
                return INFEASIBLE, values
            if curvature > NO_PIVOT * itself:
                values += way * push * np.dot(rows, W.z)
                out -= way * push * curvature
            for k in range(m):
                forces[W.acting[k]] -= way * push * follow[k]
            forces[p] += way * push
            if leaves >= 0:
                forces[W.acting[leaves]] = 0.0
                m = _leave(W, m, leaves)
            else:
                m = _enter(W, m, p)
                out = 0.0


@jit
def _alone(rows: np.ndarray, free: np.ndarray, limits: Limits, sums: np.ndarray, own: np.ndarray) -> float:
    """The force that would alone put right what is broken most without limits."""
    running(free, limits.inputs, sums)
    p, out = furthest(free, sums, limits.lower, limits.upper, 0.0)
    if p < 0:
        return 0.0
    row_of(rows, p, limits.inputs, own)
    return abs(out) / np.dot(own, own)


@jit
def _taken_over(W: Factors, rows: np.ndarray, limits: Limits, forces: np.ndarray, own: np.ndarray) -> int:
    """Factors of what acts; how many they are."""
    m = 0
    for a in range(forces.size):
        if forces[a] != 0.0 and np.isfinite(limits.lower[a] if forces[a] > 0.0 else limits.upper[a]):
            row_of(rows, a, limits.inputs, own)
            if _split(W, m, own) > NO_PIVOT * np.dot(own, own):
                m = _enter(W, m, a)
                continue
        forces[a] = 0.0
    return m


@jit
def _split(W: Factors, m: int, own: np.ndarray) -> float:
    """A row's part along Q into d, what is left of it into z; the square of that."""
    d, z = W.d, W.z
    z[:] = own
    d[:m] = 0.0
    for _ in range(2):
        part = np.dot(W.Q[:m], z)
        d[:m] += part
        z -= np.dot(part, W.Q[:m])
    return np.dot(z, z)


@jit
def _enter(W: Factors, m: int, a: int) -> int:
    """A limit joins those that act, by the split of its row."""
    length = np.sqrt(np.dot(W.z, W.z))
    W.Q[m] = W.z / length
    W.R[m, :m] = W.d[:m]
    W.R[m, m] = length
    W.acting[m] = a
    return m + 1


@jit
def _leave(W: Factors, m: int, place: int) -> int:
    """One no longer acts; those behind it move up."""
    Q, R = W.Q, W.R
    for k in range(place, m - 1):
        W.acting[k] = W.acting[k + 1]
        R[k, : k + 2] = R[k + 1, : k + 2]
    for k in range(place, m - 1):
        length = np.hypot(R[k, k], R[k, k + 1])
        c, s = R[k, k] / length, R[k, k + 1] / length
        for j in range(k, m - 1):
            x, y = R[j, k], R[j, k + 1]
            R[j, k], R[j, k + 1] = c * x + s * y, c * y - s * x
        for i in range(Q.shape[1]):
            x, y = Q[k, i], Q[k + 1, i]
            Q[k, i], Q[k + 1, i] = c * x + s * y, c * y - s * x
    return m - 1


@jit
def _back(W: Factors, m: int, x: np.ndarray) -> None:
    """R^-1 x in the place of x."""
    for k in range(m - 1, -1, -1):
        x[k] /= W.R[k, k]
        for i in range(k):
            x[i] -= x[k] * W.R[k, i]


@jit
def _forwards(W: Factors, m: int, x: np.ndarray) -> None:
    """R^-T x in the place of x."""
    for k in range(m):
        for i in range(k):
            x[k] -= W.R[k, i] * x[i]
        x[k] /= W.R[k, k]


@jit
def _missing(W: Factors, k: int, values: np.ndarray, limits: Limits, forces: np.ndarray) -> float:
    """How far one that acts has to move to its limit."""
    a = W.acting[k]
    limit = limits.lower[a] if forces[a] > 0.0 else limits.upper[a]
    return float(limit - value(values, a, limits.inputs, values.size))


@jit
def _keep_right_ones(W: Factors, m: int, free: np.ndarray, limits: Limits, forces: np.ndarray) -> int:
    """Forces at which all of W are just kept; one by one those that would have to pull leave."""
    f = np.empty(m)
    while True:
        for k in range(m):
            f[k] = _missing(W, k, free, limits, forces)
        _forwards(W, m, f)
        _back(W, m, f)
        place, most = -1, 0.0
        for k in range(m):
            pushed = f[k] if forces[W.acting[k]] > 0.0 else -f[k]
            if pushed < most:
                place, most = k, pushed
        if place < 0:
            break
        forces[W.acting[place]] = 0.0
        m = _leave(W, m, place)
    for k in range(m):
        forces[W.acting[k]] = f[k]
    return m


@jit
def _settle(W: Factors, m: int, rows: np.ndarray, free: np.ndarray, limits: Limits, forces: np.ndarray) -> np.ndarray:
    """Values at which all of W are just kept; the second time what rounding left is put right."""
    values, c = free.copy(), np.empty(m)
    for _ in range(2):
        for k in range(m):
            c[k] = _missing(W, k, values, limits, forces)
        _forwards(W, m, c)
        values += np.dot(rows, np.dot(c, W.Q[:m]))
    return values
