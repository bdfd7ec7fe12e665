"""What ties rod ends to each other and to the ground beyond whole pins: joints and guides as linear rows.

    joint   p_a - p_b = 0   (three rows),     guide   p_a,i = const   (one row)

In rod-end coordinates every row is constant, C p = b, so accelerations obey C p'' = 0 with no further term, and the
forces that see to it, C' mu, follow from S mu = -C p''_free with S = C W C', W the rods' mobility. S is sparse: two
rows meet only where they share a rod. Rows are put in reverse Cuthill-McKee order and S is factored within its
profile.

Redundant rows (loops of rods that stay closed by themselves) are left out once, at the structure's own nodes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.sparse.csgraph import reverse_cuthill_mckee

from tensctl.elements import JointedManifold, RodManifold


@dataclass(frozen=True, eq=False)
class Constraints:
    """Rows of C, each with one or two entries, on the coordinates of rod ends.

    Attributes
    ----------
    first, second : (nc,) int
        Coordinate 6 r + 3 side + axis with the entries +1 and -1; second is -1 where there is none.
    target : (nc,) m
        b.
    couples : (np, 2) int
        Pairs of rows j >= k that share a rod.
    low, place : (nc,), (nc + 1,) int
        First column of each row of the factor, and where the row stands in a flat array.
    """

    first: Int[np.ndarray, " rows"]
    second: Int[np.ndarray, " rows"]
    target: Float[np.ndarray, " rows"]
    couples: Int[np.ndarray, "pairs 2"]
    low: Int[np.ndarray, " rows"]
    place: Int[np.ndarray, " places"]

    @classmethod
    def of(cls, manifold: RodManifold | JointedManifold) -> Constraints:
        """The rows of a structure, independent and in order; none for rods that share nothing."""
        if isinstance(manifold, RodManifold):
            none = np.zeros(0, int)
            return cls(none, none, np.zeros(0), np.zeros((0, 2), int), none, np.zeros(1, int))
        first, second, target = manifold.first, manifold.second, manifold.target
        keep = _independent(manifold)
        first, second, target = first[keep], second[keep], target[keep]
        order = _order(first, second)
        return cls.profiled(first[order], second[order], target[order])

    @classmethod
    def profiled(cls, first: np.ndarray, second: np.ndarray, target: np.ndarray) -> Constraints:
        """Rows in this order, with what the factor needs to know of them."""
        meets = sp.coo_array(sp.tril(_meeting(first, second)))
        couples = np.column_stack([meets.row, meets.col]).astype(int)
        low = np.arange(first.size)
        np.minimum.at(low, couples[:, 0], couples[:, 1])
        return cls(first, second, target, couples, low, np.append(0, np.cumsum(np.arange(first.size) - low + 1)))

    def matrix(self, ends: int) -> sp.csr_array:
        """C over the coordinates of `ends` rod ends, (nc, 3 ends)."""
        row = np.arange(self.first.size)
        two = self.second >= 0
        entries = np.concatenate([np.ones(row.size), -np.ones(int(two.sum()))])
        index = np.concatenate([row, row[two]]), np.concatenate([self.first, self.second[two]])
        return sp.csr_array(sp.coo_array((entries, index), shape=(row.size, 3 * ends)))


def _meeting(first: np.ndarray, second: np.ndarray) -> sp.csr_array:
    """Which rows share a rod, (nc, nc)."""
    rows = np.arange(first.size)
    two = second >= 0
    rod = np.concatenate([first // 6, second[two] // 6])
    touches = sp.csr_array(sp.coo_array((np.ones(rod.size), (np.concatenate([rows, rows[two]]), rod))))
    return sp.csr_array(touches @ touches.T)


def _order(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    if first.size == 0:
        return np.zeros(0, int)
    return np.asarray(reverse_cuthill_mckee(sp.csr_matrix(_meeting(first, second)), symmetric_mode=True), int)


def _independent(manifold: JointedManifold) -> np.ndarray:
    """As many rows as the manifold found independent, by a pivoted QR at the structure's own nodes."""
    first, second = manifold.first, manifold.second
    if manifold.rank == first.size:
        return np.arange(first.size)
    ends = manifold.anchor[manifold.end_node]
    tangent = manifold.ends.tangent(ends)
    two = second >= 0
    jacobian = tangent[first].toarray()
    jacobian[two] -= tangent[second[two]].toarray()
    _, _, pivot = sla.qr((jacobian * np.sqrt(manifold.weights)).T, mode="economic", pivoting=True)
    return np.sort(pivot[: manifold.rank])
