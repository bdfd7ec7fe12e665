"""Damping given as a fraction of critical: resolved at the equilibrium, for its lowest flexible mode.

A mode with phi' M phi = 1 has the damping ratio phi' C phi / (2 omega), so for C = c C_1 the coefficient is
c = 2 ratio omega / (phi' C_1 phi). Repeated lowest modes share the mean of phi' C_1 phi.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.elements import Potential, PotentialPoint, length_map
from tensctl.errors import EquilibriumError
from tensctl.statics import settle

# Frequencies within this relative distance of the lowest count as the same mode.
_SAME = 1e-6


def resolve_damping(potential: Potential) -> tuple[Float[np.ndarray, " tendons"], float]:
    """Tendon damping (nt,) and drag, N s/m, with ratios turned into coefficients.

    Raises
    ------
    EquilibriumError
        When a ratio is asked for and the equilibrium has no stable flexible mode.
    """
    members = potential.members
    damping, drag = members.damping, members.drag
    if members.damping_ratio is None and members.drag_ratio is None:
        return damping, drag
    point, omega, shapes = _lowest(potential)
    if members.damping_ratio is not None:
        unit = np.ones(len(members.stiffness))
        damping = unit * _coefficient(members.damping_ratio, omega, shapes, damping_matrix(point, unit, 0.0))
    if members.drag_ratio is not None:
        unit = damping_matrix(point, np.zeros(len(members.stiffness)), 1.0)
        drag = _coefficient(members.drag_ratio, omega, shapes, unit)
    return damping, drag


def damping_matrix(point: PotentialPoint, damping: np.ndarray, drag: float) -> sp.csr_array:
    """Damping matrix in tangent coordinates, N s/m: c g g' of each taut tendon, g = dl/dp, and drag on each rod end."""
    structure = point.potential.structure
    stretch = length_map(structure, point.nodes)
    taut = structure.lengths_at(point.nodes) > point.rest_lengths
    nodal = stretch.T @ sp.diags_array(damping * taut) @ stretch
    if drag > 0:
        ends = np.bincount(structure.rods.ravel(), minlength=len(point.nodes))
        nodal = nodal + sp.diags_array(np.repeat(drag * ends, 3))
    return sp.csr_array(point.tangent.T @ nodal @ point.tangent)


def _lowest(potential: Potential) -> tuple[PotentialPoint, float, np.ndarray]:
    equilibrium = settle(potential)
    modes = equilibrium.spectrum
    if not equilibrium.stable or not modes.has_flexible:
        raise EquilibriumError(
            f"a damping ratio needs a stable equilibrium with a flexible mode, and this one is: {equilibrium.stable}; "
            "give the damping in N s/m, or shorten the rest lengths."
        )
    flexible = modes.omega2[modes.rigid_count :]
    same = flexible <= flexible[0] * (1 + _SAME)
    return equilibrium.point, float(np.sqrt(flexible[0])), modes.shapes[:, modes.rigid_count :][:, same]


def _coefficient(ratio: float, omega: float, shapes: np.ndarray, unit: sp.csr_array) -> float:
    modal = np.einsum("ik,ik->k", shapes, unit @ shapes).mean()
    if not modal > 0:
        raise EquilibriumError("the lowest flexible mode stretches no tendon, so no damping ratio reaches it.")
    return float(2 * ratio * omega / modal)
