"""The linear equations of one active set: tensions at their bounds or loose, solved to rounding.

    a tau + B'y = a g,   A_r'y = 0,   B tau + A_r c = -w,   B = A_t G

with some tau fixed. Mechanisms and redundant rods make it singular but consistent, so it is solved by a shifted sparse
factor and refinement. Where too many tensions are fixed it is not consistent, and y runs away along the motion that
the fixed tensions and the loads do work on: a direction in which the dual function rises.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.statics.prestress.program import Program

_REFINEMENTS = 60
# Relative to entries of size one: large enough that a singular system has a factor, small enough that each refinement
# gains seven digits where singular values are above 1e-2; below 1e-4 it gains nothing and the residual shows it.
_SHIFT = 1e-9


def solve_set(
    program: Program,
    weight: Float[np.ndarray, " groups"],
    wanted: Float[np.ndarray, " groups"],
    fixed: Float[np.ndarray, " groups"],
    near: Float[np.ndarray, " free"],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tensions of the groups, rod forces and multipliers for a given active set.

    Parameters
    ----------
    weight, wanted : (groups,)
        Goal 1/2 sum weight (tau - wanted)^2; columns are scaled so that every weight is one.
    fixed : (groups,) N
        The tension where it is fixed, NaN where it is loose.
    near : (free,)
        Multipliers from which the correction is least: with many tensions fixed many y fit, and those near an optimum
        agree with the bounds where the smallest do not.
    """
    loose = np.isnan(fixed)
    root = np.sqrt(weight[loose] / weight.max(initial=1e-300))
    tau = np.where(loose, 0.0, fixed)
    right = -program.load - program.tied @ tau
    B = sp.csr_array(program.tied[:, np.flatnonzero(loose)] @ sp.diags_array(1.0 / root))
    R = program.matrix.rods
    K = sp.csc_array(sp.block_array([[sp.eye_array(B.shape[1]), None, B.T], [None, None, R.T], [B, R, None]]))
    shift = np.concatenate([np.zeros(B.shape[1]), np.full(R.shape[1], _SHIFT), np.full(B.shape[0], -_SHIFT)])
    load = np.concatenate([root * wanted[loose], np.zeros(R.shape[1]), right])
    x = _refined(K, shift, load, np.concatenate([np.zeros(B.shape[1] + R.shape[1]), near / weight.max(initial=1e-300)]))
    s, c, y = np.split(x, [B.shape[1], B.shape[1] + R.shape[1]])
    tau[loose] = s / root
    return tau, c, y * weight.max(initial=0.0)


def _refined(K: sp.csc_array, shift: np.ndarray, right: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Solve K x = right by a factor of K + diag(shift), refined from x until the residual stops to fall."""
    import scipy.sparse.linalg as spla

    factor = spla.splu(sp.csc_matrix(K + sp.diags_array(shift)))
    best, left = np.inf, right - K @ x
    for _ in range(_REFINEMENTS):
        trial = x + factor.solve(left)
        left = right - K @ trial
        size = float(np.abs(left).max(initial=0.0))
        if not size < best:
            break
        x, best = trial, size
    return x
