"""DAQP: a dual active-set solver for dense QPs; exact to rounding, best where few constraints act.

It begins at the minimum without limits. Where that breaks none it is the answer, and is found here, in half the time
that DAQP takes to be told of a step.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpotrs

from tensctl.synthesis.qp import QP, Solution, judged

_INFINITE = 1e30
_INFEASIBLE = -1
# Multiplications after which it hands over, some 4 ms: 36 iterations of 0.11 ms for (3,1) with 20 stages. Each takes
# a product with all rows, and limits enter one by one: with some 400 acting it is 750 iterations and more.
_QUICK = 2.5e7


def quick(qp: QP) -> int:
    """Iterations after which the solver for a problem of this size hands over."""
    return int(_QUICK / (qp.upper.size * qp.f.size)) + 1


class DaqpSolver:
    """Workspace that keeps the factor of H between solves; each begins without active constraints.

    Parameters
    ----------
    qp : QP
        Gives H and A.
    most : int
        Iterations after which it gives up; at once, where the minimum without limits breaks more of them.
    tol : float, m
        Largest violation of a row. Rows are metres: DAQP's own 1e-6 would be a newton at k = 1e6, and fails the KKT
        test on small motions.
    """

    name = "daqp"

    def __init__(self, qp: QP, most: int = 100_000, tol: float = 1e-10) -> None:
        import daqp

        self._model = daqp.Model()
        flag, _ = self._model.setup(
            np.ascontiguousarray(qp.H), qp.f.copy(), np.ascontiguousarray(qp.A), _clipped(qp.upper), _clipped(qp.lower)
        )
        self._model.settings = {**self._model.settings, "primal_tol": tol, "iter_limit": most}
        self._ready, self._most = flag >= 0, most
        self._half = np.asfortranarray(np.linalg.cholesky(qp.H)) if self._ready else None

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        if not self._ready:
            return judged(qp, None, None, "failed")
        free = np.asarray(dpotrs(self._half, -qp.f, lower=1)[0])
        values, idle = qp.values(free), np.zeros(qp.upper.size)
        if qp.broken(values) == 0.0:
            return Solution(free, idle, "solved", qp.residual(free, idle, values))
        if np.count_nonzero((values < qp.lower) | (values > qp.upper)) > self._most:
            return judged(qp, None, None, "failed")
        self._model.update(
            f=qp.f.copy(), bupper=_clipped(qp.upper), blower=_clipped(qp.lower),
            sense=np.zeros(qp.upper.size, np.int32),
        )  # fmt: skip
        z, _, flag, info = self._model.solve()
        if flag <= 0:
            return judged(qp, None, None, "infeasible" if flag == _INFEASIBLE else "failed")
        return judged(qp, np.asarray(z), np.asarray(info["lam"]), "solved")


def _clipped(bounds: np.ndarray) -> np.ndarray:
    return np.clip(bounds, -_INFINITE, _INFINITE)
