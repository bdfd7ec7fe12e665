"""A primal active set in rates: every point on its way keeps all limits, and costs no more than the one before.

    minimise    w'G w/2 + g'w + price sum eps + c |eps|^2/2,   u = S w,   S the running sum over stages
    subject to  lower <= w <= upper,   low <= u <= high,   eps >= 0,   M w + eps >= floor, one eps a stage

Where rate limits act by the hundreds, few rates are free. The basis holds what is free and the rows that act, and the
inverse of its matrix is kept (`synthesis.bordered`). A step goes to the minimum over the basis or to the first limit on
the way; at a minimum the entry with the largest promise, push^2 / curvature, is let go. Many free rates at the start
are held instead, and are let go one by one like those at their limits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit
from tensctl.synthesis.bordered import Basis, Form, enter, leave, stage_of

FREE, HELD, LOWER, UPPER = 0, 2, -1, 1
# How the search ended.
SOLVED, BOUNDED, STUCK = 0, 1, 2
# More free rates than these at the start are held: most of them will end at a limit.
FEW = 150
# A rate whose free curvature is this many times its own is fixed by the rows that act.
FIXED = 1e9
# The same of a slack, which a high price moves far: with 1e9 slacks went to -4e-7 m unseen.
FIXED_SLACK = 1e14
# A component below this part of the largest does not move.
NO_MOVE = 1e-10
# Push on what is free at a minimum, over the largest term that it is the sum of: from here on the inverse is made anew.
# Over slopes alone rounding would do: where floors give way, their price is a thousand steepest slopes and more.
DRIFT = 1e-8
# Steps of no length in a row, beyond the entries of the basis, after which it goes in circles.
CIRCLES = 50
# A value this close to its limit, over the largest range of a rate, is at it.
AT_LIMIT = 1e-8


class Step(NamedTuple):
    """What changes: slopes and limits; the last two bound inputs."""

    g: np.ndarray
    price: float
    lower: np.ndarray
    upper: np.ndarray
    floor: np.ndarray
    low: np.ndarray
    high: np.ndarray


class Point(NamedTuple):
    """Where the search is: rates and slacks x, their sides, slope, values of rows (tensions, inputs), rows' sides."""

    x: np.ndarray
    side: np.ndarray
    slope: np.ndarray
    values: np.ndarray
    row_side: np.ndarray


