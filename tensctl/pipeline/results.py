"""What the stages of a run have found so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensctl.accuracy import WorkPrecision
    from tensctl.analysis import ModalReport, Study
    from tensctl.linear import LinearModel
    from tensctl.model import Dynamics
    from tensctl.pipeline.certificate import Certificate
    from tensctl.scene import Scene
    from tensctl.simulation import Run, Sanity
    from tensctl.statics import Equilibrium
    from tensctl.structure import Structure
    from tensctl.synthesis import LQG, LQR, MPC, SampledLQR, ShapePath


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
    lqr : LQR or SampledLQR
        About the target's equilibrium where there is a target.
    lqg : LQG
    mpc : MPC
    run : Run
    sanity : Sanity
        Whether the run is physical.
    certificate : Certificate
        Of the predictive controller on this run.
    accuracy : WorkPrecision
        Error against run time of the scene's own motion.
    """

    scene: Scene
    equilibrium: Equilibrium
    dynamics: Dynamics | None = None
    linear: LinearModel | None = None
    study: Study | None = None
    path: ShapePath | None = None
    lqr: LQR | SampledLQR | None = None
    lqg: LQG | None = None
    mpc: MPC | None = None
    run: Run | None = None
    sanity: Sanity | None = None
    certificate: Certificate | None = None
    accuracy: WorkPrecision | None = None

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


def distance_in_frame(wanted: Equilibrium, run: Run) -> np.ndarray:
    """Largest distance of a node to the wanted shape, m; a free structure is measured in its co-moving frame."""
    if run.structure.held.any():
        return run.distance_to(wanted.nodes)
    from tensctl.linear import best_fit

    moments = zip(run.nodes, run.velocities, strict=True)
    seen = [best_fit(wanted.potential, wanted.nodes, nodes, rates).nodes(nodes) for nodes, rates in moments]
    return np.linalg.norm(np.stack(seen) - wanted.nodes, axis=2).max(axis=1)
