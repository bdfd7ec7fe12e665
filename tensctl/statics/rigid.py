"""Rigid-body motions that the ground allows.

A rigid motion moves node p with v + omega x (p - c), c the mass centre; written in tangent coordinates of the rods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.structure import Structure

_AXES = "xyz"
# Loads are given in decimal numbers: their sum and their moments vanish to rounding only.
_NO_WORK = 1e-12
# Motions of held nodes below this part of the motion itself are rounding of the nodes.
_HELD = 1e-9


@dataclass(frozen=True, eq=False)
class RigidMotions:
    """Rigid-body motions, orthonormal in the mass metric.

    Attributes
    ----------
    basis : (size, r) tangent coordinates, 1/sqrt(kg)
        basis' M basis = I.
    names : r labels, `translation x`, `rotation z`, ...
    fields : (6, r)
        v (m/s) and omega (rad/s) of each motion, about the mass centre.
    """

    basis: Float[np.ndarray, "size r"]
    names: tuple[str, ...]
    fields: Float[np.ndarray, "6 r"]


def rigid_motions(potential: Potential, nodes: Float[np.ndarray, "nodes 3"]) -> RigidMotions:
    """Rigid-body motions of the structure at the given nodes that the ground allows.

    Of a free structure these are three translations and three rotations about the principal axes of inertia, in a plane
    two and one; each rotation is named after the coordinate axis that it is nearest to. What guides allow to first
    order only, such as a turn that would lift a guided node, is none of them.
    """
    manifold, members = potential.manifold, potential.members
    mass = manifold.mass(members.mass)
    centre = mass_centre(potential, nodes)
    shifts, turns = _allowed(nodes, centre, potential.structure)
    fields = np.hstack([shifts, turns])
    if fields.shape[1] == 0 or manifold.size == 0:
        return RigidMotions(np.zeros((manifold.size, 0)), (), np.zeros((6, 0)))
    motion = _nodal(nodes, centre) @ fields
    coordinates = manifold.coordinates_of(nodes, motion)
    basis, turned = _orthonormal(coordinates, mass, shifts.shape[1])
    return RigidMotions(basis, _names(fields @ turned), fields @ turned)


def unseen_motions(potential: Potential, nodes: Float[np.ndarray, "nodes 3"]) -> RigidMotions:
    """Rigid-body motions that the ground allows and on which no load does work, wherever the structure is.

    A motion v + omega x (p - c) is one when no load has a moment about it, w_i x omega = 0 for every load, and their
    sum does no work, sum w . v = 0, leaving out what the ground takes of a load at its own node: without loads all
    motions, under weight those along and about the vertical.
    Dead loads make pendulums of the others, and a sum of loads that pushes a free structure away finds no rest.
    """
    motions = rigid_motions(potential, nodes)
    forces = np.where(potential.structure.free, potential.members.forces, 0.0)
    if not forces.any() or not motions.names:
        return motions
    keep = _kernel(_work(forces, motions.fields))
    fields = motions.fields @ keep
    return RigidMotions(motions.basis @ keep, _names(fields), fields)


def works_on(forces: Float[np.ndarray, "nodes 3"], fields: Float[np.ndarray, "6 r"]) -> np.ndarray:
    """Whether the loads do work on each motion somewhere, (r,) bool."""
    if not forces.any():
        return np.zeros(fields.shape[1], bool)
    return np.linalg.norm(_work(forces, fields), axis=0) > _NO_WORK


def _work(forces: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """What each motion does to the loads: moments w_i x omega, and the work of their sum; one column a motion."""
    loaded = forces[forces.any(axis=1)]
    loaded = loaded / np.linalg.norm(loaded, axis=1).max()
    moments = np.cross(loaded[:, None, :], fields[3:].T[None]).transpose(0, 2, 1).reshape(-1, fields.shape[1])
    sizes = np.linalg.norm(np.vstack([fields[:3], fields[3:]]), axis=0)
    return np.vstack([moments, loaded.sum(axis=0) @ fields[:3]]) / np.where(sizes > 0, sizes, 1.0)


def _kernel(matrix: np.ndarray, tol: float = _NO_WORK) -> np.ndarray:
    """Orthonormal basis of the null space; unit vectors where these will do, so names stay plain."""
    count = matrix.shape[1]
    plain = np.linalg.norm(matrix, axis=0) <= tol
    _, sizes, rows = np.linalg.svd(matrix[:, ~plain], full_matrices=True)
    rank = int((sizes > tol).sum())
    mixed = np.zeros((count, int((~plain).sum()) - rank))
    mixed[~plain] = rows[rank:].T
    return np.hstack([np.eye(count)[:, plain], mixed])


def mass_centre(potential: Potential, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, " 3"]:
    """Centre of mass of the rods, m."""
    middles = nodes[potential.structure.rods].mean(axis=1)
    return np.average(middles, axis=0, weights=potential.members.mass)


def _nodal(nodes: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Nodal velocities of unit translations and unit rotations about the centre, (3N, 6)."""
    motion = np.zeros((*nodes.shape, 6))
    motion[:, :, :3] = np.eye(3)
    for k in range(3):
        motion[:, :, 3 + k] = np.cross(np.eye(3)[k], nodes - centre)
    return motion.reshape(-1, 6)


