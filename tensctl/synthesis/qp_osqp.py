"""OSQP: operator splitting with a polish step; takes any size, accurate to its tolerance and often to rounding."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tensctl.synthesis.qp import QP, Solution, judged


class OsqpSolver:
    """Workspace that keeps the factor of the KKT matrix between solves."""

    name = "osqp"

    def __init__(self, qp: QP, tol: float = 1e-9, max_iterations: int = 20_000) -> None:
        import osqp

        rows = sp.vstack([sp.eye_array(qp.f.size), sp.csc_array(qp.A)], format="csc")
        self._solver = osqp.OSQP()
        self._solver.setup(
            sp.csc_matrix(np.triu(qp.H)), qp.f, sp.csc_matrix(rows), qp.lower, qp.upper,
            eps_abs=tol, eps_rel=tol, max_iter=max_iterations, polishing=True, verbose=False,
        )  # fmt: skip

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds, starting from the last answer."""
        self._solver.update(q=qp.f, l=qp.lower, u=qp.upper)
        result = self._solver.solve(raise_error=False)
        status = result.info.status
        if status == "solved":
            return judged(qp, np.asarray(result.x), np.asarray(result.y), "solved")
        return judged(qp, None, None, "infeasible" if "primal infeasible" in status else "failed")
