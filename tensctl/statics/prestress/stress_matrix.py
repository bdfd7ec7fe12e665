"""The stress matrix: force densities as a weighted graph Laplacian, and the second variation that it gives.

    Omega_ab = -omega_ab,   Omega_aa = sum_b omega_ab,   omega = T/l in tendons, -c/l in rods

With nodes as rows of p, Omega p = w is force balance. For a motion v that lengthens no rod at first order, the energy
on the rods' manifold changes by half of

    v'(Omega x I_3) v + sum_t (k_t - T_t/l_t) (u_t . (v_head - v_tail))^2

where k is dT/dl; rods appear with their negative densities, so the bend of the manifold is inside Omega.
Connelly and Whiteley 1996, doi 10.1137/S0895480192229236.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.statics.prestress.matrix import EquilibriumMatrix
from tensctl.structure import Structure, refuse_cables, refuse_partial
from tensctl.structure.structure import lengths


def stress_matrix(
    structure: Structure,
    tendon_densities: Float[np.ndarray, " tendons"],
    rod_densities: Float[np.ndarray, " rods"],
) -> sp.csr_array:
    """Omega, (N, N), N/m.

    Parameters
    ----------
    tendon_densities : T/l, N/m
    rod_densities : c/l, N/m, > 0 in compression; they enter with a minus sign.

    Raises
    ------
    StructureError
        For a structure with cables or guides, or in a plane.
    """
    refuse_cables(structure, "a stress matrix has one force density a tendon", "give each piece its own tendon")
    refuse_partial(structure, "a stress matrix has whole nodes in space", "pin whole nodes of a network")
    members = np.vstack([structure.tendons, structure.rods])
    density = np.concatenate([tendon_densities, -rod_densities])
    a, b = members.T
    count = len(structure.nodes)
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    values = np.concatenate([density, density, -density, -density])
    return sp.csr_array(sp.coo_array((values, (rows, columns)), shape=(count, count)))


def second_variation(
    matrix: EquilibriumMatrix,
    tensions: Float[np.ndarray, " tendons"],
    rod_forces: Float[np.ndarray, " rods"],
    stiffness: Float[np.ndarray, " tendons"],
    motions: Float[np.ndarray, "free k"],
) -> Float[np.ndarray, "k k"]:
    """Second variation of the energy on motions of the free node components that lengthen no rod, N/m.

    Parameters
    ----------
    stiffness : (nt,) N/m
        dT/dl of each tendon; zero for the variation at constant tension.
    """
    structure = matrix.structure
    length = lengths(matrix.nodes, structure.tendons)
    omega = stress_matrix(structure, tensions / length, rod_forces / lengths(matrix.nodes, structure.rods))
    moved = np.zeros((matrix.nodes.size, motions.shape[1]))
    moved[matrix.free] = motions
    spread = moved.reshape(len(matrix.nodes), -1)
    geometric = moved.T @ (omega @ spread).reshape(moved.shape)
    stretch = matrix.tendons.T @ motions
    return geometric + stretch.T @ ((stiffness - tensions / length)[:, None] * stretch)
