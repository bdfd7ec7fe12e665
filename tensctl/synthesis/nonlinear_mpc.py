"""Nonlinear predictive control by real-time iteration: the plan is rolled out on the structure itself, every step anew.

    shift the last plan -> roll it out from the measured state -> linearise along the rollout -> one QP -> command

The rollout is that of the nonlinear structure, with exact rods and slack tendons that carry nothing
(`synthesis.rollout`); the QP is that of `synthesis.nonlinear_problem`. Near a reference equilibrium the command is that
of `tc.MPC` up to the square of the deviation; far from it no linear model of one place is asked. With `iterations` > 1
a step repeats roll-out and QP, up to the optimum of the nonlinear problem.

Where actuators lag, the plan is one of commands, and rest lengths follow it in the rollout and in the cost.

Hard limits hold always. Tension floors that cannot all be kept give way by as little as possible, and the step says by
how much. Without an acceptable answer the shifted plan goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import linearize
from tensctl.model import Dynamics
from tensctl.scene import MpcStage
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.statics import Equilibrium
from tensctl.synthesis.feedback import Measured
from tensctl.synthesis.input_limits import InputLimits, check_asked, plan_of
from tensctl.synthesis.lagging import commands_along, commands_now, followed_to_next
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.nonlinear_problem import Bounds, Linearised, Measure
from tensctl.synthesis.pace import refuse_outrun
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_anew import answer
from tensctl.synthesis.qp_primal import PrimalSolver
from tensctl.synthesis.qp_solvers import SOLVERS
from tensctl.synthesis.reference import Hold, Reference, check_reference, refuse_beyond
from tensctl.synthesis.rollout import rolling
from tensctl.synthesis.sampling_limit import Fast, below_sampling_limit
from tensctl.synthesis.seen import Seen, known_inputs, refuse_misshapen, sampled_at, seen
from tensctl.synthesis.step_record import StepRecord, missing, told
from tensctl.synthesis.weights import Size
from tensctl.threads import one_blas_thread

# Decimals of a second to which times of the reference are told: those of successive steps are then the same.
_TICK = 9


@dataclass(frozen=True)
class NonlinearRecord(StepRecord):
    """What happened at one step of nonlinear MPC.

    Attributes
    ----------
    change : float, m
        Largest change of the plan by the step's last iteration: how far it is from converged.
    """

    change: float = 0.0


class NonlinearMPC:
    """Predictive controller on the nonlinear structure; `step` gives the total rest-length change u, m.

    Parameters
    ----------
    dynamics : Dynamics
    reference : Equilibrium or Reference
        What to hold, or a path to follow.
    horizon, dt, tension_min, rate_max, u_max, weights, delay
        As `tc.MPC` has them.
    modes : "refuse" or "truncate"
        Modes beyond the Nyquist frequency: refused, or left out of what deviations cost. Roll-outs have them all.
    iterations : int
        Roll-outs and QPs a step; 1 is the real-time iteration.

    Raises
    ------
    SceneError
        A setting that `[mpc]` of a scene would refuse.
    SynthesisError
        No input, a path that is faster than its motors are, a mode beyond the Nyquist frequency that is refused, a
        motion too fast for the period, or no solution of the terminal Riccati equation.
    """

    # Who is asked first for a plan (`synthesis.qp_anew`).
    solver = "daqp"

    def __init__(
        self,
        dynamics: Dynamics,
        reference: Equilibrium | Reference,
        *,
        horizon: int = 20,
        dt: float = 0.02,
        tension_min: float = 0.1,
        rate_max: float = 0.5,
        u_max: Size | None = None,
        weights: Weights | None = None,
        delay: float = 0.0,
        modes: Fast = "refuse",
        iterations: int = 1,
    ) -> None:
        asked = MpcStage.checked(horizon=horizon, dt=dt, rate_max=rate_max, u_max=u_max, delay=delay, modes=modes)
        check_asked(tension_min, asked.delay, asked.dt)
        iterations = argument("iterations", iterations, Number("roll-outs a step", least=1, whole=True))
        check_kind(Dynamics, dynamics=dynamics)
        if weights is not None:
            check_kind(Weights, weights=weights)
        if not dynamics.members.gearing.size:
            raise SynthesisError("no tendon has an actuator that moves anything; MPC needs at least one input.")
        self.dynamics, self.iterations = dynamics, iterations
        self._modes: Fast = asked.modes
        self.horizon, self.dt, self.delay = asked.horizon, asked.dt, asked.delay
        self.tension_min, self.rate_max, self.u_max = float(tension_min), asked.rate_max, asked.u_max
        self.weights = Weights() if weights is None else weights
        self.reference: Reference = Hold(reference) if isinstance(reference, Equilibrium) else reference
        check_reference(self.reference, dynamics)
        self.hard = InputLimits.of(dynamics, self.rate_max, self.dt, self.u_max)
        refuse_beyond(self.reference, dynamics.input_labels, self.hard.range)
        refuse_outrun(self.reference, dynamics.members)
        self._roll = rolling(dynamics, asked.dt)
        self._measures: dict[int, Measure] = {}
        self._states: dict[tuple[int, float], np.ndarray] = {}
        self._plan: np.ndarray | None = None
        self._followed: np.ndarray | None = None
        self.records: list[NonlinearRecord] = []
        for knot in range(len(self.reference.equilibria)):
            self._measure(knot)
        self._driven = self.measure.linear.actuated
        self._roll = replace(self._roll, lag=self._driven.lag)
        self._rehearse()

    def reset(self) -> None:
        """Forget the last plan and the records."""
        self._plan = self._followed = None
        self.records = []

    def state(self) -> dict[str, np.ndarray]:
        """All that later steps depend on: the last plan (N, nu) m, and with lag rest lengths; nothing before them."""
        held = {"plan": self._plan, "followed": self._followed}
        return {name: value for name, value in held.items() if value is not None}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from the last plan; records begin anew.

        Raises
        ------
        SynthesisError
            What is no memory of such a controller.
        """
        plan = plan_of(state, self.horizon, self.dynamics.members.gearing.size)
        self.reset()
        self._plan, self._followed = plan, state.get("followed")

    @one_blas_thread()
    def step(self, t: float, measurement: Measured | None) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0 to be asked for at t + delay + dt, m; hard limits always hold.

        A measurement that is None, holds NaN or fits no structure tells nothing: the last plan goes on, and before the
        first rest lengths stay.

        Raises
        ------
        SynthesisError
            A time that is no finite number, a measurement whose arrays have another shape than this structure's, or
            with lag one without commands.
        """
        began, status, t = perf_counter(), "fallback", sampled_at(t)
        if measurement is not None:
            refuse_misshapen(self.dynamics.structure, self.dynamics.members.gearing.size, measurement)
        asked = self._commands_now(t, measurement)
        inputs = self._inputs_now(measurement, asked)
        look = seen(self.dynamics.structure, measurement, inputs, asked)
        now = asked if self._plan is None or not self.delay else self._plan[0]
        if look is None:
            return self._no_measurement(t, inputs, (asked, now), began)
        plan, ahead, kkt, relaxed, change = self._shifted(t, now), self._ahead(t), np.nan, 0.0, 0.0
        for _ in range(self.iterations):
            step = self.linearised(t, look, plan)
            if not step.rollout.finite or (found := answer(step.qp(), self.horizon)) is None:
                break
            z, status, kkt = found
            wished = z.reshape(plan.shape)
            relaxed = 0.0 if status in SOLVERS else missing(step.beyond(wished), self._scale)
            better = self._kept(wished + ahead, now)
            plan, change = better, float(np.abs(better - plan).max())
        status, relaxed = told(status, relaxed)
        record = NonlinearRecord(t, status, perf_counter() - began, kkt, relaxed, change=change)
        return self._command_of(plan, inputs, (asked, now), record)

    def _commands_now(self, t: float, measurement: Measured | None) -> np.ndarray:
        """What was commanded until now, without lag inputs, as measured; where they were not, the last command."""
        believed = self.reference.inputs_at(t) if self._plan is None else self._plan[0]
        return known_inputs(None if measurement is None else commands_now(self._driven, measurement), believed)

    def _inputs_now(self, measurement: Measured | None, commands: np.ndarray) -> np.ndarray:
        """Rest-length changes as measured; where they were not, as they follow the commands."""
        if not self._driven.lag:
            return commands
        believed = commands if self._followed is None else self._followed
        return known_inputs(None if measurement is None else measurement.inputs, believed)

    def _no_measurement(
        self, t: float, inputs: np.ndarray, asked: tuple[np.ndarray, np.ndarray], began: float
    ) -> np.ndarray:
        """The last plan's next command; before there is a plan, commands as they are."""
        now = asked[1]
        plan = np.tile(now, (self.horizon, 1)) if self._plan is None else np.vstack([self._plan[1:], self._plan[-1:]])
        record = NonlinearRecord(t, "no measurement", perf_counter() - began, np.nan, 0.0)
        return self._command_of(self._kept(plan, now), inputs, asked, record)

    def _command_of(
        self, plan: np.ndarray, inputs: np.ndarray, asked: tuple[np.ndarray, np.ndarray], record: NonlinearRecord
    ) -> Float[np.ndarray, " nu"]:
        """The first command of a plan within hard limits; `asked` is what was commanded, and is once it is computed."""
        self._plan = plan
        if self._driven.lag:
            self._followed = followed_to_next(self._driven.lag, self.dt, self.delay, inputs, (*asked, plan[0]))
        self.records.append(record)
        return plan[0]

    def statement(self, t: float, measurement: Measured, plan: Float[np.ndarray, "N nu"]) -> QP:
        """The QP about a plan of total inputs, m; its variables are deviations from the reference."""
        return self.linearised(t, measurement, plan).qp()

    def linearised(self, t: float, measurement: Measured, plan: Float[np.ndarray, "N nu"] | None = None) -> Linearised:
        """What the QP about a plan of total inputs, m, is made from; without one, about that which a step begins at."""
        nodes, velocities, inputs, now = self._when_it_acts(measurement)
        measure, plan = self._measure(self.reference.knot_at(t)), self._shifted(t, now) if plan is None else plan
        rollout = self._roll(nodes, velocities, inputs, plan, commands=now)
        return Linearised(measure, self._wanted(t), rollout, plan - self._ahead(t), self._bounds(t, now))

    def _when_it_acts(self, measurement: Measured) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Nodes, velocities, inputs and commands when the next command begins to act: the one under way is rolled out.

        Without lag inputs are the commands.
        """
        nodes, velocities, inputs = measurement.nodes, measurement.velocities, measurement.inputs
        now = commands_now(self._driven, measurement)
        if not self.delay:
            return nodes, velocities, inputs, now
        coming, roll = now if self._plan is None else self._plan[0], replace(self._roll, dt=self.delay)
        until = roll(nodes, velocities, inputs, coming[None], commands=now, columns=False)
        return until.nodes[0], until.velocities[0], coming if until.inputs is None else until.inputs[0], coming

    def _wanted(self, t: float) -> Float[np.ndarray, "N nx"]:
        """States of the reference at the ends of the coming periods; all but the last were asked a period ago.

        Where actuators lag its rest-length changes stand beside them. Where rods share nodes a state of a path takes
        4 ms: joints are closed at three times.
        """
        knot, asked = self.reference.knot_at(t), self.reference
        times = np.minimum(np.round(self._times(t), _TICK), getattr(asked, "ends", np.inf)).tolist()
        known, of = self._states, self._measure(knot).linear.state_of
        self._states = {
            (knot, s): known[knot, s] if (knot, s) in known else of(asked.nodes_at(s), asked.velocities_at(s))
            for s in times
        }
        states = np.array([self._states[knot, s] for s in times])
        return np.hstack([states, asked.inputs_at(self._times(t))]) if self._driven.lag else states

    def _bounds(self, t: float, now: np.ndarray) -> Bounds:
        members, ahead = self.dynamics.members, self._ahead(t)
        lower, upper, reach = *self.hard.range, self.hard.reach
        moving = np.diff(np.vstack([now, ahead]), axis=0)
        tendons, side = self._limited
        limit = np.where(side > 0, self.tension_min, members.force_max[tendons]) / self._scale
        return Bounds(lower - ahead, upper - ahead, -reach - moving, reach - moving, tendons, side, limit)

    @cached_property
    def _scale(self) -> Float[np.ndarray, " nT"]:
        """Newtons that a metre of each bounded tendon stands for."""
        members = self.dynamics.members
        return (members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths)[self._limited[0]]

    def _shifted(self, t: float, now: np.ndarray) -> np.ndarray:
        """The last plan a period later, its last deviation held; the reference's own inputs before there is one."""
        ahead = self._ahead(t)
        if self._plan is None:
            return self._kept(ahead, now)
        return self._kept(np.vstack([self._plan[1:], self._plan[-1] + ahead[-1] - ahead[-2]]), now)

    def _kept(self, plan: np.ndarray, now: np.ndarray) -> np.ndarray:
        """The plan within rate and rest-length limits, to the last bit."""
        kept = np.empty_like(plan)
        for k, u in enumerate(plan):
            now = kept[k] = self.hard.kept(u, now)
        return kept

    def _rehearse(self) -> None:
        """State a problem at the reference's start and set up who is asked for it: no step waits for a kernel."""
        start, nodes = self._ahead(0.0), self.reference.nodes_at(0.0)
        qp = self.statement(0.0, Seen(nodes, 0 * nodes, self.reference.inputs_at(0.0), commands=start[0]), start)
        PrimalSolver(qp.H, qp.A, self.horizon, soft=True)

    @property
    def bounded(self) -> int:
        """Rows of tension in a stage."""
        return len(self._limited[0])

    @property
    def floored(self) -> np.ndarray:
        """Tendons that have a tension floor: taut at every planned equilibrium, not between pins."""
        tendons, side = self._limited
        return tendons[side > 0]

    @cached_property
    def _limited(self) -> tuple[np.ndarray, np.ndarray]:
        """Tendons whose tension is bounded, and 1 for a floor or -1 for a stall limit.

        A floor have those that every planned equilibrium keeps taut, but for those between pins.
        """
        tensions = np.array([e.tensions for e in self.reference.equilibria])
        floored = np.flatnonzero((tensions > 0).all(axis=0) & ~self.dynamics.structure.grounded_tendons)
        stalling = floored[np.isfinite(self.dynamics.members.force_max[floored])]
        return np.concatenate([floored, stalling]), np.repeat([1.0, -1.0], [floored.size, stalling.size])

    def _times(self, t: float) -> np.ndarray:
        return t + self.delay + self.dt * np.arange(1, self.horizon + 1)

    def _ahead(self, t: float) -> Float[np.ndarray, "N nu"]:
        """Reference inputs at the ends of the coming periods; where actuators lag, commands that lead to them."""
        return commands_along(self.reference, self._times(t), self._driven.lag, self.dt)

    @property
    def measure(self) -> Measure:
        """What deviations cost at the end of the reference."""
        return self._measure(len(self.reference.equilibria) - 1)

    def _measure(self, knot: int) -> Measure:
        """What deviations cost near a planned equilibrium."""
        if knot not in self._measures:
            linear = linearize(self.dynamics, self.reference.equilibria[knot], outputs=()).flexible
            linear = below_sampling_limit(linear, self.dt, self._modes)
            self._measures[knot] = Measure.of(linear, self.dt, self.weights)
        return self._measures[knot]
