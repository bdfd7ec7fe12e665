"""Nodal forces over time: constant loads and weight, pushes, histories and waves.

push     F between start and stop            wave   F sin(2 pi f t + phase) between start and stop
history  F interpolated linearly between times, held before and after
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene import PushRequest, WaveRequest
from tensctl.scene.given import argument, endless, real
from tensctl.scene.values import Text
from tensctl.simulation.times import ascends
from tensctl.structure import matches


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

    def __post_init__(self) -> None:
        """Check the push as a scene's `[[simulation.push]]` is.

        Raises
        ------
        SceneError
            A force that is no three finite numbers, or a time that does not come after the other.
        """
        PushRequest.checked(node=self.node, force=self.force, start=self.start, stop=self.stop)

    def at(self, t: float) -> np.ndarray:
        """Force at time t, (3,) N."""
        return np.asarray(self.force, float) * (self.start <= t < self.stop)


@dataclass(frozen=True)
class Wave:
    """A sinusoidal force on a node.

    Attributes
    ----------
    node : str
        Label or pattern.
    force : (3,) N
        Amplitude.
    frequency : float, Hz
    phase : float, rad
    start, stop : float, s
    """

    node: str
    force: Sequence[float]
    frequency: float
    phase: float = 0.0
    start: float = 0.0
    stop: float = np.inf

    def __post_init__(self) -> None:
        """Check the wave as a scene's `[[simulation.wave]]` is.

        Raises
        ------
        SceneError
            A force that is no three finite numbers, a frequency that is not positive, times out of order.
        """
        WaveRequest.checked(
            node=self.node, force=self.force, frequency=self.frequency, phase=self.phase, start=self.start,
            stop=None if endless(self.stop) else self.stop,
        )  # fmt: skip

    def at(self, t: float) -> np.ndarray:
        """Force at time t, (3,) N."""
        swing = np.sin(2 * np.pi * self.frequency * t + self.phase) * (self.start <= t < self.stop)
        return swing * np.asarray(self.force, float)


@dataclass(frozen=True)
class History:
    """A force on a node from a table of times, linear in between and held at its ends.

    Attributes
    ----------
    node : str
        Label or pattern.
    times : (k,) s, ascending
    forces : (k, 3) N
    """

    node: str
    times: Sequence[float]
    forces: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        """Check the table.

        Raises
        ------
        SimulationError
            Times that do not ascend, or a table of another shape or of no numbers.
        """
        argument("node", self.node, Text("a label or pattern"), SimulationError)
        times = real(f"times of a load on {self.node}", self.times, "a list of finite times, s,", SimulationError)
        forces = real(f"forces of a load on {self.node}", self.forces, "a list of [x, y, z], N,", SimulationError)
        if not ascends(times):
            raise SimulationError(f"the times of a load on {self.node} must be finite and ascending, in s.")
        if forces.shape != (times.size, 3) or not np.isfinite(forces).all():
            raise SimulationError(
                f"the forces of a load on {self.node} have shape {forces.shape}; finite {(times.size, 3)} is expected."
            )

    def at(self, t: float) -> np.ndarray:
        """Force at time t, (3,) N."""
        forces = np.asarray(self.forces, float)
        return np.array([np.interp(t, self.times, forces[:, i]) for i in range(3)])


Load = Push | Wave | History


@dataclass(frozen=True, eq=False)
class Acting:
    """Loads on one interval, as `Drive` has them: (N, 3) at its start, (N, 3) per second, and waves."""

    force: np.ndarray
    force_rate: np.ndarray
    wave_node: np.ndarray
    wave_force: np.ndarray
    wave_omega: np.ndarray
    wave_phase: np.ndarray


class Loads:
    """All loads of a run."""

    def __init__(self, dynamics: Dynamics, loads: Sequence[Load]) -> None:
        self._constant = dynamics.members.forces
        labels = dynamics.structure.node_labels
        self._loads = [(matches(labels, load.node, f"{type(load).__name__.lower()}.node"), load) for load in loads]
        self._steady = not any(isinstance(load, History) for load in loads)
        self._last: tuple[list[bool], Acting] | None = None

    @property
    def edges(self) -> np.ndarray:
        """Times at which a load begins, bends or ends, s."""
        found: list[float] = []
        for _, load in self._loads:
            found += list(load.times) if isinstance(load, History) else [load.start, load.stop]
        return np.array([t for t in found if 0 < t < np.inf], float)

    def at(self, t: float) -> np.ndarray:
        """Forces at time t, (N, 3) N."""
        forces = self._constant.copy()
        for nodes, load in self._loads:
            forces[nodes] += load.at(t)
        return forces

    def between(self, t0: float, t1: float) -> Acting:
        """What acts on an interval without an edge inside; what was said before where nothing has changed."""
        middle = 0.5 * (t0 + t1)
        acts = [isinstance(load, History) or load.start <= middle < load.stop for _, load in self._loads]
        if self._last is None or not self._steady or self._last[0] != acts:
            self._last = acts, self._sum(acts, t0, t1)
        return self._last[1]

    def _sum(self, acts: list[bool], t0: float, t1: float) -> Acting:
        """Some of the loads taken together."""
        force, rate, waves = self._constant.copy(), np.zeros_like(self._constant), []
        for nodes, load in (load for load, here in zip(self._loads, acts, strict=True) if here):
            if isinstance(load, History):
                first, last = load.at(t0), load.at(t1)
                force[nodes] += first
                rate[nodes] += (last - first) / (t1 - t0)
            else:
                amplitude = np.asarray(load.force, float)
                if isinstance(load, Push):
                    force[nodes] += amplitude
                else:
                    waves += [(node, amplitude, 2 * np.pi * load.frequency, load.phase) for node in nodes]
        return Acting(
            force,
            rate,
            np.array([w[0] for w in waves], np.int64),
            np.array([w[1] for w in waves], float).reshape(-1, 3),
            np.array([w[2] for w in waves], float),
            np.array([w[3] for w in waves], float),
        )
