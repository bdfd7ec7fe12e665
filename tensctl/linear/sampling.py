"""Exact sampling of a linear model whose inputs ramp within each period.

Rest lengths move from u_k to u_(k+1) along a straight line, so

    x_(k+1) = F x_k + G0 u_k + G1 u_(k+1),   exp(dt [A B 0; 0 0 I/dt; 0 0 0]) = [F  G0+G1  G1; ...]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Inexact


@dataclass(frozen=True, eq=False)
class Sampled:
    """Discrete model with ramped inputs.

    Attributes
    ----------
    F : (nx, nx)
    G0, G1 : (nx, nu)
        Effect of the input at the start and at the end of a period.
    dt : float, s
    """

    F: Inexact[np.ndarray, "nx nx"]
    G0: Inexact[np.ndarray, "nx nu"]
    G1: Inexact[np.ndarray, "nx nu"]
    dt: float

    def with_input_state(self) -> tuple[np.ndarray, np.ndarray]:
        """(A, B) of the state (x, u_k) with input u_(k+1)."""
        nx, nu = self.G0.shape
        A = np.block([[self.F, self.G0], [np.zeros((nu, nx)), np.zeros((nu, nu))]])
        return A, np.vstack([self.G1, np.eye(nu)])


def sample_ramped(A: np.ndarray, B: np.ndarray, dt: float) -> Sampled:
    """Sample dx/dt = A x + B u with period dt, exactly for inputs that ramp."""
    nx, nu = B.shape
    block = np.zeros((nx + 2 * nu, nx + 2 * nu), np.result_type(A, B, float))
    block[:nx, :nx], block[:nx, nx : nx + nu] = A * dt, B * dt
    block[nx : nx + nu, nx + nu :] = np.eye(nu)
    transition = sla.expm(block)
    ramp = transition[:nx, nx + nu :]
    return Sampled(transition[:nx, :nx], transition[:nx, nx : nx + nu] - ramp, ramp, dt)