def _allowed(nodes: np.ndarray, centre: np.ndarray, structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Motions that the ground allows, of six: translations (6, t), and the rest, square to these (6, r)."""
    scale = np.ptp(nodes, axis=0).max()
    units = np.array([1.0, 1.0, 1.0, 1 / scale, 1 / scale, 1 / scale])[:, None]
    held = _nodal(nodes, centre).reshape(*nodes.shape, 6)[structure.held] * units.T
    if structure.planar:
        held = np.vstack([held, np.eye(6)[2:5]])
    shifts = np.pad(_kernel(held[:, :3], _HELD), ((0, 3), (0, 0)))
    turns = units * _kernel(np.vstack([held, shifts.T]), _HELD)
    if structure.has_guides and turns.shape[1]:
        turns = turns @ _kernel(scale * _lifts(nodes, centre, structure, held, turns), _HELD)
    return shifts, turns


def _lifts(
    nodes: np.ndarray, centre: np.ndarray, structure: Structure, held: np.ndarray, turns: np.ndarray
) -> np.ndarray:
    """What turns move guided nodes by to second order, e . (omega x v), less what a further motion makes good."""
    count = turns.shape[1]
    velocity = (_nodal(nodes, centre) @ turns).reshape(*nodes.shape, count)
    bent = np.cross(turns[3:].T[None, None], velocity.transpose(0, 2, 1)[:, :, None])
    bent = 0.5 * (bent + bent.transpose(0, 2, 1, 3)).transpose(0, 3, 1, 2)
    lift = bent[structure.held].reshape(-1, count**2)
    lift = np.vstack([lift, np.zeros((len(held) - len(lift), count**2))])
    return (lift - held @ np.linalg.lstsq(held, lift, rcond=_HELD)[0]).reshape(-1, count)


def _orthonormal(coordinates: np.ndarray, mass: np.ndarray, shifts: int) -> tuple[np.ndarray, np.ndarray]:
    """Mass-orthonormal basis of the span, and how it is mixed from the given columns.

    The first `shifts` columns, translations, keep their axes; rotations become principal ones. The two sets are square
    to each other in the mass metric.
    """
    gram = coordinates.T @ (mass[:, None] * coordinates)
    mix = np.zeros_like(gram)
    for block in (slice(0, shifts), slice(shifts, len(gram))):
        if not gram[block, block].size:
            continue
        moments, axes = np.linalg.eigh(gram[block, block])
        keep = moments > 1e-12 * moments.max()
        axes = axes[:, np.argsort(np.abs(axes).argmax(axis=0), kind="stable")] if keep.all() else axes
        moments = np.einsum("ij,ik,kj->j", axes, gram[block, block], axes)
        mix[block, block] = axes / np.sqrt(np.where(moments > 1e-12 * moments.max(), moments, np.inf))
    mix = mix[:, np.abs(mix).max(axis=0) > 0]
    return coordinates @ mix, mix


def _names(fields: np.ndarray) -> tuple[str, ...]:
    names = []
    for v in fields.T:
        turning = np.linalg.norm(v[3:]) > 1e-9 * np.linalg.norm(v)
        part = v[3:] if turning else v[:3]
        names.append(f"{'rotation' if turning else 'translation'} {_AXES[int(np.abs(part).argmax())]}")
    return tuple(names)
