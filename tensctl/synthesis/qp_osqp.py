"""OSQP: operator splitting with a polish step; takes any size, accurate to its tolerance and often to rounding."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from tensctl.synthesis.qp import QP, Solution, judged

# Step size that every solve begins with; OSQP adapts it on the way.
_RHO = 0.1


class OsqpSolver:
    """Workspace that keeps matrices and scaling between solves.

    Every solve begins at zero, so that an answer depends on its problem and not on those before: a resumed run then
    equals one in one go. Beginning at the last answer with the last step size would take 0.4 to 0.6 of the time.
    """

    name = "osqp"

    def __init__(self, qp: QP, tol: float = 1e-9, max_iterations: int = 20_000) -> None:
        import osqp

        self._refused = osqp.OSQPException
        self._solver = osqp.OSQP()
        rows = sp.vstack([sp.eye_array(qp.f.size), sp.csc_array(qp.A)], format="csc")
        self._zero = np.zeros(qp.f.size), np.zeros(rows.shape[0])
        try:
            self._solver.setup(
                sp.csc_matrix(np.triu(qp.H)), qp.f, sp.csc_matrix(rows), qp.lower, qp.upper,
                eps_abs=tol, eps_rel=tol, max_iter=max_iterations, rho=_RHO, polishing=False, verbose=False,
            )  # fmt: skip
            self._ready = True
        except self._refused:
            self._ready = False

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds; polish the answer when a bound is active."""
        if not self._ready:
            return judged(qp, None, None, "failed")
        try:
            self._solver.update(q=qp.f, l=qp.lower, u=qp.upper)
            self._solver.update_settings(rho=_RHO)
            self._solver.warm_start(*self._zero)
            result = self._solver.solve(raise_error=False)
            if result.info.status == "solved" and np.abs(result.y).max(initial=0.0) > 0:
                result = self._polished()
        except self._refused:
            return judged(qp, None, None, "failed")
        status = result.info.status
        if status == "solved":
            return judged(qp, np.asarray(result.x), np.asarray(result.y), "solved")
        return judged(qp, None, None, "infeasible" if "primal infeasible" in status else "failed")

    def _polished(self):
        """The same answer, polished: asked for only with active bounds, because OSQP prints a line without them."""
        self._solver.update_settings(polishing=True)
        result = self._solver.solve(raise_error=False)
        self._solver.update_settings(polishing=False)
        return result
