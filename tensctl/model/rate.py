"""A bound on every frequency that a structure can have at rest, from its tendons' stiffness and its loads."""

from __future__ import annotations

import numpy as np
import scipy.sparse.linalg as spl

from tensctl.elements import Potential, scatter_blocks


def fastest_rate(potential: Potential) -> float:
    """A bound on every frequency that the structure can have at rest, rad/s.

    Every tendon counts as taut and as stiff across as along: T/l across is less than k while rest lengths are positive.
    Loads swing a rod with at most omega^2 = 3 f / (m rho).
    """
    squared = _stiffest(potential) + _heaviest(potential)
    return float(np.sqrt(squared)) if squared > 0 else 1.0


def _stiffest(potential: Potential) -> float:
    """Largest eigenvalue of the tendons' bound, rad^2/s^2, by Lanczos iteration."""
    structure, members, manifold = potential.structure, potential.members, potential.manifold
    if manifold.size == 0 or not len(structure.tendons):
        return 0.0
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    # A cable couples its segments: (sum of k stretches)^2 is at most their number times the sum of squares.
    pieces = np.bincount(structure.segment_tendon, minlength=len(stiffness))
    blocks = (pieces * stiffness)[structure.segment_tendon, None, None] * np.eye(3)
    tangent = manifold.tangent(structure.nodes)
    root = 1 / np.sqrt(manifold.mass(members.mass))
    matrix = tangent.T @ scatter_blocks(structure.segments, blocks, len(structure.nodes)) @ tangent
    scaled = matrix.multiply(root).multiply(root[:, None]).tocsr()
    if manifold.size < 4:
        return float(np.abs(np.linalg.eigvalsh(scaled.toarray())).max())
    start = np.ones(manifold.size)
    return float(spl.eigsh(scaled, k=1, v0=start, tol=1e-2, return_eigenvectors=False)[0])


def _heaviest(potential: Potential) -> float:
    """Largest of 3 f / (m rho) over moving rods, rad^2/s^2."""
    members, manifold = potential.members, potential.manifold
    loads = np.linalg.norm(members.forces, axis=1)[manifold.rods].sum(axis=1)
    moving = manifold.moving
    lever = 0.5 * manifold.lengths[moving]
    return float((3 * loads[moving] / (members.mass[moving] * lever)).max(initial=0.0))
