"""The equations of the shell class, as their authors wrote them ([S]), sparse and for any (n, m).

`ShellEquations.of(scene)` states (5.21) for a scene; every matrix in it has a function of its own, named after it and
with its number in the docstring. For readers of the paper and for tests: the project's own model (`build_dynamics`)
covers more (pins, dampers, drag, EA) and costs less.
"""

from tensctl.model.shell_equations.closure import (
    class_two_gaps,
    closed_forces,
    closure_residuals,
    nodal_forces,
    sums_and_differences,
)
from tensctl.model.shell_equations.coordinates import P_1, P_matrix, q_of
from tensctl.model.shell_equations.dependent import R_0, R_11, R_12, R_21, E_block, R_matrix, independent_rows
from tensctl.model.shell_equations.dimensions import dimensions
from tensctl.model.shell_equations.element_blocks import BLOCK_NAMES, force_block
from tensctl.model.shell_equations.equations import ShellEquations
from tensctl.model.shell_equations.independent import Q_11, Q_21, Q_22, Q_32, Lambda, Q_inverse, Q_matrix, Q_table
from tensctl.model.shell_equations.inputs import T_1, T_2, S_block, T_1_prime, T_matrix
from tensctl.model.shell_equations.layout import (
    Member,
    all_members,
    dependent_members,
    independent_members,
    input_members,
)
from tensctl.model.shell_equations.node_forces import B_0, W_0, B_d
from tensctl.model.shell_equations.planar import PlanarTensegrity, example1
from tensctl.model.shell_equations.ring_blocks import B_1, B_2, B_3, B_4, B_5, B_6, B_7, B_8, W_1, B_5bar
from tensctl.model.shell_equations.rods import H_matrix, K_r_matrix, newton_euler_residual, skew, skew_square
from tensctl.model.shell_equations.tendon_forces import TendonForces, tendon_forces
from tensctl.model.shell_equations.vectors import base_points, by_element, independent_vectors, tendon_vectors

__all__ = [
    "BLOCK_NAMES",
    "B_0",
    "B_1",
    "B_2",
    "B_3",
    "B_4",
    "B_5",
    "B_6",
    "B_7",
    "B_8",
    "P_1",
    "Q_11",
    "Q_21",
    "Q_22",
    "Q_32",
    "R_0",
    "R_11",
    "R_12",
    "R_21",
    "T_1",
    "T_2",
    "W_0",
    "W_1",
    "B_5bar",
    "B_d",
    "E_block",
    "H_matrix",
    "K_r_matrix",
    "Lambda",
    "Member",
    "P_matrix",
    "PlanarTensegrity",
    "Q_inverse",
    "Q_matrix",
    "Q_table",
    "R_matrix",
    "S_block",
    "ShellEquations",
    "T_1_prime",
    "T_matrix",
    "TendonForces",
    "all_members",
    "base_points",
    "by_element",
    "class_two_gaps",
    "closed_forces",
    "closure_residuals",
    "dependent_members",
    "dimensions",
    "example1",
    "force_block",
    "independent_members",
    "independent_rows",
    "independent_vectors",
    "input_members",
    "newton_euler_residual",
    "nodal_forces",
    "q_of",
    "skew",
    "skew_square",
    "sums_and_differences",
    "tendon_forces",
    "tendon_vectors",
]
