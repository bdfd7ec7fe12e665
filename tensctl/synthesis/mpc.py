"""Model predictive control of rest lengths: hard limits always, limits of tension wherever they can be kept.

The controller follows a reference of equilibria and controls the deviation from it with the linear model of the nearest
planned equilibrium (`synthesis.condensed` states the problem). Rest lengths reach the command at the end of the period,
which begins when the computation is over: the state is predicted to then, with the command that is still under way.

A step asks solvers in turn (`synthesis.piece`). When the limits of tension cannot all be kept, they are relaxed by as
little as possible and the step says by how much. Without any acceptable answer, or any measurement, the last plan is
shifted and clipped to the hard limits.
"""

from __future__ import annotations

from time import perf_counter
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, linearize
from tensctl.model.tensions import tensions_at
from tensctl.scene import MpcStage
from tensctl.scene.given import check_kind
from tensctl.synthesis.condensed import Condensed, condense, stiffness_spread
from tensctl.synthesis.input_limits import InputLimits, check_asked, plan_of
from tensctl.synthesis.lagging import commands_along, commands_now, followed_to_next
from tensctl.synthesis.limits import Ahead, Limits
from tensctl.synthesis.lqr import Measured
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.pace import refuse_outrun
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_solvers import SOLVERS, first_choice
from tensctl.synthesis.reference import Hold, Reference, check_reference, outputs_along, refuse_beyond, rests
from tensctl.synthesis.sampling_limit import Fast, below_sampling_limit
from tensctl.synthesis.seen import known_inputs, refuse_misshapen, sampled_at, seen
from tensctl.synthesis.signal import Wanted, signal_for
from tensctl.synthesis.slack_margin import Parting, expected, parting
from tensctl.synthesis.step_record import StepRecord, told
from tensctl.synthesis.weights import Size
from tensctl.threads import one_blas_thread

