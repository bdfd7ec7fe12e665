"""A dual active set in rates: from the minimum without limits, each limit that is broken is put right in turn.

    minimise  w'G w/2 + g'w   subject to  lower <= (w, M w) <= upper,   low <= S w <= high

With B = (I, M) G^-1 (I, M)' a force f on a limit a moves all values (w, M w) by B_a f, so that a limit costs a few
products with the rows of B of those that act, and none with G or M. The broken limit p that is furthest out is pushed
back while the forces of those in the basis W follow,

    f_W -= t r,   values += t (B_p - sum r_j B_j),   r = (B_WW)^-1 B_Wp,

until p is kept or a force of W vanishes, whose limit then leaves [Goldfarb and Idnani 1983].
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import jit
from tensctl.synthesis.bordered import border, reduce

# How the search ended.
SOLVED, BUSY, INFEASIBLE, DOUBTFUL = 0, 1, 2, 3
# A limit that is further out than this many times the first one: the others are kept at its cost, and most likely not
# all of them can be.
ASTRAY = 4.0
# A curvature below this part of its own row's is zero; one below the other has lost half its digits or more.
NO_PIVOT, FEW_DIGITS = 1e-10, 1e-6


@jit
def search(
    B: np.ndarray, values: np.ndarray, lower: np.ndarray, upper: np.ndarray, inputs: int, room: int, tol: float,
    few: float, work: float,
) -> tuple[int, np.ndarray]:  # fmt: skip
    """Put right what is broken.

    Parameters
    ----------
    B : (n + r, n + r)
    values : (n + r,)
        Rates and tensions of the minimum without limits; become those of the answer.
    lower, upper : (n + r + n,)
        Of rates, tensions, and inputs, which are the running sums of rates.
    inputs : int
        Inputs of a stage.
    room : int
        Most limits that may act.
    tol : float
        Largest violation.
    few : float
        Part of its own row's below which a curvature is doubtful; at -inf none is.
    work : float
        Multiplications after which it gives up.

    Returns
    -------
    ended : SOLVED, BUSY, INFEASIBLE or DOUBTFUL
        Busy: more limits act than there is room or work for, or it goes astray. In doubt: few digits are left of what
        acts.
    forces : (n + r + n,)
        Positive at lower limits; of the basis where it is in doubt.
    """
    known, count = values.size, lower.size
    n = count - known
    free, forces = values.copy(), np.zeros(count)
    acting, rows = np.empty(room, np.int64), np.empty((room, known))
    inverse, column, follow = np.empty((room, room)), np.empty(room), np.empty(room)
    own, change, sums = np.empty(known), np.empty(known), np.empty(n)
    m, exact, done, first = 0, True, 0.0, 0.0
    while True:
        running(values, inputs, sums)
        p, out = furthest(values, sums, lower, upper, tol)
        if p < 0 or forces[p] != 0.0:
            if p >= 0 and (exact or few > 0.0):
                return DOUBTFUL, forces  # one that acts is out by rounding
            if exact:
                return SOLVED, forces
            _afresh(free, lower, upper, acting, rows, inverse, m, inputs, forces, values)
            exact = True
            continue
        exact, first = False, max(first, abs(out)) if m == 0 else first
        if abs(out) > ASTRAY * first:
            return BUSY, forces
        row_of(B, p, inputs, own)
        while out != 0.0:
            done += 2.0 * m * (m + known)
            if done > work:
                return BUSY, forces
            for k in range(m):
                column[k] = value(own, acting[k], inputs, known)
            follow[:m] = 0.0
            for k in range(m):
                for i in range(m):
                    follow[i] += column[k] * inverse[k, i]
            itself = value(own, p, inputs, known)
            curvature = itself
            for k in range(m):
                curvature -= column[k] * follow[k]
            if curvature < few * itself and abs(curvature) > NO_PIVOT * itself:
                forces[p] = 0.0
                return DOUBTFUL, forces
            way = 1.0 if out > 0.0 else -1.0
            push = abs(out) / curvature if curvature > NO_PIVOT * itself else np.inf
            push, leaves = first_to_vanish(forces, acting, follow, m, way, push)
            if push == np.inf:
                return INFEASIBLE, forces
            if curvature > NO_PIVOT * itself:
                change[:] = own
                for k in range(m):
                    for i in range(known):
                        change[i] -= follow[k] * rows[k, i]
                for i in range(known):
                    values[i] += way * push * change[i]
                out -= way * push * curvature
            for k in range(m):
                forces[acting[k]] -= way * push * follow[k]
            forces[p] += way * push
            if leaves >= 0:
                forces[acting[leaves]] = 0.0
                reduce(inverse, m, leaves, column)
                m -= 1
                acting[leaves], rows[leaves] = acting[m], rows[m]
                continue
            if m == room:
                return BUSY, forces
            border(inverse, m, follow, curvature)
            acting[m], rows[m] = p, own
            m += 1
            out = 0.0


@jit
def running(values: np.ndarray, inputs: int, sums: np.ndarray) -> None:
    """Inputs: running sums of rates over stages."""
    for j in range(sums.size):
        sums[j] = values[j] + (sums[j - inputs] if j >= inputs else 0.0)


@jit
def value(row: np.ndarray, a: int, inputs: int, known: int) -> float:
    """Entry of limit a in the values that a force moves."""
    if a < known:
        return row[a]
    a -= known
    total = 0.0
    for j in range(a % inputs, a + 1, inputs):
        total += row[j]
    return total


@jit
def row_of(rows: np.ndarray, a: int, inputs: int, row: np.ndarray) -> None:
    """The row of limit a; those of inputs are sums over rates'."""
    known = rows.shape[0]
    if a < known:
        row[:] = rows[a]
        return
    a -= known
    row[:] = 0.0
    for j in range(a % inputs, a + 1, inputs):
        for i in range(row.size):
            row[i] += rows[j, i]


