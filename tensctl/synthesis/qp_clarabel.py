"""Clarabel: an interior-point method for any sparse problem; slow on dense stages, and a second opinion on them."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import scipy.sparse as sp

from tensctl.synthesis.qp import QP, Solution, judged
from tensctl.synthesis.qp_stages import Stages

_INFEASIBLE = ("PrimalInfeasible", "AlmostPrimalInfeasible")


class ClarabelSolver:
    """The problem by stages as a cone programme; nothing is kept from solve to solve but the matrices."""

    name = "clarabel"

    def __init__(self, stages: Stages, tol: float = 1e-9) -> None:
        clarabel: Any = import_module("clarabel")  # a compiled module without type information

        self._clarabel, self._stages = clarabel, stages
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = False
        self._settings.tol_gap_abs = self._settings.tol_gap_rel = self._settings.tol_feas = tol
        self._cost = sp.csc_matrix(sp.triu(stages.cost))
        bounded = sp.vstack([sp.eye_array(stages.cost.shape[0]), stages.rows])
        self._rows = sp.csr_array(sp.vstack([stages.motion, bounded, -bounded]))

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        v = self._stages.vectors(qp)
        upper, lower = np.concatenate([v.upper, v.row_upper]), np.concatenate([v.lower, v.row_lower])
        right = np.concatenate([v.motion, upper, -lower])
        kept = np.flatnonzero(np.isfinite(right))
        cones = [
            self._clarabel.ZeroConeT(v.motion.size),
            self._clarabel.NonnegativeConeT(kept.size - v.motion.size),
        ]
        answer = self._clarabel.DefaultSolver(
            self._cost, v.cost, sp.csc_matrix(self._rows[kept]), right[kept], cones, self._settings
        ).solve()
        if str(answer.status) in _INFEASIBLE:
            return judged(qp, None, None, "infeasible")
        push = np.zeros(right.size)
        push[kept] = answer.z
        above, below = push[v.motion.size :].reshape(2, -1)
        z, y = self._stages.condensed(np.array(answer.x), *np.split(above - below, [v.cost.size]))
        return judged(qp, z, y, "solved")
