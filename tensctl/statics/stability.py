"""Is the rest stable? The eigenvalues of the Riemannian Hessian against the mass matrix say so.

H phi = omega^2 M phi, with the rigid-body motions R that no load sees (H R = 0) taken out exactly
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.elements import PotentialPoint
from tensctl.statics.balance import attainable, residual
from tensctl.statics.definiteness import Definiteness, at_worst, blur_of, definiteness
from tensctl.statics.lowest import across, lowest_modes
from tensctl.statics.rigid import RigidMotions, unseen_motions

# All modes up to this many degrees of freedom (about 5 s and 0.1 GB at the limit), the lowest few beyond.
ALL_MODES = 2000
_LOWEST = 20


class Stability(StrEnum):
    """Verdict on an equilibrium; true only for `YES`."""

    YES = "yes"
    NO = "no"
    UNDECIDED = "undecided"
    NO_PRESTRESS = "no prestress"

    def __bool__(self) -> bool:
        return self is Stability.YES


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Modes of vibration about an equilibrium, in mass-normalised tangent coordinates.

    Attributes
    ----------
    omega2 : (modes,) rad^2/s^2
        Rigid-body motions first (their values as computed, near zero), then the others, ascending.
    shapes : (size, modes) tangent coordinates, 1/sqrt(kg)
        shapes' M shapes = I, one column a mode.
    rigid : RigidMotions
        The motions that the energy does not see; the first `len(rigid.names)` columns of shapes.
    tolerance : float, rad^2/s^2
        Eigenvalues below this size are rounding.
    """

    omega2: Float[np.ndarray, " modes"]
    shapes: Float[np.ndarray, "size modes"]
    rigid: RigidMotions
    tolerance: float

    @property
    def rigid_count(self) -> int:
        """How many rigid-body motions there are."""
        return len(self.rigid.names)

    @property
    def smallest(self) -> float:
        """Smallest eigenvalue that is no rigid-body motion, rad^2/s^2 (0 when there is none)."""
        return float(self.omega2[self.rigid_count :].min(initial=np.inf)) if self.has_flexible else 0.0

    @property
    def has_flexible(self) -> bool:
        """Whether anything but rigid-body motion is left."""
        return self.omega2.size > self.rigid_count

    @property
    def complete(self) -> bool:
        """Whether all modes are there; beyond 2000 degrees of freedom only the lowest 20 are."""
        return self.shapes.shape[0] == self.shapes.shape[1]


def spectrum(point: PotentialPoint, count: int | None = None) -> Spectrum:
    """Modes about a point: all up to 2000 degrees of freedom, the lowest 20 beyond, or `count` of them.

    Rigid-body motions are known in closed form and are taken out before the eigenvalue problem is solved, so they
    neither blur the lowest flexible modes nor take their noise. A motion that the energy does see (dead loads turn
    rotations into pendulums) stays among the others. Accurate to about size * 1e-16 of the largest eigenvalue.
    """
    root, scaled = _mass_scaled(point)
    tolerance = eigenvalue_tolerance(point)
    rigid = unseen_motions(point.potential, point.nodes)
    held = root[:, None] * rigid.basis
    if count is None and root.size > ALL_MODES:
        count = _LOWEST - held.shape[1]
    if count is None:
        omega2, vectors = across(scaled.toarray(), held)
    else:
        omega2, vectors = lowest_modes(scaled, held, count, tolerance)
    zeros = np.einsum("ij,ij->j", held, scaled @ held)
    shapes = np.hstack([held, vectors]) / root[:, None]
    return Spectrum(np.concatenate([zeros, omega2]), shapes, rigid, tolerance)


def eigenvalue_tolerance(point: PotentialPoint) -> float:
    """Size below which an eigenvalue is rounding, rad^2/s^2: size * 1e-15 of the largest row sum."""
    root, scaled = _mass_scaled(point)
    # The largest row sum bounds every eigenvalue and is within a factor of a few of the largest.
    return 1e-15 * max(root.size, 10) * float(np.asarray(abs(scaled).sum(axis=1)).max(initial=0.0))


def _mass_scaled(point: PotentialPoint) -> tuple[np.ndarray, sp.csr_array]:
    root = np.sqrt(point.potential.manifold.mass(point.potential.members.mass))
    scaled = sp.csr_array(sp.diags_array(1 / root) @ point.hessian @ sp.diags_array(1 / root))
    return root, sp.csr_array(0.5 * (scaled + scaled.T))


def whole_definiteness(point: PotentialPoint) -> Definiteness:
    """Counts of negative and undecided eigenvalues of the Hessian at full size."""
    force = unknown_force(point)
    counts = _whole(point, force)
    edge = (point.terms.tensions > 0) & (point.terms.tensions <= force)
    if not edge.any():
        return counts
    slack = np.where(edge, np.inf, point.rest_lengths)
    return at_worst(counts, _whole(point.potential.at(point.nodes, slack), force))


def unknown_force(point: PotentialPoint) -> float:
    """What tensions may be wrong by, N: ten times what is left unbalanced, or what rounding of the nodes leaves."""
    forces = np.linalg.norm(point.potential.members.forces, axis=1)
    scale = max(point.terms.tensions.max(initial=0.0), forces.max(initial=0.0))
    return 10.0 * max(residual(point), attainable(point)) * float(scale)


def _whole(point: PotentialPoint, force: float) -> Definiteness:
    manifold, segments = point.potential.manifold, point.potential.structure.segments
    bend = manifold.bend(point.nodes, -point.nodal_forces).diagonal()
    lengths = np.linalg.norm(point.nodes[segments[:, 1]] - point.nodes[segments[:, 0]], axis=1)
    blur = blur_of(point.tangent, segments, lengths, 0.5 * manifold.lengths, force)
    return definiteness(point.hessian, bend, blur, unseen_motions(point.potential, point.nodes).basis)


def judge(point: PotentialPoint, counts: Definiteness) -> Stability:
    """Stable, unstable or undecided in double precision; all slack and unloaded is "no prestress"."""
    if point.at_ease:
        return Stability.NO_PRESTRESS
    if counts.negative:
        return Stability.NO
    return Stability.UNDECIDED if counts.undecided else Stability.YES
