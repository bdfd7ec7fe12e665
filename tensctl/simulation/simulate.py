"""What then happens: the nonlinear structure over time, alone or under a controller.

The controller is asked every `dt`; rest lengths ramp from where they are to its command, which they reach at the end of
the period, no faster than `rate_max` and never below their floors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.plant import Method, choose_integrator, state_at
from tensctl.simulation.run import Run
from tensctl.statics import Equilibrium
from tensctl.structure import lengths, matches

# Control period, s, of a controller that names none: the scene's own default.
_PERIOD = 0.02

Start = Equilibrium | np.ndarray | tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Push:
    """A disturbance: a force on a node for a while.

    Attributes
    ----------
    node : str
        Label or pattern.
    force : (3,) N
    start, stop : float, s
    """

    node: str
    force: Sequence[float]
    start: float
    stop: float


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a controller is shown.

    Attributes
    ----------
    nodes, velocities : (N, 3) m, m/s
    lengths, tensions : (nt,) m, N
    inputs : (nu,) m
        Rest-length changes u as they are now.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    velocities: Float[np.ndarray, "nodes 3"]
    lengths: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    inputs: Float[np.ndarray, " inputs"]


class Controller(Protocol):
    """Anything that turns measurements into the total rest-length change u."""

    def step(self, t: float, measurement: Measurement) -> np.ndarray:
        """Total rest-length change u from L0, (nu,) m, to be reached at the end of the period."""
        ...

    def reset(self) -> None:
        """Forget what earlier runs left behind."""
        ...


class Counter(Protocol):
    """What shows the progress of a run."""

    def advance(self, n: int = 1) -> None:
        """Count n more steps as done."""
        ...


def simulate(
    dynamics: Dynamics,
    start: Start,
    *,
    controller: Controller | None = None,
    t_end: float | None = None,
    timepts: Sequence[float] | np.ndarray | None = None,
    dt: float | None = None,
    rate_max: float = np.inf,
    pushes: Sequence[Push] = (),
    method: Method = "auto",
    tol: float = 1e-10,
    progress: Counter | None = None,
) -> Run:
    """Run the nonlinear structure.

    Parameters
    ----------
    dynamics : Dynamics
    start : Equilibrium, (N, 3) nodes at rest, or (nodes, velocities)
        An equilibrium brings its rest lengths along.
    controller : optional
        An object with `step(t, measurement) -> u` and `reset()`.
    t_end : float, s
        End of the run; the last of `timepts` by default.
    timepts : (t,) s, optional
        Times to record; every control sample, or 500 steps without a controller, by default.
    dt : float, s, optional
        Control period; the controller's own `dt` by default, 0.02 s when it has none.
    rate_max : float, m/s
        Fastest that a rest length can change.
    pushes : sequence of Push
    method : "auto", "splitting4", "dopri5"
    tol : float
        Error per step over the size of the structure.

    Raises
    ------
    SimulationError
        A start, time or controller that does not fit, or a motion that cannot be followed.
    """
    times = _times(t_end, timepts, controller, dt)
    recorder = _Plant(dynamics, start, method, tol)
    forces = _Disturbances(dynamics, pushes)
    period = None if controller is None else _period(controller, dt)
    if controller is not None:
        controller.reset()
    edges = _edges(times, forces.edges, period)
    is_sample = np.zeros(edges.size, bool) if period is None else _samples(edges, period)
    is_record = np.isin(edges, times)
    for k, t in enumerate(edges):
        if controller is not None and is_sample[k] and period is not None:
            recorder.command(controller, t, period, rate_max)
            if progress is not None:
                progress.advance()
        if is_record[k]:
            recorder.record(t, controller)
        if k + 1 < edges.size:
            recorder.advance(t, edges[k + 1], forces.at(0.5 * (t + edges[k + 1])))
    return recorder.finished(controller)


def control_steps(t_end: float, period: float) -> int:
    """How many control steps a run takes, for progress bars."""
    return int(np.floor(t_end / period * (1 + 1e-12))) + 1


def _times(t_end, timepts, controller, dt) -> np.ndarray:
    if timepts is not None:
        times = np.asarray(timepts, float)
        if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise SimulationError("timepts must be finite times in ascending order, in s.")
        if times[0] < 0:
            raise SimulationError(f"timepts start at {times[0]:g} s; a run starts at 0.")
        return times
    if t_end is None or not (np.isfinite(t_end) and t_end > 0):
        raise SimulationError(f"t_end = {t_end}: give the end of the run in s, > 0, or timepts.")
    step = t_end / 500 if controller is None else _period(controller, dt)
    count = int(np.floor(t_end / step * (1 + 1e-12)))
    return np.unique(np.append(step * np.arange(count + 1), t_end)) if controller else np.linspace(0, t_end, 501)


def _period(controller: Controller, dt: float | None) -> float:
    period = getattr(controller, "dt", _PERIOD) if dt is None else dt
    if not (np.isfinite(period) and period > 0):
        raise SimulationError(f"the control period dt is {period}; a time > 0 s is expected.")
    return float(period)


def _edges(times: np.ndarray, pushes: np.ndarray, period: float | None) -> np.ndarray:
    """Every time at which something changes or is recorded, merged when they differ by rounding only."""
    end = times[-1]
    samples = np.zeros(0) if period is None else period * np.arange(control_steps(end, period))
    rest = np.concatenate([[0.0], samples, pushes])
    rest = rest[rest <= end * (1 + 1e-12)]
    near = np.abs(rest[:, None] - times[None]).min(axis=1, initial=np.inf) <= 1e-12 * max(end, 1e-300)
    merged = np.unique(np.concatenate([times, rest[~near]]))
    return merged[np.concatenate([[True], np.diff(merged) > 1e-12 * max(end, 1e-300)])]


def _samples(edges: np.ndarray, period: float) -> np.ndarray:
    phase = edges / period
    return np.abs(phase - np.rint(phase)) <= 1e-9


class _Disturbances:
    """Constant loads and pushes as nodal forces."""

    def __init__(self, dynamics: Dynamics, pushes: Sequence[Push]) -> None:
        self._constant = dynamics.members.forces
        labels = dynamics.structure.node_labels
        self._pushes = [(matches(labels, push.node, "push.node"), push) for push in pushes]
        self.edges = np.array([t for push in pushes for t in (push.start, push.stop) if t > 0], float)

    def at(self, t: float) -> np.ndarray:
        forces = self._constant.copy()
        for nodes, push in self._pushes:
            if push.start <= t < push.stop:
                forces[nodes] += np.asarray(push.force, float)
        return forces


class _Plant:
    """State of a run and what was recorded of it."""

    def __init__(self, dynamics: Dynamics, start: Start, method: Method, tol: float) -> None:
        nodes, velocities, rest = _start(dynamics, start)
        self._dynamics, self._integrator = dynamics, choose_integrator(dynamics, method, tol)
        self._q, self._v = state_at(dynamics, nodes, velocities)
        self._nodes = dynamics.structure.nodes
        self._rest, self._rate = rest, np.zeros_like(rest)
        self._rows: list[tuple] = []
        self._status = ""

    def command(self, controller: Controller, t: float, period: float, rate_max: float) -> None:
        """Ask the controller; from now on rest lengths ramp towards its answer."""
        members = self._dynamics.members
        u = np.asarray(controller.step(float(t), self._measurement()), float)
        if u.shape != members.inputs.shape or not np.isfinite(u).all():
            raise SimulationError(
                f"at {t:g} s the controller gave u of shape {u.shape}; finite {members.inputs.shape} is expected."
            )
        wanted = members.rest_lengths[members.inputs] - u
        wanted = np.maximum(wanted, members.floors[members.inputs])
        change = np.clip(wanted - self._rest[members.inputs], -rate_max * period, rate_max * period)
        self._rate = np.zeros_like(self._rest)
        self._rate[members.inputs] = change / period
        records = getattr(controller, "records", None)
        self._status = records[-1].status if records else "ok"

    def advance(self, t0: float, t1: float, forces: np.ndarray) -> None:
        """Move to the next edge."""
        self._integrator.advance(self._q, self._v, t0, t1, self._rest, self._rate, forces)
        self._rest = self._rest + (t1 - t0) * self._rate
        if not np.isfinite(self._q).all():
            raise SimulationError(f"the motion could not be followed beyond {t0:g} s; use a smaller tol.")

    def record(self, t: float, controller: Controller | None) -> None:
        """Keep the state."""
        m = self._measurement()
        self._rows.append((t, m.nodes, m.velocities, m.lengths, m.tensions, self._rest, m.inputs, self._status))

    def finished(self, controller: Controller | None) -> Run:
        """The run."""
        time, nodes, velocities, length, tension, rest, inputs, status = zip(*self._rows, strict=True)
        records = getattr(controller, "records", [])
        return Run(
            structure=self._dynamics.structure, time=np.array(time), nodes=np.stack(nodes),
            velocities=np.stack(velocities), lengths=np.stack(length), tensions=np.stack(tension),
            rest_lengths=np.stack(rest), inputs=np.stack(inputs), input_labels=self._dynamics.input_labels,
            status=np.array(status), sample_time=np.array([r.time for r in records]),
            solve_time=np.array([r.solve_time for r in records]), kkt=np.array([r.kkt for r in records]),
            relaxed=np.array([r.relaxed for r in records]), method=self._integrator.name,
            evaluations=self._integrator.evaluations, switches=self._integrator.switches,
        )  # fmt: skip

    def _measurement(self) -> Measurement:
        members, tendons = self._dynamics.members, self._dynamics.structure.tendons
        nodes, velocities = self._placed(self._q, self._nodes), self._placed(self._v, np.zeros_like(self._nodes))
        length = lengths(nodes, tendons)
        stiffness = members.stiffness if members.law == "k" else members.stiffness / self._rest
        tension = stiffness * (length - self._rest)
        if self._dynamics.damping.any():
            d, rate = (a[tendons[:, 1]] - a[tendons[:, 0]] for a in (nodes, velocities))
            closing = np.einsum("ti,ti->t", d, rate) / np.where(length > 0, length, 1.0)
            tension = tension + self._dynamics.damping * closing
        tension = np.where(length > self._rest, np.maximum(tension, 0.0), 0.0)
        u = (members.rest_lengths - self._rest)[members.inputs]
        return Measurement(nodes, velocities, length, tension, u)

    def _placed(self, q: np.ndarray, base: np.ndarray) -> np.ndarray:
        placed, rods = base.copy(), self._dynamics.structure.rods
        moving = self._dynamics.potential.manifold.moving
        placed[rods[moving, 0]] = 0.5 * (q[moving, :3] - q[moving, 3:])
        placed[rods[moving, 1]] = 0.5 * (q[moving, :3] + q[moving, 3:])
        return placed


def _start(dynamics: Dynamics, start: Start) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if isinstance(start, Equilibrium):
        return start.nodes, np.zeros_like(start.nodes), start.rest_lengths.copy()
    nodes, velocities = start if isinstance(start, tuple) else (start, np.zeros_like(np.asarray(start, float)))
    return np.asarray(nodes, float), np.asarray(velocities, float), dynamics.members.rest_lengths.copy()
