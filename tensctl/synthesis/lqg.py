"""LQG: a Kalman filter on noisy sensors and LQR on its estimate, judged on the loop that both close.

    u_(k+1) = -K (z_k, u_k),   z the estimate of the flexible states from lengths, tensions or positions

The poles of the loop are those of the regulator and of the filter together (separation); the loop's own spectrum, its
margins and its covariance are computed from its matrices and say so, or not. A reduced controller keeps the form of an
estimator, so saturated rest lengths do not mislead it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, sample_ramped
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Choice, Number
from tensctl.synthesis.checked import checked_cost
from tensctl.synthesis.crossed import Optimum, optimal
from tensctl.synthesis.estimating import Estimating
from tensctl.synthesis.estimator import Estimator, Plant, kalman_estimator
from tensctl.synthesis.feedback import command
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.kalman import Kalman, kalman, white_forces
from tensctl.synthesis.lagging import commands_now, lagging_basis, lagging_cost
from tensctl.synthesis.loop import Loop, close, separation
from tensctl.synthesis.lqr_sampled import continuous_poles
from tensctl.synthesis.lyapunov import Lyapunov
from tensctl.synthesis.margins import DiskMargin, Sensitivity
from tensctl.synthesis.over_period import integral, ramped_cost
from tensctl.synthesis.reduced import reduced
from tensctl.synthesis.sampling_limit import refuse_short
from tensctl.synthesis.sensors import Reading, Sensors
from tensctl.synthesis.shown import shown
from tensctl.synthesis.small_gain import SmallGain, small_gain
from tensctl.synthesis.stabilisable import LeftOut, controlled_part
from tensctl.synthesis.truncation import Truncated
from tensctl.synthesis.unseen import NOISE, check_seen
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class LQG(Estimating):
    """Output feedback about an equilibrium; a controller with `step` and `reset` when it was designed with a period.

    Attributes
    ----------
    linear : LinearModel
        The flexible model; where actuators lag its last states are rest lengths and its inputs commands.
    sensors : Sensors
        What it is shown.
    basis : (nx, n)
        Orthonormal basis of the states z that it is about; all of them unless some were left.
    left : tuple of LeftOut
        Modes that were left out when that was asked for.
    plant : Plant
        In coordinates z.
    cost, period_cost : Cost
        Weights on z and u; their integral over a ramped period (the same in continuous time).
    regulator : Optimum
    filter : Kalman
    estimator : Estimator
        As it runs.
    reduction : Truncated or None
        How its states were reduced.
    """

    linear: LinearModel
    sensors: Sensors
    basis: Float[np.ndarray, "nx n"]
    left: tuple[LeftOut, ...]
    plant: Plant
    cost: Cost
    period_cost: Cost
    regulator: Optimum
    filter: Kalman
    estimator: Estimator
    reduction: Truncated | None = None

    @property
    def dt(self) -> float | None:
        """Control period, s; None in continuous time."""
        return None if self.plant.sampled is None else self.plant.sampled.dt

    @property
    def order(self) -> int:
        """States of the controller."""
        return self.estimator.order

    @cached_property
    def loop(self) -> Loop:
        """The closed loop of the linear model and the controller."""
        return close(self.plant, self.estimator)

    @cached_property
    def poles(self) -> Complex[np.ndarray, " n"]:
        """Poles of the closed loop, 1/s; of a sampled one log(z)/dt, minus infinity for what is gone in a period."""
        spectrum = self.loop.spectrum
        return spectrum if self.dt is None else continuous_poles(spectrum, self.dt)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole, 1/s; negative when the loop is stable."""
        return float(np.real(self.poles).max())

    @cached_property
    def shake(self) -> float:
        """Largest standard deviation of a node's coordinate that the sensors' noise alone keeps up, m."""
        X = self.loop.noise(np.zeros_like(self.filter.W), self.filter.V).X
        n, C = len(self.plant.A), shown(self.linear, "nodes").C @ self.basis
        return float(np.sqrt(np.einsum("ij,jk,ik->i", C, X[:n, :n], C).max(initial=0.0)))

    @cached_property
    def separation(self) -> float | None:
        """Distance of the loop's poles to those of regulator and filter, over the largest; None of reduced order."""
        if self.reduction is not None:
            return None
        gap, size = separation(self.plant, self.estimator, self.loop, self.regulator.K)
        return gap / size

    @cached_property
    def regulator_doubt(self) -> float:
        """Estimated relative change of the regulator's gain K, as `LQR.gain_doubt` has it."""
        plant, found = self.plant, self.regulator
        data = (plant.A, plant.B) if plant.sampled is None else plant.sampled.with_input_state()
        sampled = plant.sampled is not None
        return gain_doubt(*data, self.period_cost, found.P, found.K, sampled=sampled).relative

    @property
    def gain_doubt(self) -> float:
        """The larger of `regulator_doubt` and `filter.gain_doubt`: how far the data leave the controller open."""
        return max(self.regulator_doubt, self.filter.gain_doubt)

    @cached_property
    def small_gain(self) -> SmallGain | None:
        """What the difference to the controller of full order proves; None of full order."""
        if self.reduction is None:
            return None
        return small_gain(self.plant, self.regulator.K, self.cost.R, self.estimator)

    @property
    def margins(self) -> tuple[DiskMargin, tuple[DiskMargin, ...]]:
        """Enclosed disk margins at the plant's inputs: of all at once, and of each alone."""
        return self.sensitivity.all_inputs, self.sensitivity.each_input

    @property
    def sensitivity(self) -> Sensitivity:
        """From what disturbs the plant's inputs to these."""
        return self.loop.sensitivity

    @cached_property
    def covariance(self) -> Lyapunov:
        """Covariance of the loop's state under the noise that it was designed for."""
        return self.loop.noise(self.filter.W, self.filter.V)

    @property
    def covariance_residual(self) -> float:
        """What the covariance leaves of its equation, over the sum of the terms."""
        return self.covariance.residual

    @property
    def expected_cost(self) -> float:
        """Cost rate (cost of a period when sampled) that noise keeps up: the square of the loop's H2 norm."""
        return self.loop.cost(self.covariance.X, self.period_cost)

    def __str__(self) -> str:
        """Its order, the slowest pole and, of a reduced one, what the reduction proves."""
        size = f"{self.order} states" if self.reduction is None else f"{self.order} of {len(self.plant.A)} states"
        ends = f"{len(self.plant.B.T)} inputs, {len(self.plant.C)} sensors"
        said = f"LQG, {ends}, {size}; slowest pole {self.slowest:.3g} 1/s"
        return said if self.small_gain is None else f"{said}; {self.small_gain}"

    def _answer(
        self, reading: Reading, last: dict[str, np.ndarray]
    ) -> tuple[Float[np.ndarray, " nu"], dict[str, np.ndarray]]:
        e, rest = self.estimator, self.linear.equilibrium
        u = commands_now(self.linear, reading) - rest.inputs
        estimate = e.seen @ (reading.values - self.sensors.of(rest) - self.plant.D @ u)
        if "estimate" in last:
            estimate = estimate + e.Phi @ last["estimate"] + e.before @ last["inputs"] + e.now @ u
        return command(self.linear, -(e.C @ estimate + e.direct @ u)), {"estimate": estimate, "inputs": u}

    def verify(self, tol: float = 1e-9) -> None:
        """Check both Riccati residuals, the loop's stability, separation and the covariance.

        Raises
        ------
        SynthesisError
            With the number that fails.
        """
        for name, left in (
            ("regulator's Riccati residual", self.regulator.residual),
            ("filter's Riccati residual", self.filter.residual),
            ("covariance's residual", self.covariance_residual),
        ):
            if not left <= tol:
                raise SynthesisError(f"the {name} is {left:.1e}; at most {tol:.0e} is expected.")
        if not self.loop.stability < 0:
            raise SynthesisError(
                f"the closed loop is not stable: its slowest pole misses by {self.loop.stability:.1e}."
            )
        # Poles that nearly coincide move by the root of rounding.
        if self.separation is not None and not self.separation <= np.sqrt(tol):
            raise SynthesisError(f"the loop's poles miss those of regulator and filter by {self.separation:.1e}.")


