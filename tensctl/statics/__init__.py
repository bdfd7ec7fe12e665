"""Where a structure rests, and whether it stays there."""

from tensctl.statics.continuation import EquilibriumPath, PathEvent, follow
from tensctl.statics.definiteness import Definiteness
from tensctl.statics.equilibrium import Equilibrium, find_equilibrium, settle
from tensctl.statics.inverse import HeldShape, inverse_statics
from tensctl.statics.nearest import NearestShape, nearest_shape
from tensctl.statics.newton import Newton
from tensctl.statics.prestress import (
    Prestress,
    PrestressLevels,
    SelfStress,
    StabilityOrders,
    admissible_prestress,
    cyclic_orbits,
    prestress_levels,
    self_stress,
    stability_orders,
)
from tensctl.statics.response import (
    StaticResponse,
    compliance,
    displacement_under,
    rest_length_influence,
    static_influence,
    static_response,
    stretch_map,
    tension_influence,
)
from tensctl.statics.rigid import RigidMotions, mass_centre, rigid_motions, unseen_motions
from tensctl.statics.stability import Spectrum, Stability, judge, spectrum
from tensctl.statics.starts import Equilibria, find_equilibria
from tensctl.statics.symmetry import CyclicSymmetry, find_symmetry

__all__ = [
    "CyclicSymmetry",
    "Definiteness",
    "Equilibria",
    "Equilibrium",
    "EquilibriumPath",
    "HeldShape",
    "NearestShape",
    "Newton",
    "PathEvent",
    "Prestress",
    "PrestressLevels",
    "RigidMotions",
    "SelfStress",
    "Spectrum",
    "Stability",
    "StabilityOrders",
    "StaticResponse",
    "admissible_prestress",
    "compliance",
    "cyclic_orbits",
    "displacement_under",
    "find_equilibria",
    "find_equilibrium",
    "find_symmetry",
    "follow",
    "inverse_statics",
    "judge",
    "mass_centre",
    "nearest_shape",
    "prestress_levels",
    "rest_length_influence",
    "rigid_motions",
    "self_stress",
    "settle",
    "spectrum",
    "stability_orders",
    "static_influence",
    "static_response",
    "stretch_map",
    "tension_influence",
    "unseen_motions",
]
