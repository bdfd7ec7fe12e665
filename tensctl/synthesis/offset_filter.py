"""A Kalman filter that goes on where measurements are missing, and refuses absurd ones.

    predict  z = F z + G_0 u_(k-1) + G_1 u_k,   P = F P F' + W
    update   with the rows that are there:   L = P H'(H P H' + V)^-1,   z = z + L (y - D u - H z),   P = (1 - L H) P

z = (x, d). While every sensor speaks, P stays the solution of the Riccati equation and L is constant; a row that is
left out lets P grow as it should, and P is propagated until it is back. The update of P is Joseph's: positive always.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float

from tensctl.synthesis.disturbance import Disturbed
from tensctl.synthesis.kalman import Kalman, kalman, white_forces
from tensctl.synthesis.over_period import integral

# An innovation beyond this many deviations, and as many times the median sensor's, is absurd: pushes and starts far
# from rest move many sensors at once.
ABSURD = 50.0
# A sensor that says the same absurd thing for longer is believed: then the structure has changed, or the sensor has.
PATIENCE = 5
# P is back at its constant value when no entry is off by more than this part of the deviations that it belongs to.
BACK = 1e-6


@dataclass(frozen=True, eq=False)
class Estimate:
    """What the filter believes after a sample.

    Attributes
    ----------
    mean : (n,)
        States x, then disturbances d.
    covariance : (n, n) or None
        Of its error before the sample that comes next; None while it is the constant one.
    absurd : (ny,) int
        For how many samples on end each sensor was refused.
    missing, rejected : int
        Values not there, and refused, so far.
    """

    mean: Float[np.ndarray, " n"]
    covariance: Float[np.ndarray, "n n"] | None
    absurd: np.ndarray
    missing: int = 0
    rejected: int = 0


@dataclass(frozen=True, eq=False)
class OffsetFilter:
    """The filter of a model with disturbances.

    Attributes
    ----------
    model : Disturbed
    W : (n, n)
        What noise adds to the covariance in a period: white forces on the nodes, steps of the disturbances.
    """

    model: Disturbed
    W: Float[np.ndarray, "n n"]

    @cached_property
    def V(self) -> Float[np.ndarray, "ny ny"]:
        """Covariance of the sensors' noise."""
        return np.diag(self.model.sensors.noise**2)

    @cached_property
    def constant(self) -> Kalman:
        """The filter when every sensor speaks at every sample."""
        # Rows in units of their noise: V becomes the identity.
        noise = self.model.sensors.noise
        F, H = self.model.F, self.model.H
        found = kalman(F, H / noise[:, None], self.W, np.eye(noise.size), sampled=True)
        return Kalman(F, H, self.W, self.V, found.X, found.gain / noise, found.residual, sampled=True)

    @cached_property
    def deviations(self) -> Float[np.ndarray, " ny"]:
        """Standard deviation of each innovation of the constant filter."""
        H = self.model.H
        return np.sqrt(np.einsum("ij,jk,ik->i", H, self.constant.X, H) + self.model.sensors.noise**2)

    def begin(self) -> Estimate:
        """At rest, undisturbed, before the first sample."""
        return Estimate(np.zeros(len(self.W)), None, np.zeros(self.model.sensors.noise.size, int))

    def predict(self, before: Estimate, u0: Float[np.ndarray, " nu"], u1: Float[np.ndarray, " nu"]) -> np.ndarray:
        """Mean a period later, inputs ramping from u0 to u1 (deviations from rest)."""
        s, mean = self.model.sampled, self.model.F @ before.mean
        mean[: len(s.F)] += s.G0 @ u0 + s.G1 @ u1
        return mean

    def update(self, before: Estimate, mean: Float[np.ndarray, " n"], y: np.ndarray, u: np.ndarray) -> Estimate:
        """Take a sample (deviations from rest) into the predicted mean; NaN and infinite values are missing."""
        there = np.isfinite(y)
        innovation = np.where(there, y - self.model.D @ u - self.model.H @ mean, 0.0)
        refused = self._refused(before, innovation, there)
        used = there & ~refused
        absurd = np.where(refused, before.absurd + 1, np.where(there, 0, before.absurd))
        counts = before.missing + int((~there).sum()), before.rejected + int(refused.sum())
        if before.covariance is None and used.all():
            return Estimate(mean + self.constant.gain @ innovation, None, absurd, *counts)
        P = self.constant.X if before.covariance is None else before.covariance
        gain, after = joseph(P, self.model.H[used], self.model.sensors.noise[used])
        ahead = self.model.F @ after @ self.model.F.T + self.W
        return Estimate(mean + gain @ innovation[used], self._unless_back(0.5 * (ahead + ahead.T)), absurd, *counts)

    def _refused(self, before: Estimate, innovation: np.ndarray, there: Bool[np.ndarray, " ny"]) -> np.ndarray:
        H, deviations = self.model.H, self.deviations
        if before.covariance is not None:
            deviations = np.sqrt(np.einsum("ij,ij->i", H @ before.covariance, H) + self.model.sensors.noise**2)
        size = np.abs(innovation) / deviations
        usual = max(1.0, float(np.median(size[there]))) if there.any() else 1.0
        return there & (size > ABSURD * usual) & (before.absurd < PATIENCE)

    def _unless_back(self, P: np.ndarray) -> np.ndarray | None:
        wanted = self.constant.X
        scale = np.sqrt(np.diag(wanted))
        return (
            None
            if np.abs(P - wanted).max(initial=0.0) <= BACK * (scale.max() ** 2)
            and (np.abs(np.diag(P) - scale**2) <= BACK * scale**2).all()
            else P
        )


def joseph(P: np.ndarray, H: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gain of a sample, and the covariance after it."""
    across = P @ H.T
    gain = np.linalg.solve(H @ across + np.diag(noise**2), across.T).T
    keep = np.eye(len(P)) - gain @ H
    return gain, keep @ P @ keep.T + (gain * noise**2) @ gain.T


def offset_filter(model: Disturbed, force_noise: float, drift: float) -> OffsetFilter:
    """The filter for white forces on the nodes, N s^1/2, and disturbances that wander by `drift` deviations in 1 s."""
    dt, nx = model.sampled.dt, len(model.sampled.F)
    W = np.zeros((len(model.F), len(model.F)))
    W[:nx, :nx] = integral(model.linear.A.T, white_forces(model.linear, force_noise), dt)[1]
    W[nx:, nx:] = drift**2 * dt * np.eye(model.shown.shape[1])
    return OffsetFilter(model, W)
