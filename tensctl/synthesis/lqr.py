"""LQR on the flexible subspace, with its certificate.

    minimise  int x'Q x + 2 x'N u + u'R u dt,   u = -K x,   K = R^-1 (B'P + N'),
    A'P + PA - (PB + N) R^-1 (B'P + N') + Q = 0

In energy coordinates Q = I weighs twice the energy, and R = diag(k) weighs rest-length changes by the energy that they
would store: both in J. A mode that is neither damped nor driven is refused by name, or left out by name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import overload

import numpy as np
from jaxtyping import Complex, Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, sample_ramped
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Choice
from tensctl.synthesis.checked import checked_cost
from tensctl.synthesis.crossed import optimal, residual
from tensctl.synthesis.feedback import Measured, command
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.holding import Holding
from tensctl.synthesis.kalman import white_forces
from tensctl.synthesis.lagging import lagging_basis, lagging_cost
from tensctl.synthesis.lqr_sampled import SampledLQR, sampled_lqr
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.stabilisable import LeftOut, stabilisable
from tensctl.synthesis.unseen import check_seen
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

# First sample time tried: this part of a radian of the fastest mode.
_SAMPLES = 0.2


@dataclass(frozen=True, eq=False)
class LQR(Holding):
    """State feedback about an equilibrium; a controller with `step` and `reset`.

    Attributes
    ----------
    linear : LinearModel
        The flexible model that was controlled; where actuators lag its last states are rest lengths.
    Q, R, N : weights
        On its states and inputs.
    K : (nu, nx)
    P : (nx, nx)
        Riccati solution; x'Px is the cost to go.
    residual : float
        Riccati residual over the sum of its terms.
    dt : float, s
        Sample time at which the sampled loop is still stable.
    basis : (nx, nr)
        Orthonormal basis of the states that the design is about; all of them unless some were left.
    left : tuple of LeftOut
        Modes that are neither damped nor driven and were left out when that was asked for.
    """

    linear: LinearModel
    Q: Float[np.ndarray, "nx nx"]
    R: Float[np.ndarray, "nu nu"]
    N: Float[np.ndarray, "nx nu"]
    K: Float[np.ndarray, "nu nx"]
    P: Float[np.ndarray, "nx nx"]
    residual: float
    basis: Float[np.ndarray, "nx nr"]
    left: tuple[LeftOut, ...] = ()
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
    def poles(self) -> Complex[np.ndarray, " nr"]:
        """Closed-loop poles, 1/s, of the states that the design is about."""
        return np.linalg.eigvals(self.basis.T @ (self.A - self.B @ self.K) @ self.basis).astype(complex)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max(initial=-np.inf))

    @cached_property
    def gain_doubt(self) -> float:
        """Estimated relative change of R^1/2 K by the residual and by rounding of the data."""
        T = self.basis
        cost = Cost(T.T @ self.Q @ T, self.R, T.T @ self.N)
        return gain_doubt(T.T @ self.A @ T, T.T @ self.B, cost, T.T @ self.P @ T, self.K @ T).relative

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """From what disturbs the plant's inputs to these, in continuous time."""
        T = self.basis
        return Sensitivity(T.T @ (self.A - self.B @ self.K) @ T, T.T @ self.B, -self.K @ T, None)

    def expected_cost(self, force_noise: float | Mapping[str, float] = 0.1) -> float:
        """Cost rate that white forces keep up, tr(P W): the square of the loop's H2 norm.

        Parameters
        ----------
        force_noise : N s^1/2
            Root of the intensity of white forces on the free nodes in each direction, as `lqg` takes it.

        Raises
        ------
        SynthesisError
            A negative intensity.
        """
        return float(np.trace(self.P @ white_forces(self.linear, force_noise)))

    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        x = self.linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        return command(self.linear, -self.K @ x)

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and that every pole is stable.

        Raises
        ------
        SynthesisError
            With the number that fails.
        """
        T = self.basis
        cost = Cost(T.T @ self.Q @ T, self.R, T.T @ self.N)
        left = residual(T.T @ self.A @ T, T.T @ self.B, cost, T.T @ self.P @ T, sampled=False)
        if not left <= tol:
            raise SynthesisError(f"the Riccati residual is {left:.1e}; at most {tol:.0e} is expected.")
        if not self.slowest < 0:
            raise SynthesisError(f"a closed-loop pole has real part {self.slowest:.2e}; < 0 is expected.")


@overload
def lqr(
    linear: LinearModel, Q: np.ndarray | None = None, R: np.ndarray | None = None, N: np.ndarray | None = None, *,
    cost: Cost | None = None, dt: None = None, stabilisable_only: bool = False,
) -> LQR: ...  # fmt: skip
@overload
def lqr(
    linear: LinearModel, Q: np.ndarray | None = None, R: np.ndarray | None = None, N: np.ndarray | None = None, *,
    cost: Cost | None = None, dt: float, stabilisable_only: bool = False,
) -> SampledLQR: ...  # fmt: skip
@one_blas_thread()
def lqr(
    linear: LinearModel,
    Q: np.ndarray | None = None,
    R: np.ndarray | None = None,
    N: np.ndarray | None = None,
    *,
    cost: Cost | None = None,
    dt: float | None = None,
    stabilisable_only: bool = False,
) -> LQR | SampledLQR:
    """Design state feedback on the flexible modes of a linear model.

    Parameters
    ----------
    linear : LinearModel
        Rigid-body modes are left out: no tendon drives them.
    Q : (nx, nx), optional
        State weight on `linear.flexible`; identity (twice the energy) by default.
    R : (nu, nu), optional
        Input weight, positive definite; diag(stiffness) by default.
    N : (nx, nu), optional
        Cross weight, 2 x'N u; none by default.
    cost : Cost, optional
        The three of them in physical terms, from `weights`.
    dt : float, s, optional
        Control period. With it the sampled loop is designed, whose rest lengths ramp within each period and reach the
        command one period later; without it the continuous one.
    stabilisable_only : bool
        Leave out modes that are neither damped nor driven, and list them in `left`, instead of refusing them.

    Raises
    ------
    SynthesisError
        A weight of the wrong shape, no input, or a mode that is not damped and not driven, or not seen by the weights.
    """
    check_kind(LinearModel, linear=linear)
    stabilisable_only = argument("stabilisable_only", stabilisable_only, Choice(True, False))
    flexible = linear.flexible
    cost = checked_cost(flexible, Q, R, N, cost)
    part = stabilisable(flexible, only=stabilisable_only)
    if dt is not None:
        return sampled_lqr(flexible, cost, part, dt)
    T = part.basis
    if not T.shape[1]:
        raise SynthesisError(f"nothing is left to control: {part.left[0]}.")
    inside = Cost(T.T @ cost.Q @ T, cost.R, T.T @ cost.N)
    check_seen(flexible, T, T.T @ flexible.A @ T, inside, T.T @ flexible.B)
    plant, cost, T = flexible.actuated, lagging_cost(flexible, cost), lagging_basis(flexible, T)
    found = optimal(T.T @ plant.A @ T, T.T @ plant.B, Cost(T.T @ cost.Q @ T, cost.R, T.T @ cost.N))
    K = found.K @ T.T
    period = _sample_time(plant, K, T)
    return LQR(plant, cost.Q, cost.R, cost.N, K, T @ found.P @ T.T, found.residual, T, part.left, period)


def _sample_time(linear: LinearModel, K: np.ndarray, T: np.ndarray) -> float:
    """Longest tried period at which the sampled, ramped loop is stable: commands arrive one period late."""
    dt = _SAMPLES / max(np.sqrt(max(mode.omega2, 0.0)) for mode in linear.modes)
    nu = len(K)
    for _ in range(12):
        A, B = sample_ramped(T.T @ linear.A @ T, T.T @ linear.B, dt).with_input_state()
        loop = A - B @ np.hstack([K @ T, np.zeros((nu, nu))])
        if np.abs(np.linalg.eigvals(loop)).max() < 1:
            return float(dt)
        dt /= 2
    raise SynthesisError(f"the sampled loop is unstable even at a sample time of {dt:.1e} s; raise the input weight.")
