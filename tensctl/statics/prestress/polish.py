"""From a solver's eight digits to all of them: the active set's linear equations, solved exactly.

At the optimum of 1/2 sum a (tau - g)^2 each group's tension is tau = clip(g - (B'y)/a) with B = A_t G, so y alone says
which bounds are active. For a given set the rest is linear,

    a tau + B'y = a g,   A_r'y = 0,   B tau + A_r c = -w

solved by a shifted sparse factor and refinement, because mechanisms and redundant rods make it singular but consistent.
The set is corrected until it repeats (a primal-dual active set method: Hintermueller, Ito and Kunisch 2003, doi
10.1137/S1052623401383558).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.statics.prestress.program import Balanced, Program

_CORRECTIONS = 40
_REFINEMENTS = 60
# Relative to entries of size one: large enough that a singular system has a factor, small enough that each refinement
# gains seven digits where singular values are above 1e-2; below 1e-4 it gains nothing and the residual shows it.
_SHIFT = 1e-9


def polish(program: Program, weights: np.ndarray, target: np.ndarray, rough: Balanced) -> Balanced:
    """The optimum to rounding, or the rough one where the active set does not settle."""
    weight, wanted = program.quadratic(weights, target)
    low, high = program.bounds
    y, seen = rough.multipliers, []
    best, best_gap = rough, np.inf
    for _ in range(_CORRECTIONS):
        free = wanted - (program.tied.T @ y) / weight
        fixed = np.where(free <= low, low, np.where(free >= high, high, np.nan))
        if any(np.array_equal(fixed, before, equal_nan=True) for before in seen):
            break
        seen.append(fixed)
        tau, c, y = _solve_set(program, weight, wanted, fixed)
        gap = _outside(program, tau, c, low, high)
        if gap < best_gap:
            best, best_gap = Balanced(program.tie @ tau, c, y), gap
    rough_gap = _outside(program, _groups(program, rough.tensions), rough.rod_forces, low, high)
    return best if best_gap <= rough_gap else rough


def _groups(program: Program, tensions: np.ndarray) -> np.ndarray:
    return (program.tie.T @ tensions) / np.bincount(program.groups, minlength=program.tie.shape[1])


def _outside(program: Program, tau: np.ndarray, c: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Largest force out of balance or out of bounds, N."""
    left = program.tied @ tau + program.matrix.rods @ c + program.load
    beyond = np.maximum(low - tau, tau - high).max(initial=0.0)
    return float(max(np.abs(left).max(initial=0.0), beyond))


def _solve_set(
    program: Program, weight: np.ndarray, wanted: np.ndarray, fixed: Float[np.ndarray, " groups"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tensions, rod forces and multipliers for a given active set; columns are scaled so that every weight is one."""
    loose = np.isnan(fixed)
    root = np.sqrt(weight[loose] / weight.max(initial=1e-300))
    tau = np.where(loose, 0.0, fixed)
    right = -program.load - program.tied @ tau
    B = sp.csr_array(program.tied[:, np.flatnonzero(loose)] @ sp.diags_array(1.0 / root))
    R = program.matrix.rods
    K = sp.csc_array(sp.block_array([[sp.eye_array(B.shape[1]), None, B.T], [None, None, R.T], [B, R, None]]))
    shift = np.concatenate([np.zeros(B.shape[1]), np.full(R.shape[1], _SHIFT), np.full(B.shape[0], -_SHIFT)])
    load = np.concatenate([root * wanted[loose], np.zeros(R.shape[1]), right])
    x = _refined(K, shift, load)
    s, c, y = np.split(x, [B.shape[1], B.shape[1] + R.shape[1]])
    tau[loose] = s / root
    return tau, c, y * weight.max(initial=0.0)


def _refined(K: sp.csc_array, shift: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve K x = right by a factor of K + diag(shift), refined until the residual stops to fall."""
    import scipy.sparse.linalg as spla

    factor = spla.splu(sp.csc_matrix(K + sp.diags_array(shift)))
    x, best, left = np.zeros_like(right), np.inf, right
    for _ in range(_REFINEMENTS):
        trial = x + factor.solve(left)
        left = right - K @ trial
        size = float(np.abs(left).max(initial=0.0))
        if not size < best:
            break
        x, best = trial, size
    return x
