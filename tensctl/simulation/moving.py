"""The structure in motion: its state, its rest lengths, and what was recorded of them."""

from __future__ import annotations

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.controller import Controller, Measurement
from tensctl.simulation.plant import Method, choose_integrator, state_at
from tensctl.simulation.run import Run
from tensctl.statics import Equilibrium
from tensctl.structure import lengths
from tensctl.synthesis import StepRecord

Start = Equilibrium | np.ndarray | tuple[np.ndarray, np.ndarray]


class Moving:
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
        records = _records(controller)
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
        records = _records(controller)
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


def _records(controller: Controller | None) -> list[StepRecord]:
    """What a controller that solves problems recorded of its steps; other controllers keep what they like."""
    kept = getattr(controller, "records", None)
    return [r for r in kept if isinstance(r, StepRecord)] if isinstance(kept, list) else []


def _start(dynamics: Dynamics, start: Start) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    if isinstance(start, Equilibrium):
        return start.nodes, np.zeros_like(start.nodes), start.rest_lengths.copy()
    nodes, velocities = start if isinstance(start, tuple) else (start, np.zeros_like(np.asarray(start, float)))
    return np.asarray(nodes, float), np.asarray(velocities, float), dynamics.members.rest_lengths.copy()