@one_blas_thread()
def lqg(
    linear: LinearModel,
    sensors: Sensors,
    *,
    cost: Cost | None = None,
    force_noise: float | Mapping[str, float] = 0.1,
    dt: float | None = None,
    order: int | None = None,
    stabilisable_only: bool = False,
) -> LQG:
    """Design output feedback on the flexible modes of a linear model.

    Parameters
    ----------
    linear : LinearModel
    sensors : Sensors
        From `sensors(structure, lengths=..., ...)`; their noise is that of each sample, or without `dt` the root of
        its intensity (m s^1/2, N s^1/2).
    cost : Cost, optional
        From `weights`; energies by default.
    force_noise : N s^1/2
        Root of the intensity of white forces on the free nodes in each direction; a number, or a table by node pattern.
        After t seconds the momentum that such a force left has the standard deviation force_noise t^1/2.
    dt : float, s, optional
        Control period; without it the continuous problem, which can be judged but not run.
    order : int, optional
        States of the controller; its loop is verified to be stable.
    stabilisable_only : bool
        Leave out modes that are not damped and not driven or not seen, and list them in `left`.

    Raises
    ------
    SynthesisError
        A mode out of reach, noise or weights that leave no solution, or an order whose loop is not stable.
    """
    check_kind(LinearModel, linear=linear)
    check_kind(Sensors, sensors=sensors)
    flexible = linear.flexible
    if sensors.structure is not flexible.dynamics.structure:
        raise SynthesisError("the sensors belong to another structure; make them for linear.dynamics.structure.")
    if dt is not None:
        period = dt = argument("dt", dt, Number("s", above=0))
        refuse_short(flexible.scales, period)
    stabilisable_only = argument("stabilisable_only", stabilisable_only, Choice(True, False))
    cost = checked_cost(flexible, None, None, None, cost)
    part = controlled_part(flexible, sensors.rows(flexible)[0], only=stabilisable_only)
    W = part.basis.T @ white_forces(flexible, force_noise) @ part.basis
    driven, cost, T = flexible.actuated, lagging_cost(flexible, cost), lagging_basis(flexible, part.basis)
    C, D = sensors.rows(driven)
    inside = Cost(T.T @ cost.Q @ T, cost.R, T.T @ cost.N)
    plant = _plant(T.T @ driven.A @ T, T.T @ driven.B, C @ T, D, dt)
    _check_seen(flexible, part.basis, plant, inside, W)
    W = np.pad(W, (0, T.shape[1] - len(W)))  # no noise on rest lengths
    return _design(driven, sensors, part.left, T, plant, inside, W, order)


