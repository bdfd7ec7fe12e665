"""Limits of tension that cannot all be kept: give way by as little as possible, one slack a stage.

    minimise  z'Hz/2 + f'z + weight sum eps_k + small |eps|^2,   eps_k >= 0,   tension rows of stage k + eps_k >= floor

It is asked only when the hard problem has no solution, so the limits are exact whenever they can be kept. A stall
limit is a floor turned about (`synthesis.condensed`), so its slack raises it.
"""

from __future__ import annotations

import numpy as np

from tensctl.synthesis.qp import QP

# The price of giving way over the steepest cost in sight: large enough that cost never buys tension.
_PRICE = 1e3
# Curvature on the slacks, over the largest of H: keeps the problem strictly convex. With 1e-3 DAQP cycled on one step
# in three of a mast asked for 20 N in every tendon; with 1 on none, at the same relaxation.
_CURVATURE = 1.0


def curvature(H: np.ndarray) -> float:
    """Curvature on each slack."""
    return _CURVATURE * float(np.abs(np.diag(H)).max())


def relax(qp: QP, horizon: int) -> QP:
    """The problem with one slack a stage on its tension rows.

    Parameters
    ----------
    qp : QP
        Rows: tension floors of all stages, then as many rate rows as there are variables.
    horizon : int
        Number of stages.
    """
    n, tensions = qp.f.size, qp.A.shape[0] - qp.f.size
    stage = np.kron(np.eye(horizon), np.ones((tensions // horizon, 1)))
    largest = curvature(qp.H) / _CURVATURE
    H = np.zeros((n + horizon, n + horizon))
    H[:n, :n], H[n:, n:] = qp.H, curvature(qp.H) * np.eye(horizon)
    A = np.block([[qp.A[:tensions], stage], [qp.A[tensions:], np.zeros((n, horizon))]])
    price = _PRICE * max(np.abs(qp.f).max(), 1e-3 * largest * np.abs(qp.lower[n + tensions :]).max())
    return QP(
        H=H,
        f=np.concatenate([qp.f, np.full(horizon, price)]),
        A=A,
        lower=np.concatenate([qp.lower[:n], np.zeros(horizon), qp.lower[n:]]),
        upper=np.concatenate([qp.upper[:n], np.full(horizon, np.inf), qp.upper[n:]]),
        start=qp.start,
    )
