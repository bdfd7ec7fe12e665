"""The QP of one step of nonlinear MPC: the cost and the limits, linearised where a plan leads.

With v the inputs' deviation from the reference over the horizon, v* that of the plan, and e(v) the state's deviation
from the reference in energy coordinates, as the nonlinear structure answers,

    cost    sum e_k'Q e_k + v_k'R v_k + (e, v)_N' P (e, v)_N,    e_k(v) = e_k(v*) + S_k (v - v*)        (Gauss-Newton)
    hard    lower <= v <= upper,  |change of the total input| <= rate_max dt
    soft    force_max >= T >= tension_min,  T over the stiffness = stretch_k(v*) + s_k (v - v*),  at the ends of periods

Where actuators lag, v are commands and the last of e are rest lengths, as the linear controller has them.

A tendon that is slack where the plan leads keeps its row: its stretch is negative there, and s_k says how it gets taut.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.linear import LinearModel, sample_ramped
from tensctl.linear.state_slopes import states_and_slopes
from tensctl.synthesis.condensed import stage_weights, terminal_weight
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.qp import QP
from tensctl.synthesis.rollout import Rollout


@dataclass(frozen=True, eq=False)
class Measure:
    """What a deviation costs near one planned equilibrium.

    Attributes
    ----------
    linear : LinearModel
        The flexible model there: its energy coordinates measure the state.
    Q, R : weights of a stage
    P : (nx + nu, nx + nu)
        Solution of the discrete Riccati equation of the linear model: cost beyond the horizon. Where actuators lag,
        here and in Q the states include rest lengths.
    riccati_residual : float
    """

    linear: LinearModel
    Q: Float[np.ndarray, "n n"]
    R: Float[np.ndarray, "nu nu"]
    P: Float[np.ndarray, "n n"]
    riccati_residual: float

    @classmethod
    def of(cls, linear: LinearModel, dt: float, weights: Weights) -> Measure:
        """The measure at a linear model's equilibrium."""
        driven = linear.actuated
        A, B = sample_ramped(driven.A, driven.B, dt).with_input_state()
        Q, R = stage_weights(driven, dt, weights)
        terminal = terminal_weight(A, B, Q, R, weights)
        return cls(linear, Q, R, terminal.X, terminal.residual)


@dataclass(frozen=True, eq=False)
class Bounds:
    """Limits of the inputs' deviations, and those of tensions over the stiffness.

    Attributes
    ----------
    lower, upper : (N, nu) m
    change_lower, change_upper : (N, nu) m
        Of v_k - v_(k-1), in the first period of v_0.
    tendons : (nT,) int
        Whose tension each row bounds.
    side : (nT,)
        1 for floors, -1 for stall limits, which are turned about.
    limit : (nT,) m
    """

    lower: Float[np.ndarray, "N nu"]
    upper: Float[np.ndarray, "N nu"]
    change_lower: Float[np.ndarray, "N nu"]
    change_upper: Float[np.ndarray, "N nu"]
    tendons: np.ndarray
    side: Float[np.ndarray, " nT"]
    limit: Float[np.ndarray, " nT"]


@dataclass(frozen=True, eq=False)
class Linearised:
    """One step's problem about a plan, before anything is condensed.

    Attributes
    ----------
    measure : Measure
    wanted : (N, nx)
        States of the reference at the ends of the periods, where actuators lag with its rest-length changes.
    rollout : Rollout
        Of the plan.
    plan : (N, nu) m
        Deviations from the reference, where actuators lag of commands.
    bounds : Bounds
    """

    measure: Measure
    wanted: Float[np.ndarray, "N nx"]
    rollout: Rollout
    plan: Float[np.ndarray, "N nu"]
    bounds: Bounds

    def states(self) -> tuple[Float[np.ndarray, "N nx"], Float[np.ndarray, "N nx columns"]]:
        """Deviations from the reference's states where the plan leads, and slopes by nodes and velocities.

        Where actuators lag the last deviations are those of rest lengths; they have no such slopes.
        """
        states, slopes = states_and_slopes(self.measure.linear, self.rollout.nodes, self.rollout.velocities)
        if self.rollout.inputs is not None:
            states = np.hstack([states, self.rollout.inputs])
        return states - self.wanted, slopes

    def _with_inputs(self, k: int, S: Float[np.ndarray, "nx z"]) -> Float[np.ndarray, "n z"]:
        """Slopes of the whole state at the end of period k by the plan so far, from those of the motion."""
        (_, nu), count = self.plan.shape, S.shape[1]
        rows = [S, np.eye(nu, count, count - nu)]
        if self.rollout.inputs_by_plan is not None:
            rows.insert(1, np.kron(self.rollout.inputs_by_plan[k, : k + 1], np.eye(nu)))
        return np.vstack(rows)

    def cost(self, inputs: Float[np.ndarray, "N nu"]) -> float:
        """What the linearised problem charges for deviations of inputs, m."""
        deviations, slopes = self.states()
        away = (inputs - self.plan).ravel()
        total, last = 0.0, len(inputs) - 1
        for k, (e, slope, v) in enumerate(zip(deviations, slopes, inputs, strict=True)):
            S, count = slope @ self.rollout.by_inputs[k].reshape(-1, away.size), (k + 1) * v.size
            there = np.append(e, self.plan[k]) + self._with_inputs(k, S[:, :count]) @ away[:count]
            total += there @ (self.measure.P if k == last else self.measure.Q) @ there + v @ self.measure.R @ v
        return 0.5 * float(total)

    def beyond(self, inputs: Float[np.ndarray, "N nu"]) -> Float[np.ndarray, "N nT"]:
        """By how much each limit of tension is passed, over the stiffness, m; 0 where it is kept."""
        bounds, away = self.bounds, (inputs - self.plan).ravel()
        stretch = (self.rollout.stretches + self.rollout.stretch_by_inputs @ away)[:, bounds.tendons]
        return np.maximum(bounds.side * (bounds.limit - stretch), 0.0)

    def qp(self) -> QP:
        """The QP in v, condensed; a search for its answer begins at the plan."""
        (stages, nu), z, measure, bounds = self.plan.shape, self.plan.ravel(), self.measure, self.bounds
        H, f = np.kron(np.eye(stages), measure.R), np.zeros(z.size)
        deviations, slopes = self.states()
        motion = slopes.shape[1]
        weighs_inputs = bool(measure.Q[motion:].any())
        for k in range(stages):
            count, last = (k + 1) * nu, k == stages - 1
            by_inputs = self.rollout.by_inputs[k].reshape(slopes.shape[2], -1)[:, :count]
            e, S = deviations[k, :motion], slopes[k] @ by_inputs
            if last or weighs_inputs:
                e, S = np.append(deviations[k], self.plan[k]), self._with_inputs(k, S)
            pull = S.T @ (measure.P if last else measure.Q[: e.size, : e.size])
            H[:count, :count] += pull @ S
            f[:count] += pull @ (e - S @ z[:count])
        rows = (bounds.side[:, None] * self.rollout.stretch_by_inputs[:, bounds.tendons]).reshape(-1, z.size)
        floors = (bounds.side * (bounds.limit - self.rollout.stretches[:, bounds.tendons])).ravel() + rows @ z
        change = np.kron(np.eye(stages) - np.eye(stages, k=-1), np.eye(nu))
        lower = np.concatenate([bounds.lower.ravel(), floors, bounds.change_lower.ravel()])
        upper = np.concatenate([bounds.upper.ravel(), np.full(floors.size, np.inf), bounds.change_upper.ravel()])
        return QP(0.5 * (H + H.T), f, np.vstack([rows, change]), lower, upper, guess=z)