@jit
def search(
    form: Form, step: Step, guess: np.ndarray, room: int, tol: float, work: float
) -> tuple[int, np.ndarray, np.ndarray, np.ndarray]:
    """Search from a guess of inputs.

    Parameters
    ----------
    form, step
    guess : (n,)
        Inputs, brought within their limits stage by stage.
    room : int
        Most entries of the basis.
    tol : float
        Largest push in a wrong direction, over the largest slope.
    work : float
        Multiplications after which it ends where it is.

    Returns
    -------
    ended : SOLVED, BOUNDED or STUCK
    x : (n + stages,)
        Rates and slacks.
    push : (n + stages,)
        Slope with the rows' multipliers: what limits of x hold against.
    multipliers : (r + n,)
        Of tension rows and inputs; negative at lower limits.
    """
    n, r = form.by_rate.shape
    size = n + form.stages
    point = Point(
        np.zeros(size), np.zeros(size, np.int8), np.empty(size), np.empty(r + n), np.zeros(r + n, np.int8)
    )  # fmt: skip
    basis = Basis(np.empty(room, np.int64), np.empty((room, room)), np.empty(room), np.empty(room))
    push, multipliers, sol = np.zeros(size), np.zeros(r + n), np.zeros(room)
    d_slope, d_values = np.empty(size), np.empty(r + n)
    scale, reach = np.abs(step.g).max(), (step.upper - step.lower).max()
    ended = STUCK
    if not _begin(form, step, guess, point, reach):
        return ended, point.x, push, multipliers
    _evaluate(form, step, point)
    m = _first_basis(form, step, point, basis, reach)
    done, idle, since, checked = 4.0 / 3.0 * m**3, 0, 0, False
    while True:
        since += 1
        done += 2.0 * m * m + 2.0 * m * (n + r)
        far = _newton(step, point, basis, m, sol)
        fraction, place, row, way = 1.0, -1, -1, 0
        if far > 1e-13 * reach:
            _along(form, basis, m, sol, d_slope, d_values)
            fraction, place, row, way = _first_limit(form, step, point, basis, m, sol, far, d_values)
            for k in range(m):
                if basis.entries[k] < size:
                    point.x[basis.entries[k]] += fraction * sol[k]
            for j in range(size):
                point.slope[j] += fraction * d_slope[j]
            for j in range(r + n):
                point.values[j] += fraction * d_values[j]
        idle = idle + 1 if fraction * far <= 1e-13 * reach else 0
        if idle > 2 * m + CIRCLES:
            break
        if done > work:
            ended = BOUNDED
            break
        if row >= 0:
            if m == room:
                break
            if enter(form, basis, m, size + row):
                point.row_side[row] = way
                m += 1
            else:
                point.row_side[row] = HELD
            continue
        if place >= 0:
            _settle(form, step, point, basis.entries[place], way)
            leave(basis, m, place)
            m -= 1
            continue
        _let_rows_go(point)
        _pushes(form, point, basis, m, sol, push)
        if since > 1 and _left_over(basis, m, push) > DRIFT * _largest_term(basis, m, sol, size, scale):
            _evaluate(form, step, point)
            m, since = _again(form, point, basis, m), 0
            done += 4.0 / 3.0 * m**3 + 1.0 * n * (n + r)
            continue
        who, is_row = _most_promising(form, point, basis, m, sol, push, tol * scale)
        if who < 0:
            if checked or _left_over(basis, m, push) <= tol * scale:
                ended = SOLVED
                break
            _evaluate(form, step, point)
            m, checked = _again(form, point, basis, m), True
            done += 4.0 / 3.0 * m**3
        elif is_row:
            point.row_side[basis.entries[who] - size] = 0
            leave(basis, m, who)
            m -= 1
        elif enter(form, basis, m, who):
            point.side[who] = FREE
            m += 1
        else:
            break
    _pushes(form, point, basis, m, sol, push)
    for k in range(m):
        if basis.entries[k] >= size:
            multipliers[basis.entries[k] - size] = sol[k]
        else:
            push[basis.entries[k]] = 0.0
    return ended, point.x, push, multipliers


