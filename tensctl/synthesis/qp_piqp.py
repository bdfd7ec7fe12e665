"""PIQP: an interior-point method that factors stage by stage; 11 to 30 iterations whatever the limits do.

An interior point is hardly slower where hundreds of limits act, and then an active set is by far: relaxed steps of the
(3,1) shell, 20 stages, 430 limits acting, take 77 ms here in the median and 103 at worst, 1.8 and 2.6 s in DAQP
(`benchmarks/mpc_solvers.py`).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.polish import polish
from tensctl.synthesis.qp import QP, Solution, judged
from tensctl.synthesis.qp_stages import Stages

# Its own tolerance. With 1e-10 one answer in 191 stopped where the limits that act could not be told (KKT 1.5e-10, its
# first input off by 4e-9 m); an iteration more puts all of them on their limits.
_TOL = 1e-12
# Iterations that it may take; 30 were the most seen.
_MOST = 50


class PiqpSolver:
    """Workspace that keeps the factor's pattern between solves; each begins anew.

    Parameters
    ----------
    stages : Stages
    H : (n, n)
        Of the condensed form, with its slacks.
    tol : float
        Of residuals and gap, in the units of the problem.
    """

    name = "piqp"

    def __init__(self, stages: Stages, H: Float[np.ndarray, "n n"], tol: float = _TOL) -> None:
        import piqp

        self._piqp, self._stages = piqp, stages
        self._half = np.linalg.cholesky(H)
        self._solver = piqp.SparseSolver()
        settings = self._solver.settings
        settings.kkt_solver = piqp.KKTSolver.sparse_multistage
        settings.eps_abs = settings.eps_rel = tol
        settings.max_iter, settings.num_threads = _MOST, 1
        # Its scaling is remade from the last one at every update, and answers then know what was solved before. Rows
        # and inputs are metres here, so two iterations more are all that it is missed for.
        settings.preconditioner_iter = 0
        size, rows = stages.cost.shape[0], stages.rows.shape[0]
        self._solver.setup(
            stages.cost, np.zeros(size), stages.motion, np.zeros(stages.motion.shape[0]), stages.rows,
            -np.ones(rows), np.ones(rows), -np.ones(size), np.ones(size),
        )  # fmt: skip

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        v = self._stages.vectors(qp)
        self._solver.update(c=v.cost, b=v.motion, h_l=v.row_lower, h_u=v.row_upper, x_l=v.lower, x_u=v.upper)
        status, answer = self._solver.solve(), self._solver.result
        if status == self._piqp.PIQP_PRIMAL_INFEASIBLE:
            return judged(qp, None, None, "infeasible")
        if status not in (self._piqp.PIQP_SOLVED, self._piqp.PIQP_MAX_ITER_REACHED):
            return judged(qp, None, None, "failed")
        z, y = self._stages.condensed(np.array(answer.x), answer.z_bu - answer.z_bl, answer.z_u - answer.z_l)
        return polish(qp, judged(qp, z, y, "solved"), self._half)
