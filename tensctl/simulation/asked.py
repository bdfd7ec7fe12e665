"""From a scene's `[simulation]` to the arguments of `simulate`: where it starts, what pushes it, what is planned."""

from __future__ import annotations

import numpy as np

from tensctl.model import Dynamics
from tensctl.scene import SimulationStage
from tensctl.simulation.loads import History, Load, Push, Wave
from tensctl.simulation.moving import Start
from tensctl.simulation.schedule import Schedule
from tensctl.statics import Equilibrium, mass_centre


def loads_of(asked: SimulationStage) -> list[Load]:
    """Forces over time that the scene asks for."""
    pushes = [Push(p.node, p.force, p.start, p.stop) for p in asked.push]
    waves = [
        Wave(w.node, w.force, w.frequency, w.phase, w.start, np.inf if w.stop is None else w.stop) for w in asked.wave
    ]
    histories = [History(h.node, h.times, np.outer(h.factors, h.force).tolist()) for h in asked.history]
    return [*pushes, *waves, *histories]


def schedule_of(asked: SimulationStage) -> list[Schedule]:
    """Rest-length changes that the scene plans."""
    return [Schedule(s.tendon, s.times, s.change) for s in asked.schedule]


def rests_first(asked: SimulationStage) -> bool:
    """Whether the run starts from the equilibrium: as asked, or when something is there to disturb it."""
    if asked.start != "auto":
        return asked.start == "equilibrium"
    return asked.controller != "none" or bool(asked.push or asked.wave or asked.history or asked.schedule)


def start_of(asked: SimulationStage, dynamics: Dynamics, equilibrium: Equilibrium | None) -> Start:
    """Nodes and velocities to start from; `velocity` and `spin` move the structure as a rigid body.

    The equilibrium is looked at only where `rests_first`.
    """
    if not rests_first(asked):
        equilibrium = None
    if asked.velocity is None and asked.spin is None:
        return dynamics.structure.nodes if equilibrium is None else equilibrium
    nodes = dynamics.structure.nodes if equilibrium is None else equilibrium.nodes
    drift = np.zeros(3) if asked.velocity is None else np.array(asked.velocity)
    spin = np.zeros(3) if asked.spin is None else np.array(asked.spin)
    return nodes, drift + np.cross(spin, nodes - mass_centre(dynamics.potential, nodes))
