"""Estimators as they run, of full or reduced order.

    continuous  xi' = Phi xi + G_y (y - D u) + G_u u,                                         u = -C xi
    sampled     xi_k = Phi xi_(k-1) + G_y (y_k - D u_k) + G_0 u_(k-1) + G_u u_k,   u_(k+1) = -(C xi_k + C_u u_k)

A Kalman filter has Phi = A - L C, or (I - M C) F, and C = K: Phi is stable by itself. The rest lengths u are those that
the actuators have, so a saturated command does not mislead the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Inexact

from tensctl.linear import Sampled


@dataclass(frozen=True, eq=False)
class Plant:
    """The part of a flexible model that a controller is about, in coordinates z = basis' x.

    Attributes
    ----------
    A, B, C, D : matrices
    sampled : Sampled or None
        With ramped inputs, when there is a control period.
    """

    A: Inexact[np.ndarray, "n n"]
    B: Inexact[np.ndarray, "n nu"]
    C: Inexact[np.ndarray, "ny n"]
    D: Inexact[np.ndarray, "ny nu"]
    sampled: Sampled | None


@dataclass(frozen=True, eq=False)
class Estimator:
    """Matrices of the equations above; `before` (G_0) and `direct` (C_u) belong to sampled estimators.

    Attributes
    ----------
    Phi : (r, r)
    seen, now, before : (r, ny), (r, nu), (r, nu)
        G_y, G_u and G_0.
    C : (nu, r)
    direct : (nu, nu)
    """

    Phi: Inexact[np.ndarray, "r r"]
    seen: Inexact[np.ndarray, "r ny"]
    now: Inexact[np.ndarray, "r nu"]
    before: Inexact[np.ndarray, "r nu"]
    C: Inexact[np.ndarray, "nu r"]
    direct: Inexact[np.ndarray, "nu nu"]

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.Phi)

    @property
    def drive(self) -> Inexact[np.ndarray, "r m"]:
        """All that drives it: (G_y, G_0, G_u)."""
        return np.hstack([self.seen, self.before, self.now])


def kalman_estimator(plant: Plant, gain: Inexact[np.ndarray, "n ny"], K: np.ndarray) -> Estimator:
    """The estimator of a filter gain, with feedback u = -K z of its state (and of u_k when sampled)."""
    n, nu = plant.B.shape
    if plant.sampled is None:
        return Estimator(plant.A - gain @ plant.C, gain, plant.B, np.zeros((n, nu)), K, np.zeros((nu, nu)))
    keep, s = np.eye(n) - gain @ plant.C, plant.sampled
    return Estimator(keep @ s.F, gain, keep @ s.G1, keep @ s.G0, K[:, :n], K[:, n:])