@jit
def first_to_vanish(
    forces: np.ndarray, acting: np.ndarray, follow: np.ndarray, m: int, way: float, push: float
) -> tuple[float, int]:
    """How large a push may be until a force of the basis vanishes, and its place; the push itself and -1 where none."""
    leaves = -1
    for k in range(m):
        force = forces[acting[k]]
        relief = way * follow[k] * (1.0 if force > 0.0 else -1.0)
        if relief > 0.0 and abs(force) < push * relief:
            push, leaves = abs(force) / relief, k
    return push, leaves


@jit
def furthest(
    values: np.ndarray, sums: np.ndarray, lower: np.ndarray, upper: np.ndarray, tol: float
) -> tuple[int, float]:
    """The limit that is furthest out, and by how much it has to move; -1 when all are kept."""
    worst, out, known = -1, tol, values.size
    for a in range(lower.size):
        value = values[a] if a < known else sums[a - known]
        if lower[a] - value > out or value - upper[a] > out:
            worst, out = a, max(lower[a] - value, value - upper[a])
    if worst < 0:
        return -1, 0.0
    value = values[worst] if worst < known else sums[worst - known]
    return worst, lower[worst] - value if lower[worst] - value == out else upper[worst] - value


@jit
def _afresh(
    free: np.ndarray, lower: np.ndarray, upper: np.ndarray, acting: np.ndarray, rows: np.ndarray, inverse: np.ndarray,
    m: int, inputs: int, forces: np.ndarray, values: np.ndarray,
) -> None:  # fmt: skip
    """Correct forces by what limits of the basis are off, and values from nothing: rounding does not add up."""
    known = free.size
    values[:] = free
    for k in range(m):
        for i in range(known):
            values[i] += forces[acting[k]] * rows[k, i]
    off = np.empty(m)
    for k in range(m):
        limit = lower[acting[k]] if forces[acting[k]] > 0.0 else upper[acting[k]]
        off[k] = limit - value(values, acting[k], inputs, known)
    for k in range(m):
        correction = 0.0
        for i in range(m):
            correction += inverse[k, i] * off[i]
        forces[acting[k]] += correction
        for i in range(known):
            values[i] += correction * rows[k, i]
