"""The structure in motion: its state, what acts on it, and what was recorded of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.model.tensions import tensions_at
from tensctl.scene.given import real
from tensctl.simulation.actuators import Actuators
from tensctl.simulation.controller import Controller, Measurement, ask
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators import Choice, carried_by
from tensctl.simulation.loads import Load, Loads
from tensctl.simulation.record import Record, placed
from tensctl.simulation.run import Run
from tensctl.statics import Equilibrium
from tensctl.synthesis import StepRecord

Start = Equilibrium | np.ndarray | tuple[Equilibrium | np.ndarray, np.ndarray]

_START = "an Equilibrium, nodes (N, 3) in m, or either in a pair with velocities (N, 3) in m/s"


class Moving:
    """State of a run and what was recorded of it."""

    def __init__(
        self, dynamics: Dynamics, choice: Choice, state: tuple[np.ndarray, np.ndarray], actuators: Actuators,
        loads: Sequence[Load], times: np.ndarray, room: int | None = None,
    ) -> None:  # fmt: skip
        self._dynamics, self._choice = dynamics, choice
        self._q, self._v = state
        self.actuators, self._loads = actuators, Loads(dynamics, loads)
        rods, tendons = len(dynamics.structure.rods), len(dynamics.structure.tendons)
        self._lags = dynamics.members.lag > 0
        self._record = Record(times, rods, tendons, room, lags=self._lags)
        self._status, self._told = "", 0
        self.delayed = False
        self._due: np.ndarray | None = None

    def command(self, controller: Controller, t: float, period: float) -> None:
        """Ask the controller; rest lengths ramp towards its answer from now on, or when it is due."""
        wanted = (self._dynamics.members.gearing.size,)
        answer = ask(controller, float(t), period, self._measurement())
        u = real(f"u, which the controller gave at {t:g} s,", answer, f"an array of shape {wanted}", SimulationError)
        if u.shape != wanted or not np.isfinite(u).all():
            raise SimulationError(f"at {t:g} s the controller gave u of shape {u.shape}; finite {wanted} is expected.")
        if self.delayed:
            self._due = u
        else:
            self.actuators.command(u, period)
        last = _last_record(controller)
        self._status = "ok" if last is None else last.status
        self._record.mark(t, self._status)

    def act(self, period: float) -> None:
        """From now on rest lengths ramp towards the answer that took its time."""
        if self._due is not None:
            self.actuators.command(self._due, period)

    def begin(self, t: float) -> None:
        """Record the start, when it is asked for."""
        if self._record.times[0] == t:
            rest, asked = self.actuators.rest[None], self.actuators.asked[None]
            self._record.put(slice(0, 1), self._q[None], self._v[None], rest, asked, self._status)

    def advance(self, t0: float, t1: float) -> None:
        """Move from one edge to the next, and record what lies between."""
        rows = self._record.between(t0, t1)
        inside = self._record.times[rows]
        times = np.array([t0, *inside, *(() if inside.size and inside[-1] == t1 else (t1,))])
        q, v = (np.empty((times.size, *self._q.shape)) for _ in range(2))
        self._choice.integrator.march(self._q, self._v, times, self._drive(t0, t1), q, v)
        if not np.isfinite(self._q).all():
            raise SimulationError(f"the motion could not be followed beyond {t0:g} s; use a smaller tol.")
        kept, asked = slice(1, 1 + inside.size), None
        if self._lags:
            asked = self.actuators.asked_after(inside - t0)
        rest = self.actuators.advance(times[1:] - t0)
        self._record.put(rows, q[kept], v[kept], rest[: inside.size], asked, self._status)

    def turn(self, controller: Controller | None) -> None:
        """Forget what is recorded so far, and go on with the next chunk."""
        self._record.turn_to(self._record.first + self._record.here.size)
        self._told = len(_records(controller))

    def state(self) -> dict[str, np.ndarray]:
        """All that the motion from here on depends on."""
        actuators = self.actuators
        carried = {f"integrator.{name}": np.asarray(value) for name, value in carried_by(self._choice.integrator)}
        due = {} if self._due is None else {"due": self._due}
        return carried | due | {
            "q": self._q, "v": self._v, "rest": actuators.rest, "asked": actuators.asked, "rate": actuators.rate,
        }  # fmt: skip

    def restore(self, state: dict[str, np.ndarray], count: int, status: str) -> None:
        """Be where `state` was given, with so many records behind, and what the controller said last.

        Raises
        ------
        SimulationError
            When the integrator carries along more than it did then.
        """
        integrator = self._choice.integrator
        carried = {name: f"integrator.{name}" for name, _ in carried_by(integrator)}
        if not set(carried.values()) <= set(state):
            raise SimulationError(f"the run was recorded by another version of {integrator.name}; start it again.")
        self._record.turn_to(count)
        self._q, self._v, self._status, self._due = state["q"], state["v"], status, state.get("due")
        self.actuators.rest, self.actuators.asked, self.actuators.rate = (state[k] for k in ("rest", "asked", "rate"))
        for name, value in carried_by(integrator):
            setattr(integrator, name, type(value)(state[carried[name]]))

    def finished(self, controller: Controller | None) -> Run:
        """The run, as far as it is still remembered."""
        integrator, records = self._choice.integrator, _records(controller)[self._told :]
        return Run(
            **self._record.motion(self._dynamics),
            structure=self._dynamics.structure, input_labels=self._dynamics.input_labels,
            sample_time=np.array([r.time for r in records]),
            solve_time=np.array([r.solve_time for r in records]), kkt=np.array([r.kkt for r in records]),
            relaxed=np.array([r.relaxed for r in records]),
            margin_gap=np.array([r.margin_gap for r in records], float),
            parted=np.array([r.parted for r in records], int), method=integrator.name, why=self._choice.why,
            evaluations=integrator.evaluations, switches=integrator.switches,
            local_errors=integrator.local_errors,
        )  # fmt: skip

    def _drive(self, t0: float, t1: float) -> Drive:
        actuators, acting = self.actuators, self._loads.between(t0, t1)
        lag, tau, layout = actuators.lag(), self._dynamics.members.lag, self._dynamics.layout
        return Drive(
            float(t0), actuators.rest, actuators.rate, lag, tau if tau > 0 else 1.0, layout.spread(acting.force),
            layout.spread(acting.force_rate), layout.place[acting.wave_node], acting.wave_force, acting.wave_omega,
            acting.wave_phase, bool(actuators.rate.any() or lag.any()), bool(acting.force_rate.any() or
            acting.wave_node.size),
        )  # fmt: skip

    def _measurement(self) -> Measurement:
        structure, rest = self._dynamics.structure, self.actuators.rest
        nodes, velocities = placed(structure, self._q[None], self._v[None])
        length = structure.lengths_at(nodes[0])
        tension = tensions_at(self._dynamics, nodes, velocities, length[None], rest[None])
        inputs = self.actuators.inputs
        commands = self.actuators.asked_inputs if self._lags else inputs
        return Measurement(nodes[0], velocities[0], length, tension[0], inputs, commands)


def _last_record(controller: Controller | None) -> StepRecord | None:
    """What a controller recorded of its latest step."""
    kept = getattr(controller, "records", None)
    return kept[-1] if isinstance(kept, list) and kept and isinstance(kept[-1], StepRecord) else None


def _records(controller: Controller | None) -> list[StepRecord]:
    """What a controller that solves problems recorded of its steps; other controllers keep what they like."""
    kept = getattr(controller, "records", None)
    return [r for r in kept if isinstance(r, StepRecord)] if isinstance(kept, list) else []


def started(dynamics: Dynamics, start: Start) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes, velocities and rest lengths of a start; an equilibrium brings its rest lengths along.

    Raises
    ------
    SimulationError
        What is no start.
    """
    at, velocities = start if isinstance(start, tuple) and len(start) == 2 else (start, None)
    if isinstance(at, Equilibrium):
        nodes, rest = at.nodes, at.rest_lengths
    else:
        nodes, rest = real("start", at, _START, SimulationError), dynamics.members.rest_lengths
    velocities = np.zeros_like(nodes) if velocities is None else real("start[1]", velocities, _START, SimulationError)
    return nodes, velocities, rest.copy()
