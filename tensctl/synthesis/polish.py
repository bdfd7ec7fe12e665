"""From an answer near the optimum to the optimum: the limits that act are taken for equations.

    H z + f + A_W' y = 0,   A_W z = b_W,   W: the multiplier is larger than the distance to the limit, over their sizes

An interior point stops a little inside its limits. Rows that depend on each other share their multiplier: the equations
are solved by steps of the method of multipliers, each of which a small shift keeps regular.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sl

from tensctl.synthesis.qp import QP, Solution, judged

# Shift of the equations for multipliers, over their diagonal, and steps with it: each leaves about that of the error.
_SHIFT, _STEPS = 1e-10, 4
# Residuals below this are not compared: they are those of large multipliers, and the polished variables are nearer.
_ROUNDING = 1e-10


def polish(qp: QP, found: Solution) -> Solution:
    """The polished answer where its residual is smaller, or nothing worth telling, else the one found."""
    if found.z is None or found.y is None:
        return found
    n, acting, bound = qp.f.size, *_acting(qp, found.z, found.y)
    if not acting.size:
        return found
    rows = np.zeros((acting.size, n))
    own = acting < n
    rows[np.flatnonzero(own), acting[own]] = 1.0
    rows[~own] = qp.A[acting[~own] - n]
    try:
        factor = sl.cho_factor(qp.H, lower=True, check_finite=False)
        half = sl.solve_triangular(factor[0], rows.T, lower=True, check_finite=False)
        push = half.T @ half
        push[np.diag_indices_from(push)] *= 1 + _SHIFT
        pushed = sl.cho_factor(push, lower=True, check_finite=False, overwrite_a=True)
    except np.linalg.LinAlgError:
        return found
    z, y = found.z, np.zeros(acting.size)
    for _ in range(_STEPS):
        z = -sl.cho_solve(factor, qp.f + rows.T @ y, check_finite=False)
        y += sl.cho_solve(pushed, rows @ z - bound, check_finite=False)
    z = -sl.cho_solve(factor, qp.f + rows.T @ y, check_finite=False)
    every = np.zeros_like(found.y)
    every[acting] = y
    better = judged(qp, z, every, found.status)
    return better if better.kkt < max(found.kkt, _ROUNDING) else found


def _acting(qp: QP, z: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The limits that act, and their values."""
    values = np.concatenate([z, qp.A @ z])
    bound = np.where(y > 0, qp.upper, qp.lower)
    gap = np.abs(values - bound)
    sizes = np.abs(values).max(), np.abs(y).max()
    acting = np.flatnonzero((y != 0) & (np.abs(y) * sizes[0] > gap * sizes[1]))
    return acting, bound[acting]