# Planned equilibria between two linear models. On the (3,1) mast that grows by a fifth, 1, 2, 4 and 8 stay equally near
# the reference (1.6 mm at worst); more models cost set-up only and are there for longer ways.
_STRIDE = 2
# Most variables of the dense condensed problem: H and its rows, 8 n^2 and at least 16 n^2 bytes, then take 0.4 GB for
# each linear model.
_LARGEST = 4000


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
        Floor of every taut tendon's tension (soft, relaxed only when it cannot be kept); the scene's
        `actuators.force_max` bounds tensions of actuated tendons from above in the same way.
    rate_max : float, m/s
        Limit of every rest length's rate (hard). A motor whose tendons have stall limits is no faster than the scene's
        `actuators.power_max` over its force at these.
    u_max : number or table by tendon label, m, optional
        Largest change of a rest length from L0, either way (hard).
    weights : Weights
    solver : "auto", "dual", "primal", "daqp", "osqp", "piqp" or "clarabel"
        Which solver is asked first; `why` says what "auto" chose, and why.
    delay : float, s
        From a sample until the command computed at it begins to act, at most a period.
    modes : "refuse" or "truncate"
        What becomes of modes beyond the Nyquist frequency: an error that names one, or left out with their static
        answer kept; `linear.condensed` lists them.
    path : ShapePath, optional
        What to follow; the linear model's equilibrium by default.
    signal : function of time, (times, values), or Courses, optional
        What the outputs that `weights` names should be, in total and in their own units, (ny,) or (times, ny); straight
        lines between times, held at the ends. Without it they should be what they are on the path.
    preview : bool
        Whether a plan knows the signal over its horizon; otherwise it takes what is wanted now to last.

    Raises
    ------
    SceneError
        A setting that `[mpc]` of a scene would refuse.
    SynthesisError
        A path that is faster than its motors are, a signal that does not fit the weighted outputs, a mode beyond
        the Nyquist frequency, no input, or no solution of the terminal Riccati equation.
    """

    def __init__(
        self,
        linear: LinearModel,
        *,
        horizon: int = 20,
        dt: float = 0.02,
        tension_min: float = 0.1,
        rate_max: float = 0.5,
        u_max: Size | None = None,
        weights: Weights | None = None,
        solver: Literal["auto", "dual", "primal", "daqp", "osqp", "piqp", "clarabel"] = "auto",
        delay: float = 0.0,
        modes: Fast = "refuse",
        path: Reference | None = None,
        signal: Wanted | None = None,
        preview: bool = True,
    ) -> None:
        asked = MpcStage.checked(
            horizon=horizon, dt=dt, rate_max=rate_max, u_max=u_max, solver=solver, delay=delay, modes=modes,
            preview=preview,
        )  # fmt: skip
        check_asked(tension_min, asked.delay, asked.dt)
        check_kind(LinearModel, linear=linear)
        if weights is not None:
            check_kind(Weights, weights=weights)
        if path is not None:
            check_reference(path, linear.dynamics)
        self.linear = below_sampling_limit(linear.flexible, asked.dt, asked.modes).actuated
        self.horizon, self.dt, self.delay = asked.horizon, asked.dt, asked.delay
        self._fast: Fast = asked.modes
        self.tension_min, self.rate_max = float(tension_min), asked.rate_max
        self.weights = Weights() if weights is None else weights
        sizes = self.horizon, len(self.linear.inputs), len(self.linear.A)
        chosen = first_choice(*sizes, stiffness_spread(self.linear))
        self.solver, self.why = chosen if asked.solver in ("auto", None) else (solver, "asked for")
        self.reference: Reference = Hold(linear.equilibrium) if path is None else path
        self.signal, self.preview = signal_for(self.weights, self.linear, signal), asked.preview
        self.u_max = asked.u_max
        self._pieces: dict[int, Piece] = {}
        self._at_rest: Ahead | None = None
        self._plan: np.ndarray | None = None
        self._command: np.ndarray | None = None
        self._predicted: np.ndarray | None = None
        self._followed: np.ndarray | None = None
        self.records: list[StepRecord] = []
        if not self.linear.inputs:
            raise SynthesisError("no tendon has an actuator that moves anything; MPC needs at least one input.")
        _check_size(self.linear, self.horizon)
        self.hard = InputLimits.of(self.linear.dynamics, self.rate_max, self.dt, self.u_max)
        refuse_beyond(self.reference, self.linear.inputs, self.hard.range)
        refuse_outrun(self.reference, self.linear.dynamics.members)
        for knot in range(len(self.reference.equilibria)):
            self._piece(knot)
        rest = self.linear.equilibrium
        self.linear.seen(rest.nodes, 0 * rest.nodes, rest.inputs)  # no control step should wait for the kernel

    def reset(self) -> None:
        """Forget the last plan and the records."""
        self._plan = self._command = self._predicted = self._followed = None
        self.records = []

    def state(self) -> dict[str, np.ndarray]:
        """All that later steps depend on: last plan (N, nu) m, command, and what is predicted; none before them."""
        held = {"plan": self._plan, "command": self._command, "predicted": self._predicted, "followed": self._followed}
        return {name: value for name, value in held.items() if value is not None}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from the last plan; records begin anew.

        Raises
        ------
        SynthesisError
            What is no memory of such a controller.
        """
        plan = plan_of(state, self.horizon, len(self.linear.inputs))
        self.reset()
        self._plan, self._command, self._predicted = plan, state.get("command"), state.get("predicted")
        self._followed = state.get("followed")

    @property
    def problem(self) -> Condensed:
        """The condensed problem at the end of the reference."""
        return self._piece(len(self.reference.equilibria) - 1).problem

    @property
    def floored(self) -> np.ndarray:
        """Tendons that have a tension floor at the end of the reference."""
        return self.problem.floored

    @one_blas_thread()
    def step(self, t: float, measurement: Measured | None) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0 to be reached at t + delay + dt, m; hard limits always hold.

        A measurement that is None, holds NaN or fits no structure tells nothing: the last plan goes on, and before the
        first rest lengths stay. Inputs that were not measured are taken for those of the last command.

        Raises
        ------
        SynthesisError
            A time that is no finite number, or a measurement whose arrays have another shape than this structure's.
        """
        began, t = perf_counter(), sampled_at(t)
        self._refuse(measurement)
        now = self._commands_now(t, measurement)
        inputs = self._inputs_now(measurement, now)
        look = self._seen(measurement, inputs, now)
        if look is None:
            plan = np.tile(now, (self.horizon, 1)) if self._plan is None else self._continued(self._plan)
            self._predicted = np.full(len(self.linear.dynamics.structure.tendons), np.nan)
            record = StepRecord(t, "no measurement", perf_counter() - began, np.nan, 0.0)
            return self._command_of(plan, now, inputs, record)
        part = self._parting(look)
        piece = self.piece_at(t)
        limits = self.limits(t, look)
        plan, status, kkt = self._solve(piece, limits)
        status, relaxed = told(status, 0.0 if status in SOLVERS else limits.shortfall(piece.problem, plan))
        plan = plan + limits.about
        record = StepRecord(t, status, perf_counter() - began, kkt, relaxed, part.gap, part.tendon)
        command = self._command_of(plan, now, inputs, record)
        self._predicted = self._prediction(t, piece, limits, command)
        return command

    def _command_of(
        self, plan: np.ndarray, now: np.ndarray, inputs: np.ndarray, record: StepRecord
    ) -> Float[np.ndarray, " nu"]:
        """The first command of a plan of total inputs, within hard limits; plan and record are kept."""
        before = now if self._command is None or not self.delay else self._command
        self._plan, self._command = plan, self.hard.kept(plan[0], before)
        if self.linear.lag:
            asked = now, before, self._command
            self._followed = followed_to_next(self.linear.lag, self.dt, self.delay, inputs, asked)
        self.records.append(record)
        return self._command

    def _parting(self, look: Any) -> Parting:
        """What the measured tensions say of those that were predicted for now."""
        if self._predicted is None:
            return Parting()
        tensions, noise = self._tensions_of(look)
        return parting(self._predicted, tensions, self.tension_min, noise)

    def _tensions_of(self, look: Any) -> tuple[Float[np.ndarray, " nt"], Float[np.ndarray, " nt"] | float]:
        """Measured tensions, and by how much they may be off, N; where none are, those of nodes and rest lengths."""
        if look.tensions is not None:
            return look.tensions, 0.0
        dynamics, nodes = self.linear.dynamics, look.nodes[None]
        length, rest = dynamics.structure.lengths_at(nodes), dynamics.members.shortened(look.inputs)[None]
        return tensions_at(dynamics, nodes, look.velocities[None], length, rest)[0], 0.0

    def _prediction(self, t: float, piece: Piece, limits: Limits, command: np.ndarray) -> Float[np.ndarray, " nt"]:
        """Tensions at the next sample by the linear model, N; nan for tendons without a floor."""
        before = limits.start[-command.size :]
        inputs = before + (1 - self.delay / self.dt) * (command - limits.about[0] - before)
        margin, tendons = self._margin_at_next(t, piece, limits), len(self.linear.dynamics.structure.tendons)
        return expected(piece.problem, piece.tension_next, limits.start, inputs, margin, self.tension_min, tendons)

    def _margin_at_next(self, t: float, piece: Piece, limits: Limits) -> Float[np.ndarray, " nT"]:
        if not self.delay:
            return limits.tension_margin[0]
        return piece.problem.margin(self.reference.tensions_at(t + self.dt), self.tension_min)

    def _commands_now(self, t: float, measurement: Measured | None) -> np.ndarray:
        """What rest-length changes were commanded until now; without lag those that are there."""
        believed = self.reference.inputs_at(t) if self._command is None else self._command
        return known_inputs(None if measurement is None else commands_now(self.linear, measurement), believed)

    def _inputs_now(self, measurement: Measured | None, commands: np.ndarray) -> np.ndarray:
        """Rest-length changes as they are, where that was not measured as they follow the commands."""
        if not self.linear.lag:
            return commands
        believed = commands if self._followed is None else self._followed
        return known_inputs(None if measurement is None else measurement.inputs, believed)

    def _refuse(self, measurement: Any) -> None:
        """Refuse what is no measurement of this structure."""
        if measurement is not None:
            refuse_misshapen(self.linear.dynamics.structure, len(self.linear.inputs), measurement)

    def _seen(self, measurement: Any, inputs: np.ndarray, commands: np.ndarray) -> Any:
        """What a sample tells, with known inputs; None where that is nothing."""
        return seen(self.linear.dynamics.structure, measurement, inputs, commands)

    def piece_at(self, t: float) -> Piece:
        """The linear model and problem that answer a sample at time t."""
        return self._piece(self.reference.knot_at(t))

    def statement(self, t: float, measurement: Measured) -> tuple[Condensed, Limits, QP]:
        """The problem of one step in full, without solving it."""
        problem = self.piece_at(t).problem
        limits = self.limits(t, measurement)
        return problem, limits, limits.assemble(problem)

    def solve(self, t: float, measurement: Measured) -> Float[np.ndarray, "N nu"]:
        """The plan of one step, deviations from the reference, m; leaves the controller as it is."""
        return self._solve(self.piece_at(t), self.limits(t, measurement))[0]

    def limits(self, t: float, measurement: Measured) -> Limits:
        """Start and bounds of the problem at time t."""
        piece = self.piece_at(t)
        linear, ahead = piece.linear, self._ahead(piece, t)
        rest = linear.equilibrium.inputs
        state = linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        state, inputs = self._when_it_acts(piece, state, commands_now(linear, measurement) - rest)
        return Limits(
            start=np.concatenate([state, inputs + rest]) - ahead.start,
            wanted=self._wanted(piece, t),
            plan=None if self._plan is None else self._continued(self._plan) - ahead.bounds["about"],
            **ahead.bounds,
        )

    def _ahead(self, piece: Piece, t: float) -> Ahead:
        """What the reference asks of the periods after a sample; computed once where it rests from then on."""
        since = t - self.dt if self.linear.lag else t  # commands are told from half a period back
        if not rests(self.reference, since):
            return self._ahead_of(piece, t)
        if self._at_rest is None:
            self._at_rest = self._ahead_of(piece, t)
        return self._at_rest

    def _ahead_of(self, piece: Piece, t: float) -> Ahead:
        reference, acts = self.reference, t + self.delay
        course = commands_along(reference, np.append(acts, self._ends(t)), self.linear.lag, self.dt)
        about, change = course[1:], course[1:] - course[:-1]
        nodes, velocities = reference.nodes_at(acts), reference.velocities_at(acts)
        state = piece.linear.seen(nodes, velocities, reference.inputs_at(acts))
        return Ahead(
            np.concatenate([state, course[0]]),
            {
                "tension_margin": piece.problem.margin(reference.tensions_at(self._ends(t)), self.tension_min),
                "input_lower": self.hard.lower - about,
                "input_upper": self.hard.upper - about,
                "change_lower": -self.hard.reach - change,
                "change_upper": self.hard.reach - change,
                "about": about,
            },
        )

    def _ends(self, t: float) -> Float[np.ndarray, " N"]:
        """Ends of the periods that a command computed at a sample begins, s."""
        return t + self.delay + self.dt * np.arange(1, self.horizon + 1)

    def _wanted(self, piece: Piece, t: float) -> Float[np.ndarray, "N ny"] | None:
        """What is wanted of the outputs at the ends of the coming periods: deviations from the path, over sizes."""
        follows = piece.problem.following
        if self.signal is None or follows is None:
            return None
        times = self._ends(t)
        told = self.signal.at(times if self.preview else np.full(self.horizon, t))
        if not self.signal.about_path:
            reference, there = self._path_ahead(t)
            told = told - outputs_along(reference, follows.weighed.linear, there)
        return told / follows.weighed.sizes

    def _path_ahead(self, t: float) -> tuple[Reference, Float[np.ndarray, " N"]]:
        """The reference from which a plan deviates, and when it is there at the ends of the coming periods, s."""
        return self.reference, self._ends(t)

    def _when_it_acts(self, piece: Piece, state: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """State and inputs, deviations from the model's equilibrium, when the next command begins to act."""
        if not self.delay:
            return state, inputs
        way, coming = piece.until_it_acts, inputs
        if self._command is not None:
            coming = self._command - piece.linear.equilibrium.inputs
        return way.F @ state + way.G0 @ inputs + way.G1 @ coming, coming

    def _piece(self, knot: int) -> Piece:
        """Linear model and problem for a planned equilibrium, built once for every `_STRIDE` of them."""
        last = len(self.reference.equilibria) - 1
        knot = last - _STRIDE * ((last - knot) // _STRIDE)
        if knot not in self._pieces:
            equilibrium = self.reference.equilibria[knot]
            linear = self.linear
            if equilibrium is not linear.equilibrium:
                linear = linearize(linear.dynamics, equilibrium, outputs=()).flexible
                linear = below_sampling_limit(linear, self.dt, self._fast).actuated
            problem = condense(linear, self.horizon, self.dt, self.weights, follows=self.signal is not None)
            self._pieces[knot] = Piece(linear, problem, self.delay, self.solver)
        return self._pieces[knot]

    def _solve(self, piece: Piece, limits: Limits) -> tuple[np.ndarray, str, float]:
        """Plan (N, nu), status and KKT residual; without an answer the last plan goes on."""
        return piece.answer(limits) or (self._shifted(limits), "fallback", np.nan)

    def _shifted(self, limits: Limits) -> np.ndarray:
        """Deviation plan that holds what the last plan would do next (or where the rest lengths are)."""
        nu = limits.input_upper.shape[1]
        if self._plan is None:
            return np.broadcast_to(limits.start[-nu:], limits.input_upper.shape).copy()
        return self._continued(self._plan) - limits.about

    @staticmethod
    def _continued(plan: np.ndarray) -> np.ndarray:
        """What a plan does from its second period on; its end is held."""
        return np.concatenate([plan[1:], plan[-1:]])


def _check_size(linear: LinearModel, horizon: int) -> None:
    variables = horizon * len(linear.inputs)
    if variables > _LARGEST:
        raise SynthesisError(
            f"mpc.horizon = {horizon} with {len(linear.inputs)} inputs makes {variables} variables; the problem "
            f"takes at most {_LARGEST}, so shorten the horizon or choose fewer actuators.tendons."
        )
