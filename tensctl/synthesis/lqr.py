"""LQR on the flexible subspace, with its certificate.

    minimise  int x'Q x + u'R u dt,   u = -R^-1 B'X x,   A'X + XA - X B R^-1 B'X + Q = 0

In energy coordinates Q = I weighs twice the energy, and R = diag(k) weighs rest-length changes by the energy that they
would store: both in J.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from jaxtyping import Complex, Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, sample_ramped
from tensctl.synthesis.condensed import input_stiffness
from tensctl.synthesis.riccati import care

# First sample time tried: this part of a radian of the fastest mode.
_SAMPLES = 0.2
# A weight that is skew or negative by less than this part of itself is so by rounding.
_SKEW = 1e-12


class Measured(Protocol):
    """What a controller is shown at a sample."""

    @property
    def nodes(self) -> np.ndarray:
        """Node positions, (N, 3) m."""
        ...

    @property
    def velocities(self) -> np.ndarray:
        """Node velocities, (N, 3) m/s."""
        ...

    @property
    def inputs(self) -> np.ndarray:
        """Rest-length changes as they are now, (nu,) m."""
        ...


@dataclass(frozen=True, eq=False)
class LQR:
    """State feedback about an equilibrium; a controller with `step` and `reset`.

    Attributes
    ----------
    linear : LinearModel
        The flexible model that was controlled.
    Q, R : weights
    K : (nu, nx)
    P : (nx, nx)
        Riccati solution; x'Px is the cost to go.
    residual : float
        Riccati residual over the sum of its terms.
    dt : float, s
        Sample time at which the sampled loop is still stable.
    """

    linear: LinearModel
    Q: Float[np.ndarray, "nx nx"]
    R: Float[np.ndarray, "nu nu"]
    K: Float[np.ndarray, "nu nx"]
    P: Float[np.ndarray, "nx nx"]
    residual: float
    dt: float = field(default=0.0)

    @property
    def A(self) -> np.ndarray:
        """State matrix of the controlled model."""
        return self.linear.A

    @property
    def B(self) -> np.ndarray:
        """Input matrix of the controlled model."""
        return self.linear.B

    @cached_property
    def poles(self) -> Complex[np.ndarray, " nx"]:
        """Closed-loop poles, 1/s."""
        return np.linalg.eigvals(self.A - self.B @ self.K).astype(complex)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max(initial=-np.inf))

    def reset(self) -> None:
        """Nothing to forget."""

    def state(self) -> dict[str, np.ndarray]:
        """Nothing is remembered from step to step, so runs under it can be stored and resumed."""
        return {}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Nothing to remember."""

    def step(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0, m, kept above the rest-length floors."""
        members, equilibrium = self.linear.dynamics.members, self.linear.equilibrium
        u = equilibrium.inputs - self.K @ self.linear.state_of(measurement.nodes, measurement.velocities)
        return np.minimum(u, (members.rest_lengths - members.floors)[members.inputs])

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and that every pole is stable.

        Raises
        ------
        SynthesisError
            With the number that fails.
        """
        X, weighted = self.P, np.linalg.solve(self.R, self.B.T)
        terms = (self.A.T @ X, X @ self.A, -X @ self.B @ weighted @ X, self.Q)
        left = np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms)
        if not left <= tol:
            raise SynthesisError(f"the Riccati residual is {left:.1e}; at most {tol:.0e} is expected.")
        if not self.slowest < 0:
            raise SynthesisError(f"a closed-loop pole has real part {self.slowest:.2e}; < 0 is expected.")


def lqr(linear: LinearModel, Q: np.ndarray | None = None, R: np.ndarray | None = None) -> LQR:
    """Design state feedback on the flexible modes of a linear model.

    Parameters
    ----------
    linear : LinearModel
        Rigid-body modes are left out: no tendon drives them.
    Q : (nx, nx), optional
        State weight on `linear.flexible`; identity (twice the energy) by default.
    R : (nu, nu), optional
        Input weight, positive definite; diag(stiffness) by default.

    Raises
    ------
    SynthesisError
        A weight of the wrong shape, no input, or a mode that is neither damped nor driven.
    """
    flexible = linear.flexible
    nx, nu = flexible.B.shape
    if nx == 0 or nu == 0:
        raise SynthesisError(f"the model has {nx} flexible states and {nu} inputs; at least one of each is needed.")
    Q = np.eye(nx) if Q is None else np.asarray(Q, float)
    R = np.diag(input_stiffness(flexible)) if R is None else np.asarray(R, float)
    _check_weight("Q", Q, nx, positive=False)
    _check_weight("R", R, nu, positive=True)
    solution = care(flexible.A, flexible.B, Q, R)
    return LQR(flexible, Q, R, solution.K, solution.X, solution.residual, _sample_time(flexible, solution.K))


def _check_weight(name: str, weight: np.ndarray, size: int, *, positive: bool) -> None:
    if weight.shape != (size, size):
        raise SynthesisError(f"{name} has shape {weight.shape}; ({size}, {size}) is expected.")
    scale = np.abs(weight).max(initial=0.0)
    if not np.isfinite(scale):
        raise SynthesisError(f"{name} has entries that are no finite numbers.")
    if np.abs(weight - weight.T).max(initial=0.0) > _SKEW * scale:
        raise SynthesisError(f"{name} is not symmetric; give ({name} + {name}')/2.")
    smallest = np.linalg.eigvalsh(weight).min(initial=np.inf)
    if positive and smallest <= 0:
        raise SynthesisError(
            f"{name} is not positive definite; every input needs a cost, because one direction of u "
            "changes the prestress only."
        )
    if smallest < -_SKEW * scale * size:
        raise SynthesisError(f"{name} has the eigenvalue {smallest:.3g}; weights are never negative.")


def _sample_time(linear: LinearModel, K: np.ndarray) -> float:
    """Longest tried period at which the sampled, ramped loop is stable: commands arrive one period late."""
    dt = _SAMPLES / max(np.sqrt(max(mode.omega2, 0.0)) for mode in linear.modes)
    for _ in range(12):
        A, B = sample_ramped(linear.A, linear.B, dt).with_input_state()
        loop = A - B @ np.hstack([K, np.zeros((len(K), len(K)))])
        if np.abs(np.linalg.eigvals(loop)).max() < 1:
            return float(dt)
        dt /= 2
    raise SynthesisError(f"the sampled loop is unstable even at a sample time of {dt:.1e} s; raise the input weight.")
