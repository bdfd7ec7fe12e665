"""Everything that `[controllability]` asks about one linear model, in one object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.analysis.energies import ReachEnergies
from tensctl.analysis.krylov import KrylovRank, krylov_rank
from tensctl.analysis.losses import Redundancy, redundancy
from tensctl.analysis.modal import controllability, observability
from tensctl.analysis.moving import Move, move
from tensctl.analysis.placement import Placement, place_by_all
from tensctl.analysis.reach import Reach
from tensctl.analysis.verdict import ModalReport
from tensctl.linear import LinearModel
from tensctl.scene.stages import ControllabilityStage

# One singular value decomposition a frequency: 5 s at 360 states, minutes beyond 600.
_HAUTUS_STATES = 400


@dataclass(frozen=True, eq=False)
class Study:
    """Answers to what was asked; the others are None.

    Attributes
    ----------
    linear : LinearModel
    controllability : ModalReport
    reach : Reach
        What tendons push and hold.
    krylov : KrylovRank or None
        What `control.ctrb` says, for small models.
    observability : ModalReport or None
        Where the linear model has outputs.
    energies : ReachEnergies or None
        With a horizon.
    moves : tuple of Move
        Which tendons to pull to move nodes.
    placements : tuple of Placement
        The best few actuators, by every measure.
    redundancy : Redundancy or None
        What is lost without a tendon or its motor.
    """

    linear: LinearModel
    controllability: ModalReport
    reach: Reach
    krylov: KrylovRank | None
    observability: ModalReport | None
    energies: ReachEnergies | None = None
    moves: tuple[Move, ...] = ()
    placements: tuple[Placement, ...] = ()
    redundancy: Redundancy | None = None

    @classmethod
    def of(cls, linear: LinearModel, asked: ControllabilityStage | None = None) -> Study:
        """Answer what a scene's `[controllability]` asks; without it, what costs next to nothing."""
        asked = ControllabilityStage() if asked is None else asked
        return cls(
            linear=linear,
            controllability=controllability(linear),
            reach=Reach(linear),
            krylov=krylov_rank(linear),
            observability=observability(linear) if linear.outputs else None,
            energies=None if asked.horizon is None else ReachEnergies.of(linear, asked.horizon),
            moves=tuple(move(linear, m.node, m.by, tension_min=m.tension_min, goal=m.goal) for m in asked.move),
            placements=() if asked.place is None else place_by_all(linear, asked.place, asked.horizon),
            redundancy=redundancy(linear) if asked.redundancy else None,
        )

    @property
    def hautus(self) -> Float[np.ndarray, " modes"] | None:
        """Distances over A and B together, 1/s; None for models too large to be asked."""
        return self.controllability.hautus if len(self.linear.A) <= _HAUTUS_STATES else None

    def verify(self, tol: float = 1e-9) -> None:
        """Check every answer against the linear model.

        Raises
        ------
        TensctlError
            With the first number that does not fit.
        """
        self.reach.verify(tol)
        if self.hautus is not None:
            self.controllability.verify(tol)
        if self.energies is not None:
            self.energies.verify(tol)
        for one in (*self.moves, *self.placements):
            one.verify()

    def __str__(self) -> str:
        """Tables and sentences for the terminal."""
        from tensctl.analysis.words import as_text

        return as_text(self)
