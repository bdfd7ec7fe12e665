"""DAQP: a dual active-set solver for dense QPs; exact to rounding, best where few constraints act.

It begins at the minimum without limits. Where that breaks none it is the answer, and is found here, in half the time
that DAQP takes to be told of a step.
"""

from __future__ import annotations

import numpy as np

from tensctl.synthesis.qp import QP, Solution, judged

_INFINITE = 1e30
_INFEASIBLE = -1
# Iterations after which it hands over, 0.1 to 0.3 ms each at (3,1) with 20 stages. Most problems with a solution take
# fewer than 70; with some 400 limits acting it is 750 and more, and an interior point is as fast from some 150 on.
QUICK = 150


class DaqpSolver:
    """Workspace that keeps the factor of H between solves; each begins without active constraints.

    Parameters
    ----------
    qp : QP
        Gives H and A.
    most : int
        Iterations after which it gives up.
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
        self._ready = flag >= 0
        self._half = np.asfortranarray(np.linalg.cholesky(qp.H)) if self._ready else np.zeros((0, 0))

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        if not self._ready:
            return judged(qp, None, None, "failed")
        values, idle = qp.unlimited(self._half), np.zeros(qp.upper.size)
        free = values[: qp.f.size]
        if qp.broken(values) == 0.0:
            return Solution(free, idle, "solved", qp.residual(free, idle, values))
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
