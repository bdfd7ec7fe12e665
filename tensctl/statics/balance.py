"""Force balance: what rods and ground carry, and what is left over.

At a free node f + lambda-force of its rod = 0; the best compression c of a free rod along e splits the misfit
of both ends, c = e . (f_tail - f_head)/2, and a rod with one end held has c = -s e . f at its free end.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold, JointedManifold, PotentialPoint


def rod_forces(point: PotentialPoint) -> Float[np.ndarray, " rods"]:
    """Axial force of each rod, N, > 0 in compression; 0 for rods with both ends on the ground.

    Source: [W] section 3, in member vectors.
    """
    manifold = point.potential.manifold
    if isinstance(manifold, JointedManifold):
        return _shared_forces(point)
    pull = (manifold.sign[:, :, None] * point.nodal_forces[manifold.rods]).sum(axis=1)
    share = np.where(manifold.hold == Hold.FREE, 0.5, 1.0)
    return -share * np.einsum("ri,ri->r", manifold.directions(point.nodes), pull)


def _shared_forces(point: PotentialPoint) -> Float[np.ndarray, " rods"]:
    """Best rod forces where rods share nodes: least squares over all free nodes at once.

    Loops of rods can carry prestress of their own; of all answers this is the one of least norm.
    """
    manifold, structure = point.potential.manifold, point.potential.structure
    e, rods = manifold.directions(point.nodes), np.arange(len(structure.rods))
    push = np.zeros((len(structure.nodes), 3, rods.size))
    push[structure.rods[:, 0], :, rods] = -e
    push[structure.rods[:, 1], :, rods] = e
    free = ~structure.pinned
    forces, *_ = np.linalg.lstsq(push[free].reshape(-1, rods.size), -point.nodal_forces[free].ravel(), rcond=1e-12)
    return forces


def unbalanced(point: PotentialPoint) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces left after the best rod and ground forces are taken away, N."""
    manifold = point.potential.manifold
    left = point.nodal_forces.copy()
    thrust = rod_forces(point)[:, None] * manifold.directions(point.nodes)
    np.add.at(left, manifold.rods[:, 0], -thrust)
    np.add.at(left, manifold.rods[:, 1], thrust)
    left[point.potential.structure.pinned] = 0.0
    return left


def residual(point: PotentialPoint) -> float:
    """Largest unbalanced nodal force over the largest tension or load; 0 when there are neither."""
    if point.at_ease:
        return 0.0
    loads = np.linalg.norm(point.potential.members.forces, axis=1)
    scale = max(point.terms.tensions.max(initial=0.0), loads.max(initial=0.0))
    largest = np.linalg.norm(unbalanced(point), axis=1).max(initial=0.0)
    return float(largest / scale)
