"""Model predictive control of rest lengths: hard limits always, tension floors wherever they can be kept.

The controller follows a reference of equilibria and controls the deviation from it with the linear model of the nearest
planned equilibrium (`synthesis.condensed` states the problem). Rest lengths reach the command at the end of the period.

A step asks the first solver, judges the answer by its recomputed KKT residual, then asks the next one. When the tension
floors cannot all be kept, they are relaxed by as little as possible and the step says by how much. Without any
acceptable answer the last plan is shifted and clipped to the hard limits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from time import perf_counter
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, linearize
from tensctl.synthesis.condensed import Condensed, Weights, condense
from tensctl.synthesis.lqr import Measured
from tensctl.synthesis.qp import QP, Solution, Solver
from tensctl.synthesis.reference import Hold, Reference
from tensctl.synthesis.relaxed import relax
from tensctl.threads import one_blas_thread

# An answer whose KKT residual is larger is refused.
_ACCEPT = 1e-6
# Planned equilibria between two linear models: on the (3,1) mast every second one tracks as well as every one.
_STRIDE = 2
# Most variables of the dense condensed problem: its matrices then take about half a gigabyte for each linear model.
_LARGEST = 4000


@dataclass(frozen=True)
class StepRecord:
    """What happened at one control step.

    Attributes
    ----------
    time : float, s
    status : str
        Solver that answered, with " relaxed" when tension floors gave way, or "fallback".
    solve_time : float, s
    kkt : float
        Recomputed KKT residual (nan for a fallback).
    relaxed : float, N
        By how much the worst tension floor had to give way; 0 when all are kept.
    """

    time: float
    status: str
    solve_time: float
    kkt: float
    relaxed: float


@dataclass(frozen=True, eq=False)
class _Piece:
    """One linear model with its condensed problem and set-up solvers."""

    linear: LinearModel
    problem: Condensed

    @cached_property
    def solvers(self) -> dict[str, Solver]:
        """Solvers set up so far, by name."""
        return {}


@dataclass(frozen=True, eq=False)
class Limits:
    """Vectors of one step's problem, all deviations from the reference.

    Attributes
    ----------
    start : (nx + nu,)
        (e_0, v_0).
    tension_margin : (N, nT) m
        Scaled reference tension above the floor.
    input_upper : (N, nu) m
    change_lower, change_upper : (N, nu) m
    """

    start: Float[np.ndarray, " n"]
    tension_margin: Float[np.ndarray, "N nT"]
    input_upper: Float[np.ndarray, "N nu"]
    change_lower: Float[np.ndarray, "N nu"]
    change_upper: Float[np.ndarray, "N nu"]


class MPC:
    """Predictive controller; `step` gives the total rest-length change u for the end of the period.

    Parameters
    ----------
    linear : LinearModel
        Its flexible part is controlled; with a path, the path's own equilibria are linearised instead.
    horizon : int
        Control periods looked ahead.
    dt : float, s
        Control period; every mode must be slower than its Nyquist frequency.
    tension_min : float, N
        Floor of every taut tendon's tension (soft, relaxed only when it cannot be kept).
    rate_max : float, m/s
        Limit of every rest length's rate (hard).
    weights : Weights
    solver : "auto", "daqp" or "osqp"
        Which solver is asked first; "auto" is DAQP, exact and fastest at control size.
    path : ShapePath, optional
        What to follow; the linear model's equilibrium by default.

    Raises
    ------
    SynthesisError
        A mode beyond the Nyquist frequency, or no solution of the terminal Riccati equation.
    """

    def __init__(
        self,
        linear: LinearModel,
        *,
        horizon: int = 20,
        dt: float = 0.02,
        tension_min: float = 0.1,
        rate_max: float = 0.5,
        weights: Weights | None = None,
        solver: Literal["auto", "daqp", "osqp"] = "auto",
        path: Reference | None = None,
    ) -> None:
        self.linear, self.horizon, self.dt = linear.flexible, horizon, dt
        self.tension_min, self.rate_max = tension_min, rate_max
        self.weights = Weights() if weights is None else weights
        self.order = ("osqp", "daqp") if solver == "osqp" else ("daqp", "osqp")
        self.reference: Reference = Hold(linear.equilibrium) if path is None else path
        self._pieces: dict[int, _Piece] = {}
        self._plan: np.ndarray | None = None
        self.records: list[StepRecord] = []
        _check_size(self.linear, horizon)
        _check_sampling(self.linear, dt)
        for knot in range(len(self.reference.equilibria)):
            self._piece(knot)

    def reset(self) -> None:
        """Forget the last plan and the records."""
        self._plan = None
        self.records = []

    @property
    def problem(self) -> Condensed:
        """The condensed problem at the end of the reference."""
        return self._piece(len(self.reference.equilibria) - 1).problem

    @one_blas_thread()
    def step(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0 to be reached at t + dt, m; hard limits always hold."""
        began = perf_counter()
        piece = self._piece(self.reference.knot_at(t))
        limits = self.limits(t, measurement)
        plan, status, kkt = self._solve(piece, limits)
        relaxed = self._shortfall(piece, limits, plan) if status.endswith("relaxed") or status == "fallback" else 0.0
        self._plan = plan + self._ahead(t)
        command = self._clipped(plan[0] + self._ahead(t)[0], measurement.inputs)
        self.records.append(StepRecord(t, status, perf_counter() - began, kkt, relaxed))
        return command

    def statement(self, t: float, measurement: Measured) -> tuple[Condensed, Limits, QP]:
        """The problem of one step in full, without solving it."""
        problem = self._piece(self.reference.knot_at(t)).problem
        limits = self.limits(t, measurement)
        return problem, limits, self.assemble(problem, limits)

    def solve(self, t: float, measurement: Measured) -> Float[np.ndarray, "N nu"]:
        """The plan of one step, deviations from the reference, m; leaves the controller as it is."""
        return self._solve(self._piece(self.reference.knot_at(t)), self.limits(t, measurement))[0]

    def limits(self, t: float, measurement: Measured) -> Limits:
        """Start and bounds of the problem at time t."""
        piece = self._piece(self.reference.knot_at(t))
        linear, members = piece.linear, self.linear.dynamics.members
        here = linear.state_of(self.reference.nodes_at(t), self.reference.velocities_at(t))
        state = linear.state_of(measurement.nodes, measurement.velocities) - here
        ahead = self._ahead(t)
        before = np.vstack([self.reference.inputs_at(t), ahead[:-1]])
        margin = self.reference.tensions_at(self._times(t))[:, piece.problem.tendons] - self.tension_min
        reach = self.rate_max * self.dt
        return Limits(
            start=np.concatenate([state, measurement.inputs - before[0]]),
            tension_margin=margin / piece.problem.tension_scale,
            input_upper=(members.rest_lengths - members.floors)[members.inputs] - ahead,
            change_lower=-reach - (ahead - before),
            change_upper=reach - (ahead - before),
        )

    def assemble(self, problem: Condensed, limits: Limits) -> QP:
        """The condensed QP with this step's vectors."""
        nu = limits.input_upper.shape[1]
        first = np.zeros_like(limits.change_lower)
        first[0] = limits.start[-nu:]
        floor = -limits.tension_margin.ravel() - problem.tension_from_state @ limits.start
        upper = limits.input_upper.ravel()
        return QP(
            H=problem.H,
            f=problem.from_state @ limits.start,
            A=problem.rows,
            lower=np.concatenate([np.full(upper.size, -np.inf), floor, (limits.change_lower + first).ravel()]),
            upper=np.concatenate([upper, np.full(floor.size, np.inf), (limits.change_upper + first).ravel()]),
        )

    def _times(self, t: float) -> np.ndarray:
        return t + self.dt * np.arange(1, self.horizon + 1)

    def _ahead(self, t: float) -> Float[np.ndarray, "N nu"]:
        """Reference inputs at the ends of the coming periods."""
        return self.reference.inputs_at(self._times(t))

    def _piece(self, knot: int) -> _Piece:
        """Linear model and problem for a planned equilibrium, built once for every `_STRIDE` of them."""
        last = len(self.reference.equilibria) - 1
        knot = last - _STRIDE * ((last - knot) // _STRIDE)
        if knot not in self._pieces:
            equilibrium = self.reference.equilibria[knot]
            linear = self.linear
            if equilibrium is not linear.equilibrium:
                linear = linearize(linear.dynamics, equilibrium, outputs=()).flexible
            piece = _Piece(linear, condense(linear, self.horizon, self.dt, self.weights))
            piece.solvers[self.order[0]] = _new_solver(self.order[0], _blank(piece.problem))
            self._pieces[knot] = piece
        return self._pieces[knot]

    def _solve(self, piece: _Piece, limits: Limits) -> tuple[np.ndarray, str, float]:
        """Plan (N, nu), status and KKT residual: hard problem first, then relaxed, then the shifted plan."""
        qp = self.assemble(piece.problem, limits)
        for suffix, build in (("", lambda: qp), (" relaxed", lambda: relax(qp, self.horizon))):
            for name in self.order:
                solution = self._ask(piece, name, suffix, build)
                if solution.z is not None and solution.kkt <= _ACCEPT:
                    plan = solution.z[: qp.f.size].reshape(self.horizon, -1)
                    return plan, name + suffix, solution.kkt
                if solution.status == "infeasible":
                    break
        return self._shifted(limits), "fallback", np.nan

    def _ask(self, piece: _Piece, name: str, suffix: str, build: Callable[[], QP]) -> Solution:
        qp = build()
        if name + suffix not in piece.solvers:
            piece.solvers[name + suffix] = _new_solver(name, qp)
        return piece.solvers[name + suffix].solve(qp)

    def _shifted(self, limits: Limits) -> np.ndarray:
        """Deviation plan that holds what the last plan would do next (or where the rest lengths are)."""
        nu = limits.input_upper.shape[1]
        if self._plan is None:
            return np.broadcast_to(limits.start[-nu:], limits.input_upper.shape).copy()
        reference = (self.linear.dynamics.members.rest_lengths - self.linear.dynamics.members.floors)[
            self.linear.dynamics.members.inputs
        ] - limits.input_upper
        return np.vstack([self._plan[1:], self._plan[-1:]]) - reference

    def _clipped(self, command: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The command within rate and rest-length limits, to the last bit."""
        members, reach = self.linear.dynamics.members, self.rate_max * self.dt
        command = np.clip(command, now - reach, now + reach)
        return np.minimum(command, (members.rest_lengths - members.floors)[members.inputs])

    def _shortfall(self, piece: _Piece, limits: Limits, plan: np.ndarray) -> float:
        """Largest predicted tension missing below the floor over the horizon, N."""
        problem, nu = piece.problem, plan.shape[1]
        count = limits.tension_margin.size
        predicted = problem.tension_from_state @ limits.start + problem.rows[:count] @ plan.ravel()
        below = -(predicted.reshape(limits.tension_margin.shape) + limits.tension_margin) * problem.tension_scale
        return float(below.max(initial=0.0)) if nu else 0.0


def _new_solver(name: str, qp: QP) -> Solver:
    if name == "daqp":
        from tensctl.synthesis.qp_daqp import DaqpSolver

        return DaqpSolver(qp)
    from tensctl.synthesis.qp_osqp import OsqpSolver

    return OsqpSolver(qp)


def _blank(problem: Condensed) -> QP:
    """The problem at rest with room on every side: what a solver factors before the first step."""
    room = np.ones(problem.rows.shape[0] + problem.rows.shape[1])
    return QP(problem.H, np.zeros(problem.rows.shape[1]), problem.rows, -room, room)


def _check_size(linear: LinearModel, horizon: int) -> None:
    variables = horizon * len(linear.inputs)
    if variables > _LARGEST:
        raise SynthesisError(
            f"mpc.horizon = {horizon} with {len(linear.inputs)} inputs makes {variables} variables; the problem "
            f"takes at most {_LARGEST}, so shorten the horizon or choose fewer actuators.tendons."
        )


def _check_sampling(linear: LinearModel, dt: float) -> None:
    fastest = max(linear.modes, key=lambda mode: mode.omega2, default=None)
    if fastest is not None and np.sqrt(max(fastest.omega2, 0.0)) * dt >= np.pi:
        raise SynthesisError(
            f"mpc.dt = {dt:g} s is too long for mode {fastest.index} at {fastest.frequency:.3g} Hz; "
            f"take dt below {0.5 / fastest.frequency:.2g} s."
        )
