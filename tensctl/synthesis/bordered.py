"""The inverse of the matrix of a basis, bordered when something enters and reduced when something leaves.

    [G_FF  R_F']      G the Hessian of rates and slacks, F what is free of them,
    [R_F     0 ]      R the rows that act: tensions M w + eps of a stage, and inputs, the running sums of rates

An entry costs a few multiplications for each entry of the inverse, where a new factor would cost its size times more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit

# A pivot below this part of what it would be if nothing else were coupled is zero.
NO_PIVOT = 1e-10


class Form(NamedTuple):
    """What stays from step to step.

    Attributes
    ----------
    G : (n, n)
        Hessian of rates.
    rows : (r, n)
        Tensions by rates, stage by stage.
    by_rate : (n, r)
        The same, rate by rate.
    curvature : float
        Of each slack.
    stages : int
    """

    G: np.ndarray
    rows: np.ndarray
    by_rate: np.ndarray
    curvature: float
    stages: int


class Basis(NamedTuple):
    """What is free and what acts.

    Attributes
    ----------
    entries : (room,) int
        Numbers of rates, then slacks, then tension rows, then rows of inputs.
    inverse : (room, room)
    column, turned : (room,)
        Room to work in.
    """

    entries: np.ndarray
    inverse: np.ndarray
    column: np.ndarray
    turned: np.ndarray


@jit
def stage_of(form: Form, row: int) -> int:
    """Stage of a tension row; stage s has the rows from s r // stages on, which need not be equally many."""
    return ((row + 1) * form.stages - 1) // form.rows.shape[0]


@jit
def _coupling(form: Form, a: int, b: int) -> float:
    """Entry of the matrix of the basis, a <= b."""
    n, r = form.by_rate.shape
    size = n + form.stages
    if b < n:
        return form.G[a, b]
    if b < size:
        return form.curvature if a == b else 0.0
    if a >= size:
        return 0.0
    row = b - size
    if row < r:
        if a < n:
            return form.rows[row, a]
        return 1.0 if a - n == stage_of(form, row) else 0.0
    row -= r
    nu = n // form.stages
    return 1.0 if a <= row and (row - a) % nu == 0 else 0.0


@jit
def enter(form: Form, basis: Basis, m: int, e: int) -> bool:
    """Border the inverse; False when there is no room, or no pivot."""
    entries, inverse, column, turned = basis
    if m == entries.size:
        return False
    turned[:m] = 0.0
    for k in range(m):
        column[k] = _coupling(form, min(entries[k], e), max(entries[k], e))
        if column[k] != 0.0:
            for i in range(m):
                turned[i] += column[k] * inverse[k, i]
    pivot = size = _coupling(form, e, e)
    for k in range(m):
        pivot -= column[k] * turned[k]
        own = _coupling(form, entries[k], entries[k])
        if own > 0.0:
            size += column[k] * column[k] / own
    if not abs(pivot) > NO_PIVOT * size:
        return False
    border(inverse, m, turned, pivot)
    entries[m] = e
    return True


@jit
def leave(basis: Basis, m: int, place: int) -> None:
    """Reduce the inverse by one entry; the last one takes its place."""
    reduce(basis.inverse, m, place, basis.column)
    basis.entries[place] = basis.entries[m - 1]


@jit
def border(inverse: np.ndarray, m: int, turned: np.ndarray, pivot: float) -> None:
    """The inverse with one more row and column: `turned` is it times the new column, `pivot` what then is left."""
    for k in range(m):
        part = turned[k] / pivot
        for i in range(m):
            inverse[k, i] += part * turned[i]
        inverse[k, m] = inverse[m, k] = -part
    inverse[m, m] = 1.0 / pivot


@jit
def reduce(inverse: np.ndarray, m: int, place: int, column: np.ndarray) -> None:
    """The inverse with one row and column less, into whose place the last ones come; `column` is room to work in."""
    last = m - 1
    for k in range(m):
        inverse[place, k], inverse[last, k] = inverse[last, k], inverse[place, k]
    for k in range(m):
        inverse[k, place], inverse[k, last] = inverse[k, last], inverse[k, place]
    for k in range(last):
        column[k] = inverse[last, k]
    for k in range(last):
        part = column[k] / inverse[last, last]
        for i in range(last):
            inverse[k, i] -= part * column[i]
