"""What can be known: which modes tendons drive and outputs see, and how far rest lengths reach."""

from tensctl.analysis.energies import ReachEnergies
from tensctl.analysis.gramian import Gramian, controllability_gramian, observability_gramian
from tensctl.analysis.harmonic import (
    HarmonicReport,
    HarmonicVerdict,
    harmonic_controllability,
    harmonic_observability,
)
from tensctl.analysis.harmonic_gramian import (
    HarmonicGramian,
    harmonic_controllability_gramian,
    harmonic_observability_gramian,
)
from tensctl.analysis.harmonic_reach import HarmonicReach
from tensctl.analysis.influence import static_influence, tension_influence
from tensctl.analysis.krylov import KrylovRank
from tensctl.analysis.losses import Loss, Redundancy, redundancy
from tensctl.analysis.modal import controllability, observability
from tensctl.analysis.moving import Move, move
from tensctl.analysis.placement import Placement, place
from tensctl.analysis.reach import Reach
from tensctl.analysis.study import Study
from tensctl.analysis.verdict import ModalReport, ModeVerdict

__all__ = [
    "Gramian",
    "HarmonicGramian",
    "HarmonicReach",
    "HarmonicReport",
    "HarmonicVerdict",
    "KrylovRank",
    "Loss",
    "ModalReport",
    "ModeVerdict",
    "Move",
    "Placement",
    "Reach",
    "ReachEnergies",
    "Redundancy",
    "Study",
    "controllability",
    "controllability_gramian",
    "harmonic_controllability",
    "harmonic_controllability_gramian",
    "harmonic_observability",
    "harmonic_observability_gramian",
    "move",
    "observability",
    "observability_gramian",
    "place",
    "redundancy",
    "static_influence",
    "tension_influence",
]
