"""From an answer near the optimum to the optimum: the limits that act are taken for equations.

    H z + f + A_W' y = 0,   A_W z = b_W

W are at first the limits whose multiplier is larger than the distance to them, each over its size; then those with a
multiplier of the wrong sign leave, and broken ones join. An interior point stops a little inside its limits, and this
puts the answer on them. Rows that depend on each other share their multiplier: the equations are solved by steps of the
method of multipliers, each of which a small shift keeps regular.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl
from jaxtyping import Float

from tensctl.synthesis.qp import QP, Solution, judged

# Shift of the equations for multipliers, over their diagonal, and steps with it: each leaves about that of the error.
_SHIFT, _STEPS = 1e-10, 4
# Sets of limits that are tried, 6 ms each at (3,1) with 20 stages; one or two are usual.
_TRIES = 8
# Residuals below this are not compared: they are those of large multipliers, and the polished variables are nearer.
_ROUNDING = 1e-10
# What is broken, or pulls, by less than this part of the largest counts as rounding.
_NOTHING = 1e-12


def polish(qp: QP, found: Solution, half: Float[np.ndarray, "n n"]) -> Solution:
    """The polished answer where its residual is smaller, or nothing worth telling, else the one found.

    Parameters
    ----------
    half : (n, n)
        The lower triangle L of H = L L', which no step changes.
    """
    if found.z is None or found.y is None:
        return found
    best, side = found, _acting(qp, found.z, found.y)
    for _ in range(_TRIES):
        answer = _on(qp, half, side)
        if answer is None:
            break
        new = judged(qp, *answer, found.status)
        best = new if new.kkt < max(best.kkt, _ROUNDING) else best
        before, side = side, _corrected(qp, side, *answer)
        if new.kkt < _ROUNDING or (side == before).all():
            break
    return best


def _acting(qp: QP, z: np.ndarray, y: np.ndarray) -> np.ndarray:
    """1 where an upper limit acts, -1 where a lower one does."""
    values = qp.values(z)
    gap = np.abs(values - np.where(y > 0, qp.upper, qp.lower))
    acts = (y != 0) & (np.abs(y) * np.abs(values).max() > gap * np.abs(y).max())
    return np.where(acts, np.sign(y), 0.0)


def _corrected(qp: QP, side: np.ndarray, z: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Without limits that pull, with limits that are broken."""
    values = qp.values(z)
    slack = _NOTHING * np.abs(values).max(initial=0.0)
    kept = np.where(side * y < -_NOTHING * np.abs(y).max(initial=0.0), 0.0, side)
    return np.where(values > qp.upper + slack, 1.0, np.where(values < qp.lower - slack, -1.0, kept))


def _on(qp: QP, half: np.ndarray, side: np.ndarray) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " m"]] | None:
    """The optimum on given limits and its multipliers; nothing where they contradict each other."""
    n, acting = qp.f.size, np.flatnonzero(side)
    bound = np.where(side > 0, qp.upper, qp.lower)[acting]
    rows = np.zeros((acting.size, n))
    own = acting < n
    rows[np.flatnonzero(own), acting[own]] = 1.0
    rows[~own] = qp.A[acting[~own] - n]
    moved = sl.solve_triangular(half, rows.T, lower=True, check_finite=False)
    push = moved.T @ moved
    push[np.diag_indices_from(push)] *= 1 + _SHIFT
    try:
        factor = sl.cho_factor(push, lower=True, check_finite=False, overwrite_a=True)
    except np.linalg.LinAlgError:
        return None
    y, z = np.zeros(acting.size), -sl.cho_solve((half, True), qp.f, check_finite=False)
    for _ in range(_STEPS):
        y += sl.cho_solve(factor, rows @ z - bound, check_finite=False)
        z = -sl.cho_solve((half, True), qp.f + rows.T @ y, check_finite=False)
    every = np.zeros(side.size)
    every[acting] = y
    return z, every
