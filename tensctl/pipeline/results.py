"""What the stages of a run have found so far."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensctl.accuracy import SolverPrecision, WorkPrecision
    from tensctl.analysis import ModalReport, Study
    from tensctl.linear import Frame, LinearModel
    from tensctl.model import Dynamics
    from tensctl.pipeline.certificate import Certificate
    from tensctl.pipeline.way import Regulator, Way
    from tensctl.scene import Scene
    from tensctl.simulation import ActuatorDemand, Run, Sanity
    from tensctl.statics import Equilibrium
    from tensctl.structure import Structure
    from tensctl.synthesis import LQG, MPC, HarmonicLQG, NonlinearMPC, PathSurvey, ScheduledLQR, ShapePath


@dataclass(frozen=True, eq=False)
class Results:
    """Results of the stages that the scene asks for; the others are None.

    Attributes
    ----------
    scene : Scene
    equilibrium : Equilibrium
    dynamics : Dynamics
        Where a later stage asks for motion.
    linear : LinearModel
        About the equilibrium.
    study : Study
        What the tendons can do, all that `[controllability]` asks for.
    path : ShapePath
    survey : PathSurvey
        What the path is like on the way.
    lqr : LQR or SampledLQR, or either by harmonics
        About the target's equilibrium where there is a target.
    lqr_way : Way
        Whether by harmonics or dense, and why.
    scheduled : ScheduledLQR
        Along the path, where the run is steered by it.
    lqg : LQG or HarmonicLQG
    lqg_way : Way
    mpc : MPC or NonlinearMPC
    run : Run
    sanity : Sanity
        Whether the run is physical.
    demand : ActuatorDemand
        What is asked of the actuators, by the run that they drive or by the path.
    certificate : Certificate
        Of the predictive controller on this run.
    accuracy : WorkPrecision
        Error against run time of the scene's own motion.
    solvers : SolverPrecision
        Error against run time of solvers on the problems of its predictive controller.
    """

    scene: Scene
    equilibrium: Equilibrium
    dynamics: Dynamics | None = None
    linear: LinearModel | None = None
    study: Study | None = None
    path: ShapePath | None = None
    survey: PathSurvey | None = None
    lqr: Regulator | None = None
    lqr_way: Way | None = None
    scheduled: ScheduledLQR | None = None
    lqg: LQG | HarmonicLQG | None = None
    lqg_way: Way | None = None
    mpc: MPC | NonlinearMPC | None = None
    run: Run | None = None
    sanity: Sanity | None = None
    demand: ActuatorDemand | None = None
    certificate: Certificate | None = None
    accuracy: WorkPrecision | None = None
    solvers: SolverPrecision | None = None

    def __repr__(self) -> str:
        """Which results there are; each has its own."""
        there = [field.name for field in fields(self) if getattr(self, field.name) is not None]
        return f"Results({', '.join(there)})"

    @property
    def structure(self) -> Structure:
        """The structure of all results."""
        return self.equilibrium.structure

    @property
    def controllability(self) -> ModalReport | None:
        """Which modes the tendons drive; None when it was not asked."""
        return None if self.study is None else self.study.controllability

    @property
    def wanted(self) -> Equilibrium:
        """The equilibrium that the run should end in."""
        return self.equilibrium if self.path is None else self.path.target

    @property
    def shape_error(self) -> np.ndarray | None:
        """Largest distance of a node to the wanted shape at each recorded time, m; None for an uncontrolled run."""
        if self.run is None or self.scene.simulation is None or self.scene.simulation.controller == "none":
            return None
        return distance_in_frame(self.wanted, self.run)

    @property
    def overpowered(self) -> str | None:
        """Which actuators give or take more than `actuators.power_max`, in words; None when none does."""
        limit = self.scene.actuators.power_max
        return None if limit is None or self.demand is None else self.demand.beyond(limit)

    @cached_property
    def path_error(self) -> np.ndarray | None:
        """Largest distance of a node to the path at each recorded time, m; None without a path that is followed."""
        if self.path is None or self.run is None or self.shape_error is None:
            return None
        return distance_to_path(self.path, self.run)

    @cached_property
    def carried(self) -> tuple[float, float] | None:
        """How far a free controlled structure has moved, m, and turned, rad, by the end; None for any other."""
        frames = None if self.run is None or self.shape_error is None else frames_of(self.wanted, self.run)
        if frames is None:
            return None
        last = frames[-1]
        return float(np.linalg.norm(last.centre - last.reference_centre)), last.angle


def distance_in_frame(wanted: Equilibrium, run: Run) -> np.ndarray:
    """Largest distance of a node to the wanted shape, m; a free structure is measured in its co-moving frame."""
    frames = frames_of(wanted, run)
    if frames is None:
        return run.distance_to(wanted.nodes)
    seen = np.stack([frame.nodes(nodes) for frame, nodes in zip(frames, run.nodes, strict=True)])
    return np.linalg.norm(seen - wanted.nodes, axis=2).max(axis=1)


def distance_to_path(path: ShapePath, run: Run) -> np.ndarray:
    """Largest distance of a node to where the path has it at each recorded time, m; of a free structure likewise."""
    places, nodes = np.stack([path.nodes_at(t) for t in run.time]), run.nodes
    if not run.structure.held.any():
        from tensctl.linear import best_fit

        moments = zip(places, run.nodes, run.velocities, strict=True)
        nodes = np.stack([best_fit(path.target.potential, p, n, v).nodes(n) for p, n, v in moments])
    return np.linalg.norm(nodes - places, axis=2).max(axis=1)


def frames_of(wanted: Equilibrium, run: Run) -> list[Frame] | None:
    """The co-moving frame of a free structure at each recorded time; None when the ground holds anything of it."""
    if run.structure.held.any():
        return None
    from tensctl.linear import best_fit

    moments = zip(run.nodes, run.velocities, strict=True)
    return [best_fit(wanted.potential, wanted.nodes, nodes, rates) for nodes, rates in moments]
