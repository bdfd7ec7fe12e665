"""Predictive control from what sensors read, without offset where the inputs can reach.

    estimate   (x, d) by the filter of `synthesis.offset_filter`, d the disturbances of `synthesis.disturbance`
    target     (x_s, u_s) at rest under d, `synthesis.steady_target`
    problem    that of `synthesis.condensed` in e = x - x_s and v = u - u_s,   T = T_rest + C x + D u + C_d d

One linear model is used, about the equilibrium of `linear`; the disturbances take up what it misses elsewhere. On a
path the target is where the path is when a command begins to act, and plans deviate from how it goes on from there:

    x_s + what its velocities add,   u_s + u_path(t) - u_path(now),   T_s + T_path(t) - T_path(now)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, sample_ramped
from tensctl.scene.complaint import shown
from tensctl.scene.given import argument
from tensctl.scene.values import Number
from tensctl.structure.labels import matches
from tensctl.synthesis.disturbance import Disturbed, disturbed
from tensctl.synthesis.lagging import commands_along, commands_now
from tensctl.synthesis.limits import Limits
from tensctl.synthesis.mpc import MPC
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.offset_filter import Estimate, OffsetFilter, offset_filter
from tensctl.synthesis.pace import refuse_outrun
from tensctl.synthesis.reference import Hold, Reference, check_reference, rests
from tensctl.synthesis.seen import sampled_at
from tensctl.synthesis.sensors import Reading, Sensors
from tensctl.synthesis.signal import Wanted
from tensctl.synthesis.stabilisable import refuse_unseen
from tensctl.synthesis.steady_target import SteadyTarget, Target
from tensctl.synthesis.weights import Size
from tensctl.threads import one_blas_thread

# Deviations of a sensor of tension within which its noise stays: beyond five once in a million samples.
_SURE = 5.0


@dataclass(frozen=True, eq=False)
class _Look:
    """What a reading says."""

    reading: Reading
    estimate: Estimate
    target: Target


class OutputMPC(MPC):
    """Predictive controller that is shown what its sensors read; `step` gives the total rest-length change u.

    Parameters
    ----------
    linear : LinearModel
    sensors : Sensors
    track : pattern or sequence of patterns, optional
        Labels of the sensors whose values are to be reached (`l_*`, `l_t5_1_1`, `P4_1_1_z`); all lengths and positions
        by default, all tensions where nothing else is measured.
    force_noise : float, N s^1/2
        Root of the intensity of white forces on the nodes that the filter expects; much of it takes what is constant
        for noise, and the offset goes slowly.
    drift : float, 1/s^1/2
        How far each disturbance wanders in a second, in deviations of the sensors that show it; larger is faster and
        noisier.
    path : Reference, optional
        What to follow; the linear model's equilibrium by default.
    signal, preview
        As `MPC` has them. Weighted outputs leave the target by what the signal has beyond the path; those that sensors
        read come without offset.
    horizon, dt, tension_min, rate_max, u_max, weights, solver, delay, modes
        As `MPC` has them.

    Raises
    ------
    SceneError, SynthesisError
        As `MPC`; a rank condition that fails, a mode that nothing damps and no sensor tells of, or a pattern that names
        no sensor.
    """

    def __init__(
        self,
        linear: LinearModel,
        sensors: Sensors,
        *,
        track: str | tuple[str, ...] | None = None,
        force_noise: float = 0.001,
        drift: float = 1.0,
        horizon: int = 20,
        dt: float = 0.02,
        tension_min: float = 0.1,
        rate_max: float = 0.5,
        u_max: Size | None = None,
        weights: Weights | None = None,
        solver: Literal["auto", "dual", "primal", "daqp", "osqp", "piqp", "clarabel"] = "auto",
        delay: float = 0.0,
        modes: Literal["refuse", "truncate"] = "refuse",
        path: Reference | None = None,
        signal: Wanted | None = None,
        preview: bool = True,
    ) -> None:
        super().__init__(
            linear, horizon=horizon, dt=dt, tension_min=tension_min, rate_max=rate_max, u_max=u_max,
            weights=weights, solver=solver, delay=delay, modes=modes, signal=signal, preview=preview,
        )  # fmt: skip
        drift = argument("drift", drift, Number("deviations of a sensor in 1 s", above=0))
        if path is not None:
            check_reference(path, linear.dynamics)
            refuse_outrun(path, linear.dynamics.members)
        self.sensors = sensors
        self.wanted: Reference = Hold(linear.equilibrium) if path is None else path
        self.model: Disturbed = disturbed(self.linear, sensors, self.dt)
        self.model.verify()
        self.filter: OffsetFilter = offset_filter(self.model, force_noise, drift)
        try:
            _ = self.filter.deviations  # no control step should wait for it, or fail by it
        except SynthesisError:
            mechanics = self.linear.mechanics
            refuse_unseen(mechanics, sensors.rows(mechanics)[0])
            raise
        self.tracked = _tracked(sensors, track)
        self._memory: tuple[Estimate, np.ndarray, Target] | None = None
        self._looked: _Look | None = None

    @property
    def estimate(self) -> Estimate:
        """The filter's estimate after the last step, with counts of missing and refused values."""
        return self.filter.begin() if self._memory is None else self._memory[0]

    @property
    def target(self) -> Target | None:
        """Where the last step wanted to rest; None before the first."""
        return None if self._looked is None else self._looked.target

    def reset(self) -> None:
        """Forget the estimate, the last plan and the records: the structure is at its equilibrium."""
        super().reset()
        self._memory = self._looked = None

    def state(self) -> dict[str, np.ndarray]:
        """The last plan, estimate, inputs and target."""
        if self._memory is None:
            return super().state()
        e, inputs, target = self._memory
        held = {
            "mean": e.mean, "absurd": e.absurd, "counts": np.array([e.missing, e.rejected]), "inputs": inputs,
            "target": np.concatenate([target.inputs, [target.missed, target.relaxed]]), "target_state": target.state,
            "beside": target.beside,
        }  # fmt: skip
        # Always there, empty while it is the constant one: a stored run keeps what is not written anew.
        return super().state() | held | {"covariance": np.zeros((0, 0)) if e.covariance is None else e.covariance}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from this estimate; records begin anew."""
        super().restore(state)
        if "mean" not in state:
            return
        missing, rejected = (int(k) for k in state["counts"])
        covariance = state["covariance"] if state["covariance"].size else None
        estimate = Estimate(state["mean"], covariance, state["absurd"], missing, rejected)
        missed, relaxed = (float(x) for x in state["target"][-2:])
        target = Target(state["target_state"], state["target"][:-2], missed, relaxed, state["beside"])
        self._memory = estimate, state["inputs"], target
        self._looked = _Look(Reading(np.zeros(0), state["inputs"], state["inputs"]), estimate, target)

    @one_blas_thread()
    def step(self, t: float, measurement: Any) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0, m; hard limits always hold.

        Parameters
        ----------
        measurement : Reading or None
            What the sensors show; NaN stands for what is missing, None for a sample that never came.

        Raises
        ------
        SynthesisError
            A time that is no finite number, or when anything but a reading of these sensors is shown.
        """
        command = super().step(t, measurement)
        self._remember()
        return command

    def observe(self, t: float, reading: Reading) -> None:
        """Take a reading into the estimate without asking for a command, as `step` does before it plans.

        Raises
        ------
        SynthesisError
            A time that is no finite number, or when anything but a reading of these sensors is shown.
        """
        self._refuse_others(reading)
        self._look(sampled_at(t), reading)
        self._remember()

    def _remember(self) -> None:
        assert self._looked is not None
        look, rest = self._looked, self.linear.equilibrium.inputs
        self._memory = look.estimate, commands_now(self.linear, look.reading) - rest, look.target

    def _seen(self, measurement: Any, inputs: np.ndarray, commands: np.ndarray) -> Reading:
        """The reading, with known inputs: the filter goes on without what is missing."""
        missing = np.full(self.sensors.noise.size, np.nan)
        return Reading(missing if measurement is None else np.asarray(measurement.values), inputs, commands)

    def _tensions_of(self, look: Reading) -> tuple[np.ndarray, np.ndarray]:
        """Tensions where sensors read them, and as many deviations as noise stays within."""
        first, measured = self.sensors.lengths.size, self.sensors.tensions
        shown = slice(first, first + measured.size)
        tensions = np.full(len(self.linear.dynamics.structure.tendons), np.nan)
        noise = np.zeros_like(tensions)
        tensions[measured], noise[measured] = look.values[shown], _SURE * self.sensors.noise[shown]
        return tensions, noise

    def _margin_at_next(self, t: float, piece: Any, limits: Limits) -> Float[np.ndarray, " nT"]:
        """The target's own: it stays for the whole horizon."""
        return limits.tension_margin[0]

    def _refuse(self, measurement: Any) -> None:
        if measurement is not None:
            self._refuse_others(measurement)

    def _refuse_others(self, measurement: object) -> None:
        shapes = (self.sensors.noise.shape, (len(self.linear.inputs),))
        if (
            not isinstance(measurement, Reading)
            or (np.shape(measurement.values), np.shape(measurement.inputs)) != shapes
        ):
            raise SynthesisError(
                f"this MPC is shown what its {self.sensors.noise.size} sensors read, and {len(self.linear.inputs)} "
                "inputs; give step(t, mpc.sensors.read(measurement, sample))."
            )

    def limits(self, t: float, measurement: Any) -> Limits:
        """Start and bounds of the problem at time t, about the target."""
        look = self._look(t, measurement)
        nx, target, problem = len(self.linear.A), look.target, self.problem
        d, rest = look.estimate.mean[nx:], self.linear.equilibrium
        piece = self._piece(0)
        commands = commands_now(self.linear, measurement) - rest.inputs
        state, inputs = self._when_it_acts(piece, look.estimate.mean[:nx], commands)
        state = state + self.carried @ d
        at_rest = np.concatenate([target.state, target.inputs])
        margin = self.margin_at_rest + problem.tension @ at_rest + self.tension_shown @ d
        motion, course, tensions = self._motion(t)
        ahead = rest.inputs + target.inputs + course[1:]
        start, margin = np.concatenate([state, inputs]) - at_rest - motion, margin + tensions
        change, (lower, upper), reach = np.diff(course, axis=0), self.hard.range, self.hard.reach
        wanted, plan = self._wanted(piece, t), None if self._plan is None else self._continued(self._plan) - ahead
        return Limits(start, margin, lower - ahead, upper - ahead, -reach - change, reach - change, ahead, wanted, plan)

    def _motion(self, t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the path adds to its own rest when a command begins to act: state and inputs then, inputs, tensions."""
        acts, path, linear, problem = t + self.delay, self.wanted, self.linear, self.problem
        times = np.append(acts, self._ends(t))
        nu, nT = len(linear.inputs), problem.tendons.size
        if rests(path, t - self.dt if linear.lag else t):
            return np.zeros(len(linear.A) + nu), np.zeros((self.horizon + 1, nu)), np.zeros((self.horizon, nT))
        course = commands_along(path, times, linear.lag, self.dt) - path.inputs_at(acts)
        tensions = problem.scaled(path.tensions_at(times[1:]) - path.tensions_at(acts))
        return np.concatenate([self.moving_state(acts), course[0]]), course, tensions

    def moving_state(self, t: float) -> Float[np.ndarray, " nx"]:
        """What the velocities of the path add to its state at a time."""
        nodes, inputs = self.wanted.nodes_at(t), self.wanted.inputs_at(t)
        moving = self.linear.seen(nodes, self.wanted.velocities_at(t), inputs)
        return moving - self.linear.seen(nodes, 0 * nodes, inputs)

    def _look(self, t: float, reading: Reading) -> _Look:
        """Estimate and target of a reading; the controller's memory stays as it is."""
        if self._looked is None or self._looked.reading is not reading:
            estimate = self._estimated(reading)
            self._looked = _Look(reading, estimate, self._rest_under(t, estimate))
        return self._looked

    def _estimated(self, reading: Reading) -> Estimate:
        rest = self.linear.equilibrium
        u, y = commands_now(self.linear, reading) - rest.inputs, reading.values - self.sensors.of(rest)
        if self._memory is None:
            before = self.filter.begin()
            if self.linear.lag:  # rest lengths are known from the start
                moving, nx = len(self.linear.mechanics.A), len(self.linear.A)
                before.mean[moving:nx] = reading.inputs - rest.inputs
            return self.filter.update(before, before.mean, y, u)
        before, inputs, _ = self._memory
        return self.filter.update(before, self.filter.predict(before, inputs, u), y, u)

    def _rest_under(self, t: float, estimate: Estimate) -> Target:
        rest, when = self.linear.equilibrium, t + self.delay
        last = None if self._memory is None else self._memory[2]
        target = self.programme.at(
            estimate.mean[len(self.linear.A) :],
            self.wanted_at(when),
            self.wanted.inputs_at(when) - rest.inputs,
            self.target_range,
            self.margin_at_rest,
            last,
        )
        if target is not None:
            return target
        if last is not None:
            return last
        still = np.zeros(rest.inputs.size)
        return Target(np.zeros(len(self.linear.A)), still, np.nan, np.nan, still)

    def _path_ahead(self, t: float) -> tuple[Reference, np.ndarray]:
        """The path itself."""
        return self.wanted, self._ends(t)

    def wanted_at(self, t: float) -> np.ndarray:
        """Deviation of what is tracked from the equilibrium's."""
        rest, s = self.linear.equilibrium, self.sensors
        nodes = self.wanted.nodes_at(t)
        shown = np.concatenate([
            s.structure.lengths_at(nodes)[s.lengths], self.wanted.tensions_at(t)[s.tensions], nodes.ravel()[s.positions]
        ])  # fmt: skip
        return (shown - s.of(rest))[self.tracked]

    @cached_property
    def target_range(self) -> tuple[Float[np.ndarray, " nu"], Float[np.ndarray, " nu"]]:
        """Least and largest inputs of a target, deviations from the equilibrium's, m.

        No target pays out more than the longest tendon: what cannot be reached asks for no more.
        """
        rest = self.linear.equilibrium
        lower, upper = (bound - rest.inputs for bound in self.hard.range)
        return np.maximum(lower, -float(rest.lengths.max())), upper

    @cached_property
    def margin_at_rest(self) -> Float[np.ndarray, " nT"]:
        """How far tensions of the equilibrium are within their limits, scaled, m."""
        return self.problem.margin(self.linear.equilibrium.tensions, self.tension_min)

    @cached_property
    def tension_shown(self) -> Float[np.ndarray, "nT nd"]:
        """What sensors of tension are believed to miss, scaled, m."""
        problem, measured = self.problem, self.sensors.tensions
        first = self.sensors.lengths.size
        rows = np.zeros((len(self.linear.dynamics.structure.tendons), self.model.shown.shape[1]))
        rows[measured] = self.model.shown[first : first + measured.size]
        return rows[problem.tendons] * (problem.side / problem.tension_scale)[:, None]

    @cached_property
    def programme(self) -> SteadyTarget:
        """Where to rest under what is estimated."""
        return SteadyTarget(self.model, self.tracked, self.problem.tension, self.tension_shown)

    @cached_property
    def carried(self) -> Float[np.ndarray, "nx nd"]:
        """What constant disturbances do until a command acts."""
        if not self.delay:
            return np.zeros_like(self.model.force)
        held = sample_ramped(self.linear.A, self.model.force, self.delay)
        return held.G0 + held.G1


def _tracked(sensors: Sensors, track: str | tuple[str, ...] | None) -> np.ndarray:
    """Which sensors are to reach what is wanted."""
    if track is not None:
        patterns = (track,) if isinstance(track, str) else track
        if not (isinstance(patterns, Sequence) and patterns and all(isinstance(one, str) for one in patterns)):
            raise SynthesisError(f'track is {shown(track)}; patterns of sensor labels are expected, such as "l_*".')
        return np.unique([k for pattern in patterns for k in matches(sensors.labels, pattern, "track")])
    first, last = sensors.lengths.size, sensors.lengths.size + sensors.tensions.size
    shape = np.r_[0:first, last : sensors.noise.size]
    return shape if shape.size else np.arange(sensors.noise.size)
