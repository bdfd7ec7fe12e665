"""Where a structure rests, and whether it stays there."""

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
    tension_influence,
)
from tensctl.statics.rigid import RigidMotions, mass_centre, rigid_motions
from tensctl.statics.stability import Spectrum, Stability, judge, spectrum

__all__ = [
    "Equilibrium",
    "HeldShape",
    "NearestShape",
    "Newton",
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
    "find_equilibrium",
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
    "tension_influence",
]
