"""What the stages of a run have found so far."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensctl.analysis import ModalReport
    from tensctl.linear import LinearModel
    from tensctl.model import Dynamics
    from tensctl.pipeline.certificate import Certificate
    from tensctl.scene import Scene
    from tensctl.simulation import Run
    from tensctl.statics import Equilibrium
    from tensctl.synthesis import LQR, MPC, ShapePath


@dataclass(frozen=True, eq=False)
class Results:
    """Results of the stages that the scene asks for; the others are None.

    Attributes
    ----------
    scene : Scene
    dynamics : Dynamics
    equilibrium : Equilibrium
    linear : LinearModel
        About the equilibrium.
    controllability : ModalReport
    path : ShapePath
    lqr : LQR
        About the target's equilibrium where there is a target.
    mpc : MPC
    run : Run
    certificate : Certificate
        Of the predictive controller on this run.
    """

    scene: Scene
    dynamics: Dynamics
    equilibrium: Equilibrium
    linear: LinearModel | None = None
    controllability: ModalReport | None = None
    path: ShapePath | None = None
    lqr: LQR | None = None
    mpc: MPC | None = None
    run: Run | None = None
    certificate: Certificate | None = None

    @property
    def wanted(self) -> Equilibrium:
        """The equilibrium that the run should end in."""
        return self.equilibrium if self.path is None else self.path.target

    @property
    def shape_error(self) -> np.ndarray | None:
        """Largest distance of a node to the wanted shape at each recorded time, m; None for an uncontrolled run."""
        steered = self.scene.simulation is not None and self.scene.simulation.controller != "none"
        return self.run.distance_to(self.wanted.nodes) if self.run is not None and steered else None
