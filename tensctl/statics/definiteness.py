"""Is a Hessian positive definite across the rigid-body motions? Signs of pivots say so, without any eigenvalue.

With the scaling d_i = 1/sqrt(|H_ii| + |bend_ii|) the eigenvalues of d H d have the signs of those of H (Sylvester), and
rounding errors are as small beside soft members as beside stiff ones: stiffnesses of 1 and 1e12 N/m in one structure
are both decided. Rigid-body motions are held by springs on as many coordinates, which leaves the signs of all others as
they are. The factors of d H d + tol and d H d - tol, tol a diagonal, then count what is negative and what is not
positive whatever the errors are; the difference is undecided. What is left unbalanced at the rest makes tensions
uncertain by as much, and with them the geometric stiffness T/l: that is part of tol. A tendon whose tension is not more
than that may as well be slack; the verdict has to hold either way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
import scipy.sparse as sp

from tensctl.statics.factor import Factor
from tensctl.statics.trust_region import grounded

# Rounding of the entries and of the elimination, over the largest row sum: 1e-15, times the root of the size because
# errors add up like random ones (the largest seen in shells up to 50 000 degrees of freedom is a hundredth of this).
_ROUNDING = 1e-15


@dataclass(frozen=True)
class Definiteness:
    """Counts of the scaled Hessian's eigenvalues that belong to no rigid-body motion.

    Attributes
    ----------
    negative : int
        Below -tolerance.
    undecided : int
        Between -tolerance and +tolerance.
    tolerance : float
        Part of the local stiffness that is unknown, where it is largest.
    """

    negative: int
    undecided: int
    tolerance: float

    def __add__(self, other: Definiteness) -> Definiteness:
        """Both Hessians together."""
        tolerance = max(self.tolerance, other.tolerance)
        return Definiteness(self.negative + other.negative, self.undecided + other.undecided, tolerance)


def definiteness(
    hessian: sp.csr_array, bend: np.ndarray, blur: np.ndarray, rigid: np.ndarray, copies: int = 1
) -> Definiteness:
    """Count eigenvalues by the sign of pivots.

    Parameters
    ----------
    hessian : (size, size) sparse, real symmetric or complex Hermitian
    bend : (size,)
        Diagonal of what the bend of the manifold adds, whose rounding stays when it cancels.
    blur : (size,) N/m
        What the forces that are left over at the rest can change on the diagonal.
    rigid : (size, r)
        Motions of zero energy that do not count.
    copies : int
        How often the matrix occurs in the whole.
    """
    size = np.abs(hessian.diagonal()) + np.abs(bend)
    scale = 1.0 / np.sqrt(np.where(size > 0, size, size.max(initial=0.0) or 1.0))
    scaled = sp.csr_array(sp.diags_array(scale) @ hessian @ sp.diags_array(scale))
    rows = np.asarray(abs(scaled).sum(axis=1)).ravel() + np.abs(bend) * scale**2
    rounding = _ROUNDING * max(np.sqrt(scale.size), 10.0) * float(rows.max(initial=0.0))
    shift = rounding + blur * scale**2
    if not rounding > 0:
        return Definiteness(0, (scale.size - rigid.shape[1]) * copies, 0.0)
    held = grounded(scaled, rigid / scale[:, None])
    below = Factor.of(held + sp.diags_array(shift)).negative
    all_below = Factor.of(held - sp.diags_array(shift)).negative
    return Definiteness(below * copies, max(all_below - below, 0) * copies, float(shift.max()))


def blur_of(
    tangent: sp.csr_array, members: np.ndarray, lengths: np.ndarray, levers: np.ndarray, force: float
) -> np.ndarray:
    """What tensions and rod forces that are wrong by a force can change on the Hessian's diagonal, (size,) N/m.

    A tendon's tension acts across it with T/l, a rod's force with c/rho.
    """
    nodal = np.zeros(tangent.shape[0] // 3)
    for ends in members.T:
        np.add.at(nodal, ends, force / np.where(lengths > 0, lengths, np.inf))
    rods = force / levers.min(initial=np.inf)
    return tangent.multiply(tangent).T @ np.repeat(nodal, 3) + rods


def at_worst(stiff: Definiteness, loose: Definiteness) -> Definiteness:
    """Counts when it is open whether some tendons are taut (stiff) or slack (loose)."""
    open_ones = max(stiff.undecided, loose.undecided + loose.negative - stiff.negative)
    return Definiteness(stiff.negative, open_ones, max(stiff.tolerance, loose.tolerance))


def together(parts: list[Definiteness]) -> Definiteness:
    """The Hessian that has all these blocks."""
    return reduce(Definiteness.__add__, parts, Definiteness(0, 0, 0.0))
