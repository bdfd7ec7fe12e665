"""Force balance: what rods and ground carry, and what is left over.

At a free node f + lambda-force of its rod = 0; the best compression c of a free rod along e splits the misfit
of both ends, c = e . (f_tail - f_head)/2, and a rod with one end held has c = -s e . f at its free end. Where rods
share nodes or are guided, all c follow together; the ground carries what is left in held directions.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold, JointedManifold, PotentialPoint, RodManifold

_EPS = float(np.finfo(float).eps)


def rod_forces(point: PotentialPoint) -> Float[np.ndarray, " rods"]:
    """Axial force of each rod, N, > 0 in compression; 0 for rods with both ends on the ground.

    Source: [W] section 3, in member vectors.
    """
    manifold, structure = point.potential.manifold, point.potential.structure
    return _thrust(manifold, structure.held, point.nodes, point.nodal_forces)


def unbalanced(point: PotentialPoint) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces left after the best rod and ground forces are taken away, N."""
    manifold, structure = point.potential.manifold, point.potential.structure
    return left_over(manifold, structure.held, point.nodes, point.nodal_forces)


def residual(point: PotentialPoint) -> float:
    """Largest unbalanced nodal force over the largest tension or load; 0 when there are neither."""
    if point.at_ease:
        return 0.0
    return relative(unbalanced(point), point.terms.tensions, point.potential.members.forces)


def attainable(point: PotentialPoint) -> float:
    """Residual that rounding of the nodes alone leaves: 1e-16 of stiffness times coordinates, over the largest force.

    A prestress of 1e-9 k l cannot be balanced to better than 1e-7 in double precision, whatever the method.
    """
    structure, members = point.potential.structure, point.potential.members
    axial = members.stiffness if members.law == "k" else members.stiffness / point.rest_lengths
    ends = structure.over_segments(np.maximum, np.abs(point.nodes[structure.segments]).max(axis=(1, 2), initial=0.0))
    pull = ((axial * ends) * (point.terms.tensions > 0))[structure.segment_tendon]
    rounding = np.zeros(len(point.nodes))
    for side in (0, 1):
        np.add.at(rounding, structure.segments[:, side], pull)
    return _EPS * relative(rounding[:, None], point.terms.tensions, members.forces)


def relative(left: np.ndarray, tensions: np.ndarray, forces: np.ndarray) -> float:
    """Largest of some nodal forces over the largest tension or load; 0 when there are neither."""
    scale = max(tensions.max(initial=0.0), np.linalg.norm(forces, axis=1).max(initial=0.0))
    return float(np.linalg.norm(left, axis=1).max(initial=0.0) / scale) if scale > 0 else 0.0


def left_over(
    manifold: RodManifold | JointedManifold, held: np.ndarray, nodes: np.ndarray, forces: np.ndarray
) -> Float[np.ndarray, "nodes 3"]:
    """Nodal forces less the best rod and ground forces, N."""
    left = forces.copy()
    thrust = _thrust(manifold, held, nodes, forces)[:, None] * manifold.directions(nodes)
    np.add.at(left, manifold.rods[:, 0], -thrust)
    np.add.at(left, manifold.rods[:, 1], thrust)
    left[held] = 0.0
    return left


def _thrust(
    manifold: RodManifold | JointedManifold, held: np.ndarray, nodes: np.ndarray, forces: np.ndarray
) -> Float[np.ndarray, " rods"]:
    e = manifold.directions(nodes)
    if isinstance(manifold, JointedManifold):
        return _shared_thrust(manifold.rods, e, held, forces)
    pull = (manifold.sign[:, :, None] * forces[manifold.rods]).sum(axis=1)
    share = np.where(manifold.hold == Hold.FREE, 0.5, 1.0)
    return -share * np.einsum("ri,ri->r", e, pull)


def _shared_thrust(rods: np.ndarray, e: np.ndarray, held: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Best rod forces where rods share nodes: least squares over all free directions at once.

    Loops of rods can carry prestress of their own; of all answers this is the one of least norm.
    """
    push, each = np.zeros((*held.shape, len(rods))), np.arange(len(rods))
    push[rods[:, 0], :, each] = -e
    push[rods[:, 1], :, each] = e
    thrust, *_ = np.linalg.lstsq(push[~held], -forces[~held], rcond=1e-12)
    return thrust
