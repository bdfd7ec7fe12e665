"""Static reach: how far the structure moves when rest lengths change slowly.

H dxi = G du,   so  d(xi)/d(u) = Phi diag(1/omega^2) Phi' G over the modes with stiffness
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.statics import Equilibrium


def static_influence(equilibrium: Equilibrium) -> Float[np.ndarray, "size inputs"]:
    """Tangent coordinates per unit of rest-length shortening of the acting tendons, m/m.

    Rigid-body motions get none; the influence is exact at a stable equilibrium and grows without bound as the lowest
    frequency falls to zero.
    """
    spectrum = equilibrium.spectrum
    shapes = spectrum.shapes[:, spectrum.rigid_count :]
    drive = equilibrium.point.input_map[:, equilibrium.potential.members.inputs]
    return shapes @ ((shapes.T @ drive.toarray()) / spectrum.omega2[spectrum.rigid_count :, None])


def tension_influence(equilibrium: Equilibrium, reach: np.ndarray | None = None) -> Float[np.ndarray, "nt inputs"]:
    """Tension of every tendon per unit of rest-length shortening of the acting ones, N/m, at rest.

    At an unloaded equilibrium one direction of u changes the prestress only: it is in this map, not in the motion.
    """
    reach = static_influence(equilibrium) if reach is None else reach
    terms, tendons = equilibrium.point.terms, equilibrium.structure.tendons
    d = equilibrium.nodes[tendons[:, 1]] - equilibrium.nodes[tendons[:, 0]]
    unit = d / np.where(equilibrium.lengths > 0, equilibrium.lengths, 1.0)[:, None]
    moved = (equilibrium.point.tangent @ reach).reshape(len(equilibrium.nodes), 3, -1)
    slope = np.einsum("ti,tij->tj", unit, terms.blocks)
    result = np.einsum("tj,tju->tu", slope, moved[tendons[:, 1]] - moved[tendons[:, 0]])
    inputs = equilibrium.potential.members.inputs
    result[inputs, np.arange(inputs.size)] += np.einsum("ti,ti->t", unit, terms.shortening)[inputs]
    return result