def _check_seen(linear: LinearModel, T: np.ndarray, plant: Plant, cost: Cost, W: np.ndarray) -> None:
    """Refuse undamped modes of the mechanics that the weights do not see or the noise does not drive."""
    n, lags = T.shape[1], len(plant.A) > T.shape[1]  # where actuators lag, rest lengths are the last states
    A, B = plant.A[:n, :n], plant.A[:n, n:] if lags else plant.B
    mechanical = Cost(cost.Q[:n, :n], cost.R, cost.Q[:n, n:] if lags else cost.N)
    check_seen(linear, T, A, mechanical, B if plant.sampled is None else None)
    check_seen(linear, T, A.T, Cost(W, np.zeros((0, 0)), np.zeros((len(W), 0))), sentence=NOISE)


def _plant(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float | None) -> Plant:
    return Plant(A, B, C, D, None if dt is None else sample_ramped(A, B, dt))


def _design(linear, sensors, left, T, plant: Plant, cost: Cost, W: np.ndarray, order: int | None) -> LQG:
    V = np.diag(sensors.noise**2)
    if plant.sampled is None:
        regulator = optimal(plant.A, plant.B, cost)
        found, period_cost = kalman(plant.A, plant.C, W, V), cost
    else:
        dt = plant.sampled.dt
        period_cost = ramped_cost(plant.A, plant.B, cost, dt)
        regulator = optimal(*plant.sampled.with_input_state(), period_cost, sampled=True)
        found = kalman(plant.sampled.F, plant.C, integral(plant.A.T, W, dt)[1], V, sampled=True)
    estimator, reduction = kalman_estimator(plant, found.gain, regulator.K), None
    if order is not None:
        estimator, reduction = reduced(plant, estimator, regulator.K, cost.R, order)
    return LQG(linear, sensors, T, left, plant, cost, period_cost, regulator, found, estimator, reduction)
