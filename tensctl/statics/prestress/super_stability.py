"""Connelly's super-stability: the stress matrix alone decides, for motions of every size.

    Omega >= 0,   null Omega = affine functions of the nodes (rank N - d - 1),
    Q = 0 is the only symmetric Q with d_m'Q d_m = 0 on all stressed members m

N nodes that span d dimensions, force densities of rods negative. Another shape q with tendons no longer and rods no
shorter has no more of the energy sum omega |q_a - q_b|^2, whose least value p has; so q is an affine image of p, and
the third condition (no conic at infinity) leaves only congruent ones.

With pins the same argument runs on the free nodes: Omega_ff >= 0, its null space the affine functions that vanish at
the pins, and Q without a part on the directions that the pins span. Sufficient, not necessary: "no" says that this
argument fails, not that the structure moves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.statics.algebra.rank_decision import RankDecision
from tensctl.statics.prestress.rank import Subspaces, subspaces
from tensctl.statics.prestress.stress_matrix import stress_matrix
from tensctl.statics.stability import Stability
from tensctl.structure import Structure, refuse_cables
from tensctl.structure.structure import lengths

_EPS = np.finfo(float).eps
# A member whose force density is below this part of the largest carries rounding, and its direction says nothing.
_CARRIES = 1e-12


@dataclass(frozen=True, eq=False)
class SuperStability:
    """The three conditions, each with its number.

    Attributes
    ----------
    smallest : float, N/m
        Smallest eigenvalue of Omega_ff across the affine functions: above the tolerance it gives both the sign and the
        rank condition.
    tolerance : float, N/m
    affine : RankDecision
        Rank of the map Q -> d_m'Q d_m on unit vectors of stressed members; `needed` leaves no affine motion.
    needed : int
        Entries of Q: d(d+1)/2, less v(v+1)/2 when the pins span v dimensions.
    dimension : int
        d, how many dimensions the nodes span; the pins count.
    proper : bool
        Whether tendons pull and rods push, all of them.
    loaded : bool
        Under loads Omega p = 0 does not hold and the theorem says nothing.
    """

    smallest: float
    tolerance: float
    affine: RankDecision
    needed: int
    dimension: int
    proper: bool
    loaded: bool

    @property
    def verdict(self) -> Stability:
        """Yes only when all conditions hold beyond rounding."""
        if self.loaded:
            return Stability.UNDECIDED
        if not self.proper or self.smallest < -self.tolerance:
            return Stability.NO
        if not self.affine.decided:
            return Stability.UNDECIDED
        if self.affine.rank < self.needed:
            return Stability.NO
        return Stability.YES if self.smallest > self.tolerance else Stability.UNDECIDED


def super_stability(
    structure: Structure,
    nodes: Float[np.ndarray, "nodes 3"],
    tensions: Float[np.ndarray, " tendons"],
    rod_forces: Float[np.ndarray, " rods"],
    *,
    loaded: bool = False,
) -> SuperStability:
    """Check Connelly's conditions for the prestress of a structure.

    Eigenvalues are accurate to about N * 1e-16 of the largest force density: members a million times shorter than
    others hide the rest, and the verdict is then "undecided".

    Raises
    ------
    StructureError
        For a structure with cables.
    """
    refuse_cables(structure, "a stress matrix has one force density a tendon", "give each piece its own tendon")
    kept = ~structure.grounded_tendons
    densities = tensions / lengths(nodes, structure.tendons)
    pushes = rod_forces / lengths(nodes, structure.rods)
    free = ~structure.pinned
    moving = ~structure.pinned[structure.rods].all(axis=1)
    omega = stress_matrix(structure, np.where(kept, densities, 0.0), np.where(moving, pushes, 0.0)).toarray()
    size = float(np.abs(np.concatenate([densities[kept], pushes[moving]])).max(initial=0.0))
    tolerance = 4 * max(len(nodes), 10) * _EPS * size
    proper = bool((densities[kept] > 0).all() and (pushes[moving] > 0).all())
    spread = subspaces(nodes - nodes.mean(axis=0))
    ground = structure.pinned
    fixed = spread.row_space.T @ _directions(nodes[ground])
    axes = np.hstack([_along(fixed), _across(fixed)])
    functions = np.hstack([np.ones((len(nodes), 1)), (nodes - nodes.mean(axis=0)) @ spread.row_space @ axes])
    vanishing = functions[free] @ (subspaces(functions[ground]).null if ground.any() else np.eye(functions.shape[1]))
    across = np.linalg.qr(vanishing, mode="complete")[0][:, vanishing.shape[1] :]
    values = np.linalg.eigvalsh(across.T @ omega[np.ix_(free, free)] @ across)
    weights = np.concatenate([np.where(kept, np.abs(densities), 0.0), np.where(moving, np.abs(pushes), 0.0)])
    members = np.vstack([structure.tendons, structure.rods])[weights > _CARRIES * size]
    conic = _conic(nodes @ spread.row_space @ axes, members, _along(fixed).shape[1])
    smallest = float(values.min(initial=np.inf))
    return SuperStability(smallest, tolerance, conic.decision, conic.right.shape[0], spread.rank, proper, loaded)


def _directions(pins: np.ndarray) -> np.ndarray:
    """Directions between pinned nodes, (3, pins)."""
    return (pins - pins.mean(axis=0)).T if len(pins) else np.zeros((3, 0))


def _along(directions: np.ndarray) -> np.ndarray:
    return subspaces(directions).column_space if directions.size else np.zeros((len(directions), 0))


def _across(directions: np.ndarray) -> np.ndarray:
    return subspaces(directions).left_null if directions.size else np.eye(len(directions))


def _conic(nodes: np.ndarray, members: np.ndarray, held: int) -> Subspaces:
    """The map Q -> u'Q u over unit vectors u; Q symmetric, without its first `held` by `held` block."""
    d = nodes[members[:, 1]] - nodes[members[:, 0]]
    u = d / np.linalg.norm(d, axis=1, keepdims=True)
    a, b = np.triu_indices(nodes.shape[1])
    a, b = a[b >= held], b[b >= held]
    return subspaces(u[:, a] * u[:, b] * np.where(a == b, 1.0, np.sqrt(2.0)))