@jit
def _begin(form: Form, step: Step, guess: np.ndarray, point: Point, reach: float) -> bool:
    """Rates that lead to the guess as nearly as all limits allow, and the slacks that they need; False without any."""
    n, r = form.by_rate.shape
    nu, few = n // form.stages, 0
    for j in range(n):
        before = guess[j - nu] if j >= nu else 0.0
        low, high = max(step.lower[j], step.low[j] - before), min(step.upper[j], step.high[j] - before)
        if low > high:
            return False
        w = min(max(guess[j] - before, low), high)
        point.side[j] = FREE
        if w <= step.lower[j] + AT_LIMIT * reach and low == step.lower[j]:
            w, point.side[j] = step.lower[j], LOWER
        elif w >= step.upper[j] - AT_LIMIT * reach and high == step.upper[j]:
            w, point.side[j] = step.upper[j], UPPER
        else:
            few += 1
        point.x[j] = w
        guess[j] = before + w
    if few > FEW:
        for j in range(n):
            if point.side[j] == FREE:
                point.side[j] = HELD
    tension = np.zeros(r)
    for j in range(n):
        for i in range(r):
            tension[i] += form.by_rate[j, i] * point.x[j]
    for s in range(form.stages):
        missing = 0.0
        for i in range(s * r // form.stages, (s + 1) * r // form.stages):
            missing = max(missing, step.floor[i] - tension[i])
        point.x[n + s] = missing
        point.side[n + s] = FREE if missing > 0.0 else LOWER
    return True


@jit
def _evaluate(form: Form, step: Step, point: Point) -> None:
    """Slope and values anew."""
    n, r = form.by_rate.shape
    nu, x = n // form.stages, point.x
    point.slope[:n] = step.g
    point.values[:] = 0.0
    for j in range(n):
        for i in range(n):
            point.slope[i] += form.G[j, i] * x[j]
        for i in range(r):
            point.values[i] += form.by_rate[j, i] * x[j]
        point.values[r + j] = x[j] + (point.values[r + j - nu] if j >= nu else 0.0)
    for s in range(form.stages):
        point.slope[n + s] = step.price + form.curvature * x[n + s]
        for i in range(s * r // form.stages, (s + 1) * r // form.stages):
            point.values[i] += x[n + s]


@jit
def _first_basis(form: Form, step: Step, point: Point, basis: Basis, reach: float) -> int:
    """All that is free, and of each stage whose slack is free the row that needs it most."""
    n, r = form.by_rate.shape
    size, m = n + form.stages, 0
    for e in range(size):
        if point.side[e] == FREE:
            if enter(form, basis, m, e):
                m += 1
            else:
                point.side[e] = HELD
    for s in range(form.stages):
        if point.side[n + s] == FREE:
            tightest, gap = -1, AT_LIMIT * reach
            for i in range(s * r // form.stages, (s + 1) * r // form.stages):
                if point.values[i] - step.floor[i] < gap:
                    tightest, gap = i, point.values[i] - step.floor[i]
            if tightest >= 0 and enter(form, basis, m, size + tightest):
                point.row_side[tightest] = LOWER
                m += 1
    return m


@jit
def _again(form: Form, point: Point, basis: Basis, m: int) -> int:
    """The same basis from nothing; what no longer has a pivot is left out."""
    size, kept = point.x.size, 0
    for k in range(m):
        e = basis.entries[k]
        if enter(form, basis, kept, e):
            kept += 1
        elif e < size:
            point.side[e] = HELD
        else:
            point.row_side[e - size] = 0
    return kept


@jit
def _newton(step: Step, point: Point, basis: Basis, m: int, sol: np.ndarray) -> float:
    """Way to the minimum over the basis, and multipliers of its rows; the largest component of the way."""
    entries, inverse = basis.entries, basis.inverse
    size, r = point.x.size, step.floor.size
    sol[:m] = 0.0
    for k in range(m):
        e = entries[k]
        if e < size:
            wanted = -point.slope[e]
        elif e < size + r:
            wanted = step.floor[e - size] - point.values[e - size]
        else:
            limit = step.low if point.row_side[e - size] == LOWER else step.high
            wanted = limit[e - size - r] - point.values[e - size]
        if wanted != 0.0:
            for i in range(m):
                sol[i] += wanted * inverse[k, i]
    far = 0.0
    for k in range(m):
        if entries[k] < size:
            far = max(far, float(abs(sol[k])))
    return far


@jit
def _along(form: Form, basis: Basis, m: int, sol: np.ndarray, d_slope: np.ndarray, d_values: np.ndarray) -> None:
    """Changes of slope and values on the whole way."""
    n, r = form.by_rate.shape
    nu = n // form.stages
    d_slope[:] = 0.0
    d_values[:] = 0.0
    for k in range(m):
        e, d = basis.entries[k], sol[k]
        if e < n:
            for i in range(n):
                d_slope[i] += d * form.G[e, i]
            for i in range(r):
                d_values[i] += d * form.by_rate[e, i]
            d_values[r + e] = d
        elif e < n + form.stages:
            s = e - n
            d_slope[e] = d * form.curvature
            for i in range(s * r // form.stages, (s + 1) * r // form.stages):
                d_values[i] += d
    for j in range(nu, n):
        d_values[r + j] += d_values[r + j - nu]


@jit
def _first_limit(
    form: Form, step: Step, point: Point, basis: Basis, m: int, sol: np.ndarray, far: float, d_values: np.ndarray
) -> tuple[float, int, int, int]:
    """Fraction of the way to the first limit, the place in the basis or the row that meets it, and its side."""
    n, r = form.by_rate.shape
    fraction, place, row, way = 1.0, -1, -1, 0
    still = NO_MOVE * far
    for k in range(m):
        e, d = basis.entries[k], sol[k]
        if e >= n + form.stages or abs(d) <= still:
            continue
        own = form.G[e, e] if e < n else form.curvature
        if basis.inverse[k, k] * own * (FIXED if e < n else FIXED_SLACK) < 1.0:
            continue
        if d < 0.0:
            part = ((step.lower[e] if e < n else 0.0) - point.x[e]) / d
        elif e < n:
            part = (step.upper[e] - point.x[e]) / d
        else:
            continue
        if part < fraction:
            fraction, place, way = part, k, LOWER if d < 0.0 else UPPER
    for i in range(r + n):
        d = d_values[i]
        if point.row_side[i] != 0 or abs(d) <= still or (i < r and d > 0.0):
            continue
        bound = step.low if d < 0.0 else step.high
        part = ((step.floor[i] if i < r else bound[i - r]) - point.values[i]) / d
        if part < fraction:
            fraction, place, row, way = part, -1, i, LOWER if d < 0.0 else UPPER
    return max(fraction, 0.0), place, row, way


@jit
def _settle(form: Form, step: Step, point: Point, e: int, way: int) -> None:
    """Put a rate or a slack on its limit, which it may have passed a little while rows seemed to fix it.

    Slope and values move along: what was left behind stayed in them, and rows ended 1e-8 m below their floors.
    """
    n, r = form.by_rate.shape
    limit = 0.0
    if e < n:
        limit = step.lower[e] if way == LOWER else step.upper[e]
    back = limit - point.x[e]
    point.x[e], point.side[e] = limit, way
    if back == 0.0:
        return
    if e < n:
        for i in range(n):
            point.slope[i] += back * form.G[e, i]
        for i in range(r):
            point.values[i] += back * form.by_rate[e, i]
        for j in range(e, n, n // form.stages):
            point.values[r + j] += back
    else:
        s = e - n
        point.slope[e] += back * form.curvature
        for i in range(s * r // form.stages, (s + 1) * r // form.stages):
            point.values[i] += back


@jit
def _let_rows_go(point: Point) -> None:
    """Rows that were held because they follow from those in the basis are watched again."""
    for i in range(point.row_side.size):
        if point.row_side[i] == HELD:
            point.row_side[i] = FREE


@jit
def _pushes(form: Form, point: Point, basis: Basis, m: int, sol: np.ndarray, push: np.ndarray) -> None:
    """Slope and the rows' multipliers on every rate and slack."""
    n, r = form.by_rate.shape
    size, nu = n + form.stages, n // form.stages
    push[:] = point.slope
    for k in range(m):
        row = basis.entries[k] - size
        if row < 0:
            continue
        if row < r:
            for j in range(n):
                push[j] += sol[k] * form.rows[row, j]
            push[n + stage_of(form, row)] += sol[k]
        else:
            for j in range((row - r) % nu, row - r + 1, nu):
                push[j] += sol[k]


@jit
def _most_promising(
    form: Form, point: Point, basis: Basis, m: int, sol: np.ndarray, push: np.ndarray, tol: float
) -> tuple[int, bool]:
    """What would lower the cost most when it is let go: a rate or slack, or the place of a row; -1 for nothing."""
    n = form.by_rate.shape[0]
    size, best, who, is_row = n + form.stages, 0.0, -1, False
    for e in range(size):
        side = point.side[e]
        if side == FREE:
            continue
        wrong = abs(push[e]) if side == HELD else side * push[e]
        if wrong > tol:
            promise = wrong * wrong / (form.G[e, e] if e < n else form.curvature)
            if promise > best:
                best, who = promise, e
    for k in range(m):
        row = basis.entries[k] - size
        if row >= 0 and -point.row_side[row] * sol[k] > tol:
            promise = sol[k] * sol[k] / abs(basis.inverse[k, k])
            if promise > best:
                best, who, is_row = promise, k, True
    return who, is_row


@jit
def _left_over(basis: Basis, m: int, push: np.ndarray) -> float:
    """Largest push on what is free: rounding, while the inverse is a good one."""
    largest = 0.0
    for k in range(m):
        if basis.entries[k] < push.size:
            largest = max(largest, float(abs(push[basis.entries[k]])))
    return largest


@jit
def _largest_term(basis: Basis, m: int, sol: np.ndarray, size: int, scale: float) -> float:
    """The largest of what pushes are sums of: slopes, and multipliers of the rows that act."""
    largest = scale
    for k in range(m):
        if basis.entries[k] >= size:
            largest = max(largest, float(abs(sol[k])))
    return largest
