"""A bound on every frequency that a structure can have at rest, from its tendons' stiffness and its loads."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spl

from tensctl.elements import Potential, scatter_blocks


def fastest_rate(potential: Potential) -> float:
    """A bound on every frequency that the structure can have at rest, rad/s.

    Every tendon counts as taut and as stiff across as along: T/l across is less than k while rest lengths are positive.
    Loads swing a rod with at most omega^2 = 3 f / (m rho).
    """
    squared = _stiffest(potential) + _heaviest(potential)
    return float(np.sqrt(squared)) if squared > 0 else 1.0


def fastest_decay(potential: Potential, damping: np.ndarray, drag: float) -> float:
    """A bound on the rate at which dampers and drag stop a motion, 1/s; tendons count as damped across as along."""
    structure, members, manifold = potential.structure, potential.members, potential.manifold
    ends = np.bincount(structure.rods.ravel(), minlength=len(structure.nodes))
    nodal = sp.csr_array(sp.diags_array(np.repeat(drag * ends, 3).astype(float)))
    if len(structure.tendons):
        every = damping[structure.segment_tendon][:, None, None] * np.eye(3)
        nodal = sp.csr_array(nodal + scatter_blocks(structure.segments, every, len(structure.nodes)))
    return _largest(manifold.tangent(structure.nodes), nodal, manifold.mass(members.mass))


def _stiffest(potential: Potential) -> float:
    """Largest eigenvalue of the tendons' bound, rad^2/s^2, by Lanczos iteration."""
    structure, members, manifold = potential.structure, potential.members, potential.manifold
    if manifold.size == 0 or not len(structure.tendons):
        return 0.0
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    # A cable couples its segments: (sum of k stretches)^2 is at most their number times the sum of squares.
    pieces = np.bincount(structure.segment_tendon, minlength=len(stiffness))
    blocks = (pieces * stiffness)[structure.segment_tendon, None, None] * np.eye(3)
    nodal = scatter_blocks(structure.segments, blocks, len(structure.nodes))
    return _largest(manifold.tangent(structure.nodes), nodal, manifold.mass(members.mass))


def _largest(tangent: sp.csr_array, nodal: sp.csr_array, mass: np.ndarray) -> float:
    """Largest eigenvalue of J'AJ over the mass matrix, by Lanczos iteration."""
    if mass.size == 0:
        return 0.0
    root = 1 / np.sqrt(mass)
    scaled = (tangent.T @ nodal @ tangent).multiply(root).multiply(root[:, None]).tocsr()
    if mass.size < 4:
        return float(np.abs(np.linalg.eigvalsh(scaled.toarray())).max())
    return float(spl.eigsh(scaled, k=1, v0=np.ones(mass.size), tol=1e-2, return_eigenvectors=False)[0])


def _heaviest(potential: Potential) -> float:
    """Largest of 3 f / (m rho) over moving rods, rad^2/s^2."""
    members, manifold = potential.members, potential.manifold
    loads = np.linalg.norm(members.forces, axis=1)[manifold.rods].sum(axis=1)
    moving = manifold.moving
    lever = 0.5 * manifold.lengths[moving]
    return float((3 * loads[moving] / (members.mass[moving] * lever)).max(initial=0.0))
