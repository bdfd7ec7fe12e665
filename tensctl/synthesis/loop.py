"""The closed loop of a plant and an estimator, and what is computed from it alone.

    continuous  (z, xi)        z' = A z + B (u + d) + w,   y = C z + D (u + d) + v
    sampled     (z, p, u, xi)  z+ = F z + G0 p + G1 p+ + w,   p+ = u+ + d,   y+ = C z+ + D p+ + v

d is what disturbs the plant's inputs p and the estimator does not know of; p = u without it. Stability, margins and
noise are judged on these matrices, whatever design they come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.optimize as so
from jaxtyping import Complex, Inexact

from tensctl.synthesis.estimator import Estimator, Plant
from tensctl.synthesis.lyapunov import Lyapunov, lyapunov, ready
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.schur_lyapunov import LyapunovSolver
from tensctl.synthesis.weights import Cost


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed loop.

    Attributes
    ----------
    A : (n, n)
    disturbed : (n, nu)
        From d.
    pushed : (n, nz)
        From w.
    misread : (n, ny)
        From v.
    asked : (nu, n)
        u, or u_(k+1) when sampled, from the loop's state.
    shown : (nz + nu, n)
        (z, u) from the loop's state.
    dt : float or None, s
    """

    A: Inexact[np.ndarray, "n n"]
    disturbed: Inexact[np.ndarray, "n nu"]
    pushed: Inexact[np.ndarray, "n nz"]
    misread: Inexact[np.ndarray, "n ny"]
    asked: Inexact[np.ndarray, "nu n"]
    shown: Inexact[np.ndarray, "m n"]
    dt: float | None

    @cached_property
    def spectrum(self) -> Complex[np.ndarray, " n"]:
        """Eigenvalues of A."""
        return np.linalg.eigvals(self.A).astype(complex)

    @property
    def stability(self) -> float:
        """Largest real part, 1/s, or largest size less 1 when sampled; < 0 when the loop is stable."""
        sizes = np.real(self.spectrum) if self.dt is None else np.abs(self.spectrum) - 1
        return float(sizes.max())

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """From d to the plant's inputs."""
        return Sensitivity(self.A, self.disturbed, self.asked, self.dt)

    def noise(self, W: np.ndarray, V: np.ndarray) -> Lyapunov:
        """Covariance of the loop's state under process noise W and sensor noise V."""
        drive = self.pushed @ W @ self.pushed.conj().T + self.misread @ V @ self.misread.conj().T
        return lyapunov(self.A, drive, sampled=self.dt is not None, solver=self._ready)

    @cached_property
    def _ready(self) -> LyapunovSolver:
        return ready(self.A, sampled=self.dt is not None)

    def cost(self, covariance: np.ndarray, cost: Cost) -> float:
        """Expected cost rate (of a period when sampled, with weights on (z, u_k) and u_(k+1))."""
        rows = self.shown if self.dt is None else np.vstack([self.shown, self.asked])
        return float(np.real(np.trace(cost.matrix @ rows @ covariance @ rows.conj().T)))


def separation(plant: Plant, estimator: Estimator, loop: Loop, K: np.ndarray) -> tuple[float, float]:
    """Largest distance of a loop's poles to those of regulator and filter, and the largest of these, as pairs."""
    n = len(plant.A)
    if plant.sampled is None:
        regulated, extra = plant.A - plant.B @ K, 0
    else:
        A, B = plant.sampled.with_input_state()
        regulated, extra = A - B @ K, len(loop.A) - 2 * n - len(K)
    poles = np.concatenate([np.linalg.eigvals(regulated), np.linalg.eigvals(estimator.Phi), np.zeros(extra)])
    gaps = np.abs(loop.spectrum[:, None] - poles)
    return float(gaps[so.linear_sum_assignment(gaps)].max()), float(np.abs(poles).max())


def close(plant: Plant, estimator: Estimator) -> Loop:
    """Close the loop."""
    return _continuous(plant, estimator) if plant.sampled is None else _sampled(plant, estimator)


def _continuous(plant: Plant, e: Estimator) -> Loop:
    n, nu = plant.B.shape
    r, ny = e.order, len(plant.C)
    return Loop(
        A=np.block([[plant.A, -plant.B @ e.C], [e.seen @ plant.C, e.Phi - e.now @ e.C]]),
        disturbed=np.vstack([plant.B, e.seen @ plant.D]),
        pushed=np.vstack([np.eye(n), np.zeros((r, n))]),
        misread=np.vstack([np.zeros((n, ny)), e.seen]),
        asked=np.hstack([np.zeros((nu, n)), -e.C]),
        shown=np.block([[np.eye(n), np.zeros((n, r))], [np.zeros((nu, n)), -e.C]]),
        dt=None,
    )


def _sampled(plant: Plant, e: Estimator) -> Loop:
    s, (n, nu) = plant.sampled, plant.B.shape
    assert s is not None
    r, ny, eye = e.order, len(plant.C), np.eye(nu)
    before = np.hstack([s.F, s.G0, np.zeros((n, nu + r))])  # z+ but for what u+ does
    asked = np.hstack([np.zeros((nu, n + nu)), -e.direct, -e.C])
    moved = before + s.G1 @ asked
    known = np.hstack([np.zeros((r, n + nu)), e.before, e.Phi]) + e.now @ asked
    return Loop(
        A=np.vstack([moved, asked, asked, known + e.seen @ plant.C @ moved]),
        disturbed=np.vstack([s.G1, eye, 0 * eye, e.seen @ (plant.C @ s.G1 + plant.D)]),
        pushed=np.vstack([np.eye(n), np.zeros((2 * nu, n)), e.seen @ plant.C]),
        misread=np.vstack([np.zeros((n + 2 * nu, ny)), e.seen]),
        asked=asked,
        shown=np.hstack([np.eye(n + nu), np.zeros((n + nu, nu + r))]),
        dt=s.dt,
    )
