"""Limits of tension that cannot all be kept: give way by as little as possible, one slack a stage.

    minimise  z'Hz/2 + f'z + weight sum eps_k + small |eps|^2,   eps_k >= 0,   tension rows of stage k + eps_k >= floor

It is asked when nobody answered the hard problem. Limits are kept where a metre of them costs less than the price;
near the edge of what can be kept at all it costs more. So an answer that gives way is the beginning of one more
search, at a thousand times the price, and is only taken where that one gives way as well (`synthesis.piece`). A stall
limit is a floor turned about (`synthesis.condensed`), so its slack raises it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.qp import QP

# The price of giving way over the steepest cost in sight, and the one that tells whether anything has to. At the
# second one limits are kept up to 1e-6 of the edge; to begin with it leaves more searches unfinished, and interior
# points end with KKT residuals of 4e-5.
PRICE, DEAR = 1e3, 1e6
# Curvature on the slacks, over the largest of H: keeps the problem strictly convex. With 1e-3 DAQP cycled on one step
# in three of a mast asked for 20 N in every tendon; with 1 on none, at the same relaxation.
_CURVATURE = 1.0


def curvature(H: np.ndarray) -> float:
    """Curvature on each slack."""
    return _CURVATURE * float(np.abs(np.diag(H)).max())


@dataclass(frozen=True, eq=False)
class Relaxed:
    """Matrices of problems with one slack a stage on their tension rows.

    Attributes
    ----------
    H : (n + N, n + N)
    A : (r, n + N)
        Rows: tension floors of all stages, then as many rate rows as there are variables.
    horizon : int
        N, the number of stages.
    """

    H: Float[np.ndarray, "z z"]
    A: Float[np.ndarray, "r z"]
    horizon: int

    @classmethod
    def of(cls, H: Float[np.ndarray, "n n"], A: Float[np.ndarray, "r n"], horizon: int) -> Relaxed:
        """Those of a problem without slacks."""
        n, tensions = H.shape[0], A.shape[0] - H.shape[0]
        wide = np.zeros((n + horizon, n + horizon))
        wide[:n, :n], wide[n:, n:] = H, curvature(H) * np.eye(horizon)
        stage = np.kron(np.eye(horizon), np.ones((tensions // horizon, 1)))
        return cls(wide, np.block([[A[:tensions], stage], [A[tensions:], np.zeros((n, horizon))]]), horizon)

    @property
    def curvature(self) -> float:
        """Of each slack."""
        return float(self.H[-1, -1])

    def problem(self, qp: QP, steep: float = PRICE) -> QP:
        """The problem with slacks at a price over the steepest cost; it begins where the one without them does."""
        n, slacks = qp.f.size, self.horizon
        tensions = self.A.shape[0] - n
        largest = self.curvature / _CURVATURE
        price = steep * max(np.abs(qp.f).max(), 1e-3 * largest * np.abs(qp.lower[n + tensions :]).max())
        return QP(
            H=self.H,
            f=np.concatenate([qp.f, np.full(slacks, price)]),
            A=self.A,
            lower=np.concatenate([qp.lower[:n], np.zeros(slacks), qp.lower[n:]]),
            upper=np.concatenate([qp.upper[:n], np.full(slacks, np.inf), qp.upper[n:]]),
            start=qp.start,
            guess=qp.guess,
            product=None if (rows_at := qp.product) is None else lambda z: self._eased(rows_at(z[:n]), z[n:]),
        )

    def _eased(self, values: Float[np.ndarray, " r"], slacks: Float[np.ndarray, " N"]) -> Float[np.ndarray, " r"]:
        """Values of the rows with slacks added to the floors of their stages."""
        tensions = self.A.shape[0] - self.H.shape[0] + self.horizon
        values[:tensions] += np.repeat(slacks, tensions // self.horizon)
        return values


def relax(qp: QP, horizon: int) -> QP:
    """The problem with one slack a stage on its tension rows."""
    return Relaxed.of(qp.H, qp.A, horizon).problem(qp)
