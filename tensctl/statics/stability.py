"""Is the rest stable? The eigenvalues of the Riemannian Hessian against the mass matrix say so.

H phi = omega^2 M phi, with the rigid-body motions R (H R = 0) taken out exactly
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.elements import PotentialPoint
from tensctl.statics.rigid import RigidMotions, rigid_motions


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
    omega2 : (size,) rad^2/s^2
        Rigid-body motions first (their values as computed, near zero), then the others, ascending.
    shapes : (size, size) tangent coordinates, 1/sqrt(kg)
        shapes' M shapes = I, one column a mode.
    rigid : RigidMotions
        The motions that the energy does not see; the first `len(rigid.names)` columns of shapes.
    tolerance : float, rad^2/s^2
        Eigenvalues below this size are rounding.
    """

    omega2: Float[np.ndarray, " size"]
    shapes: Float[np.ndarray, "size size"]
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


def spectrum(point: PotentialPoint) -> Spectrum:
    """All modes about a point, dense.

    Rigid-body motions are known in closed form and are taken out before the eigenvalue problem is solved, so they
    neither blur the lowest flexible modes nor take their noise. A motion that the energy does see (dead loads turn
    rotations into pendulums) stays among the others. Accurate to about size * 1e-16 of the largest eigenvalue.
    """
    potential = point.potential
    root = np.sqrt(potential.manifold.mass(potential.members.mass))
    scaled = point.hessian.toarray() / root / root[:, None]
    scaled = 0.5 * (scaled + scaled.T)
    # The largest row sum bounds every eigenvalue and is within a factor of a few of the largest.
    bound = float(np.abs(scaled).sum(axis=1).max(initial=0.0))
    tolerance = 1e-15 * max(len(root), 10) * bound
    rigid = _unseen(rigid_motions(potential, point.nodes), scaled, root, 100 * tolerance)
    basis = root[:, None] * rigid.basis
    seen = np.linalg.qr(basis, mode="complete")[0][:, basis.shape[1] :] if basis.shape[1] else np.eye(len(root))
    omega2, vectors = sla.eigh(seen.T @ scaled @ seen, check_finite=False)
    zeros = np.einsum("ij,ik,kj->j", basis, scaled, basis)
    shapes = np.hstack([basis, seen @ vectors]) / root[:, None]
    return Spectrum(np.concatenate([zeros, omega2]), shapes, rigid, tolerance)


def _unseen(rigid: RigidMotions, scaled: np.ndarray, root: np.ndarray, tolerance: float) -> RigidMotions:
    """The rigid-body motions that cost no energy."""
    if not rigid.names:
        return rigid
    cost = np.linalg.norm(scaled @ (root[:, None] * rigid.basis), axis=0)
    keep = cost <= tolerance
    names = tuple(name for name, kept in zip(rigid.names, keep, strict=True) if kept)
    return RigidMotions(rigid.basis[:, keep], names)


def judge(point: PotentialPoint, modes: Spectrum) -> Stability:
    """Stable, unstable or undecided in double precision; all slack and unloaded is "no prestress"."""
    if point.at_ease:
        return Stability.NO_PRESTRESS
    if not modes.has_flexible or modes.smallest > modes.tolerance:
        return Stability.YES
    return Stability.NO if modes.smallest < -modes.tolerance else Stability.UNDECIDED
