"""Prestress at given nodes: what a shape can carry, what it lets move, and whether its prestress holds it.

`self_stress` gives self-stresses and mechanisms with the rank decision behind them, `admissible_prestress` tensions
above a floor, `stability_orders` what they hold, and `prestress_levels` how stiffness grows with them. How the
structure then follows its rest lengths and loads is next door, in `compliance`; which rest lengths make a shape, in
`inverse`.
"""

from tensctl.statics.prestress.admissible import Goal, Prestress, admissible_prestress
from tensctl.statics.prestress.groups import CyclicOrbits, cyclic_orbits, tendon_groups
from tensctl.statics.prestress.levels import PrestressLevels, prestress_levels
from tensctl.statics.prestress.matrix import EquilibriumMatrix, equilibrium_matrix
from tensctl.statics.prestress.orders import Margin, StabilityOrders, stability_orders
from tensctl.statics.prestress.rank import Subspaces, subspaces
from tensctl.statics.prestress.rigid_fields import rigid_fields
from tensctl.statics.prestress.self_stress import SelfStress, rod_motions, self_stress
from tensctl.statics.prestress.stress_matrix import second_variation, stress_matrix
from tensctl.statics.prestress.super_stability import SuperStability, super_stability

__all__ = [
    "CyclicOrbits",
    "EquilibriumMatrix",
    "Goal",
    "Margin",
    "Prestress",
    "PrestressLevels",
    "SelfStress",
    "StabilityOrders",
    "Subspaces",
    "SuperStability",
    "admissible_prestress",
    "cyclic_orbits",
    "equilibrium_matrix",
    "prestress_levels",
    "rigid_fields",
    "rod_motions",
    "second_variation",
    "self_stress",
    "stability_orders",
    "stress_matrix",
    "subspaces",
    "super_stability",
    "tendon_groups",
]
