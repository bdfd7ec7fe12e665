"""One motion, to be run in several ways, and what each way keeps of rod lengths, energy and momentum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tensctl.model import Dynamics, build_dynamics
from tensctl.simulation import Load, Push, Run, Schedule, momenta, simulate, total_energy
from tensctl.simulation.asked import loads_of, rests_first, schedule_of, start_of
from tensctl.simulation.integrators import Method
from tensctl.simulation.moving import Start
from tensctl.statics import find_equilibrium

if TYPE_CHECKING:
    from tensctl.scene import Scene

_RECORDS = 51


@dataclass(frozen=True, eq=False)
class Motion:
    """The same start, loads and schedule, over the same time."""

    dynamics: Dynamics
    start: Start
    pushes: tuple[Load, ...]
    schedule: tuple[Schedule, ...]
    t_end: float

    @classmethod
    def of(cls, scene: Scene, longest: float) -> Motion:
        """The scene's own motion without its controller, at most so long, s.

        A start at rest that only the controller would disturb is a release from the initial nodes. Where pushes alone
        disturb it, the first begins at once.
        """
        dynamics, asked = build_dynamics(scene), scene.simulation
        if asked is None:
            return cls(dynamics, dynamics.structure.nodes, (), (), longest)
        alone = asked.model_copy(update={"controller": "none"})
        loads, schedule = loads_of(alone), schedule_of(alone)
        pushed_only = alone.push and len(loads) == len(alone.push) and not schedule
        if pushed_only and alone.velocity is None and alone.spin is None:
            first = min(push.start for push in alone.push)
            loads = [Push(p.node, p.force, p.start - first, p.stop - first) for p in alone.push]
        start = start_of(alone, dynamics, find_equilibrium(scene) if rests_first(alone) else None)
        return cls(dynamics, start, tuple(loads), tuple(schedule), min(asked.t_end, longest))

    @property
    def size(self) -> float:
        """Largest extent of the structure, m."""
        return float(np.ptp(self.dynamics.structure.nodes, axis=0).max())

    def shorter(self, share: float) -> Motion:
        """Its beginning, up to so much of its time."""
        return replace(self, t_end=share * self.t_end)

    def run(self, method: Method, tol: float) -> Run:
        """Run it in one way."""
        times = np.linspace(0, self.t_end, _RECORDS)
        return simulate(
            self.dynamics, self.start, timepts=times, pushes=self.pushes, schedule=self.schedule, method=method, tol=tol
        )  # fmt: skip

    def drifts(self, run: Run) -> tuple[float, float]:
        """Relative drift of energy and of momentum, each nan where the scene itself changes it."""
        energy = momentum = np.nan
        if not (self.dynamics.damped or self.pushes or self.schedule):
            total = total_energy(self.dynamics, run)
            energy = float(np.ptp(total) / max(np.abs(total).max(), 1e-300))
        if not self._pushed_from_outside:
            momentum = max(_change(each, scale) for each, scale in _about_centre(self.dynamics, run))
        return energy, momentum

    @property
    def _pushed_from_outside(self) -> bool:
        """Whether drag, weight, loads or the ground act; what tendons do, dampers and inputs too, keeps momentum."""
        constant = bool(self.dynamics.members.forces.any())
        return self.dynamics.drag > 0 or constant or bool(self.pushes) or bool(self.dynamics.structure.held.any())


def distance(run: Run, reference: Run) -> float:
    """Largest distance of a node to where it is in another run at the same time, m."""
    return float(np.linalg.norm(run.nodes - reference.nodes, axis=2).max())


def _about_centre(dynamics: Dynamics, run: Run) -> tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]:
    """Linear and angular momentum about the mass centre, (t, 3), each with the size to compare its change with."""
    rods, mass = dynamics.structure.rods, dynamics.members.mass
    centre = np.einsum("r,tri->ti", mass, run.nodes[:, rods].mean(axis=2)) / mass.sum()
    linear, angular = momenta(dynamics, run)
    scale = float(mass.sum() * np.linalg.norm(run.velocities, axis=2).max())
    size = float(np.ptp(dynamics.structure.nodes, axis=0).max())
    return (linear, scale), (angular - np.cross(centre, linear), scale * size)


def _change(momentum: np.ndarray, scale: float) -> float:
    return float(np.linalg.norm(momentum - momentum[0], axis=1).max() / max(scale, 1e-300))
