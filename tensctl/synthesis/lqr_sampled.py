"""LQR of the sampled loop, whose rest lengths ramp to each command within a period.

    z = (x_k, u_k),   z_(k+1) = A z + B u_(k+1),   u_(k+1) = -K z

The cost is the integral of the continuous one over ramped periods, exactly. The loop that is designed is the loop that
runs: a command counts when the ramp reaches it, one period after the sample.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from jaxtyping import Complex, Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, Sampled, sample_ramped
from tensctl.scene.given import argument
from tensctl.scene.values import Number
from tensctl.synthesis.crossed import optimal, residual
from tensctl.synthesis.feedback import Measured, command
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.holding import Holding
from tensctl.synthesis.kalman import white_forces
from tensctl.synthesis.lagging import commands_now, lagging_basis, lagging_cost
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.over_period import integral, ramped_cost
from tensctl.synthesis.sampling_limit import refuse_short
from tensctl.synthesis.stabilisable import LeftOut, Part
from tensctl.synthesis.unseen import check_seen
from tensctl.synthesis.weights import Cost


@dataclass(frozen=True, eq=False)
class SampledLQR(Holding):
    """Sampled state feedback about an equilibrium; a controller with `step` and `reset`.

    Attributes
    ----------
    linear : LinearModel
        The flexible model that was controlled; where actuators lag its last states are rest lengths.
    cost : Cost
        Continuous weights.
    period_cost : Cost
        Their integral over a period, as weights on z and u_(k+1).
    sampled : Sampled
    K : (nu, nx + nu)
        u_(k+1) = -K (x_k, u_k), deviations from the equilibrium; u are commands, and the rest lengths without lag.
    P : (nx + nu, nx + nu)
        z'Pz is the cost to go.
    residual : float
        Riccati residual over the sum of its terms.
    basis : (nx + nu, nr)
        Orthonormal basis of the states z that the design is about.
    left : tuple of LeftOut
        Modes that are neither damped nor driven and were left out when that was asked for.
    """

    sees_inputs: ClassVar[bool] = True

    linear: LinearModel
    cost: Cost
    period_cost: Cost
    sampled: Sampled
    K: Float[np.ndarray, "nu n"]
    P: Float[np.ndarray, "n n"]
    residual: float
    basis: Float[np.ndarray, "n nr"]
    left: tuple[LeftOut, ...] = ()

    @property
    def dt(self) -> float:
        """Control period, s."""
        return self.sampled.dt

    @cached_property
    def multipliers(self) -> Complex[np.ndarray, " nr"]:
        """Closed-loop poles of the sampled loop, in the unit circle when it is stable."""
        A, B = self.sampled.with_input_state()
        return np.linalg.eigvals(self.basis.T @ (A - B @ self.K) @ self.basis).astype(complex)

    @property
    def poles(self) -> Complex[np.ndarray, " nr"]:
        """Continuous poles log(z)/dt that decay as fast, 1/s; minus infinity for what is gone after one period."""
        return continuous_poles(self.multipliers, self.dt)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max(initial=-np.inf))

    @cached_property
    def gain_doubt(self) -> float:
        """Estimated relative change of (R + B'PB)^1/2 K by the residual and by rounding of the data."""
        A, B = self.sampled.with_input_state()
        T, cost = self.basis, self.period_cost
        inside = Cost(T.T @ cost.Q @ T, cost.R, T.T @ cost.N)
        return gain_doubt(T.T @ A @ T, T.T @ B, inside, T.T @ self.P @ T, self.K @ T, sampled=True).relative

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """From what disturbs the commands to these, once a period: its margins are those of the commands."""
        A, B = self.sampled.with_input_state()
        T = self.basis
        return Sensitivity(T.T @ (A - B @ self.K) @ T, T.T @ B, -self.K @ T, self.dt)

    def expected_cost(self, force_noise: float | Mapping[str, float] = 0.1) -> float:
        """Cost of a period that white forces keep up, tr(P W_dt): the square of the sampled loop's H2 norm.

        Parameters
        ----------
        force_noise : N s^1/2
            Root of the intensity of white forces on the free nodes in each direction, as `lqg` takes it.

        Raises
        ------
        SynthesisError
            A negative intensity.
        """
        nx, nu = self.linear.B.shape
        x = self.basis[:nx, : self.basis.shape[1] - nu]
        W = x.T @ white_forces(self.linear, force_noise) @ x
        left = integral((x.T @ self.linear.A @ x).T, W, self.dt)[1]
        return float(np.trace(x.T @ self.P[:nx, :nx] @ x @ left))

    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        x = self.linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        change = commands_now(self.linear, measurement) - self.linear.equilibrium.inputs
        return command(self.linear, -self.K @ np.concatenate([x, change]))

    def verify(self, tol: float = 1e-9) -> None:
        """Check the Riccati residual and that every pole is stable.

        Raises
        ------
        SynthesisError
            With the number that fails.
        """
        A, B = self.sampled.with_input_state()
        T, cost = self.basis, self.period_cost
        inside = Cost(T.T @ cost.Q @ T, cost.R, T.T @ cost.N)
        left = residual(T.T @ A @ T, T.T @ B, inside, T.T @ self.P @ T, sampled=True)
        if not left <= tol:
            raise SynthesisError(f"the Riccati residual is {left:.1e}; at most {tol:.0e} is expected.")
        largest = np.abs(self.multipliers).max()
        if not largest < 1:
            raise SynthesisError(f"a pole of the sampled loop has size {largest:.6f}; < 1 is expected.")


def continuous_poles(multipliers: np.ndarray, dt: float) -> np.ndarray:
    """Poles log(z)/dt, 1/s."""
    with np.errstate(divide="ignore"):
        return np.log(multipliers.astype(complex)) / dt


def sampled_lqr(linear: LinearModel, cost: Cost, part: Part, dt: float) -> SampledLQR:
    """Design on the part of a flexible model that inputs can bring to rest."""
    dt = argument("dt", dt, Number("s", above=0))
    refuse_short(linear.scales, dt)
    x, nu = part.basis, linear.B.shape[1]
    check_seen(linear, x, x.T @ linear.A @ x, Cost(x.T @ cost.Q @ x, cost.R, x.T @ cost.N))
    plant, cost, x = linear.actuated, lagging_cost(linear, cost), lagging_basis(linear, x)
    sampled = sample_ramped(plant.A, plant.B, dt)
    period_cost = ramped_cost(plant.A, plant.B, cost, dt)
    T = np.block([[x, np.zeros((len(x), nu))], [np.zeros((nu, x.shape[1])), np.eye(nu)]])
    A, B = sampled.with_input_state()
    inside = Cost(T.T @ period_cost.Q @ T, period_cost.R, T.T @ period_cost.N)
    try:
        found = optimal(T.T @ A @ T, T.T @ B, inside, sampled=True)
    except SynthesisError as error:
        raise SynthesisError(f"{error} {_hint(linear, dt)}".strip()) from None
    return SampledLQR(plant, cost, period_cost, sampled, found.K @ T.T, T @ found.P @ T.T, found.residual, T, part.left)


def _hint(linear: LinearModel, dt: float) -> str:
    """What to try when a mode is too fast for the control period."""
    fastest = max(mode.frequency for mode in linear.modes)
    if fastest * dt < 0.5:
        return ""
    return (
        f"The fastest mode has {fastest:.4g} Hz, and a control period of {dt:g} s reaches {0.5 / dt:.4g} Hz: ramps "
        "hardly drive it; shorten dt, or give the tendons some damping."
    )
