"""Rods that meet in ball joints or slide along guides: the rods' manifold cut by linear rows.

Every rod keeps two ends of its own. A joint asks p_a - p_b = 0 of two of them (a row a direction), a guide holds one
component of one, p_a,i = b: C p = b, and A xi = 0, A = C J, in the rods' tangent coordinates. Coordinates y of what is
left are square in the mass metric, xi = Z y, Z'M Z = m I, m the mean rod mass:

    gradient Z'g,   Hessian Z' (H + curvature under the row forces mu) Z,   mu = argmin |M^-1/2 (g + A'mu)|

Rows tie rods into chains that have no row in common, so Z, and all that is made with it, is sparse: a block a chain.
A step goes along Z y and comes back to the rows square to it, so rod lengths are exact and joints closed to rounding.
Redundant rows (loops of rods) lower the rank of A; it is decided once, at the structure's own nodes, from the diagonal
of a pivoted QR. Rows that are redundant there and nowhere else lock or branch, and are refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from jaxtyping import Float, Int
from scipy.sparse.csgraph import connected_components

from tensctl.elements.manifold import RodManifold
from tensctl.errors import StructureError
from tensctl.structure import Structure

if TYPE_CHECKING:
    from tensctl.elements.great_circle import JoinedCircles

# A diagonal of the pivoted QR below this part of the first is a redundant joint.
_REDUNDANT = 1e-9
_CLOSED = 1e-15
_CLOSINGS = 30
# A step of this part of the mean rod length has to arrive where it aims, to a half of itself, where rows are redundant.
_NEARBY = 1e-3
_ARRIVES = 0.5


@dataclass(frozen=True, eq=False)
class JointedManifold:
    """Tangent coordinates of rods with joints and guides; the same calls as `RodManifold`.

    Attributes
    ----------
    rods : (nr, 2) int
        Nodes of each rod; a node may end several.
    ends : RodManifold
        The rods with two ends of their own: end 2r is the tail of rod r, end 2r + 1 its head.
    end_node : (2 nr,) int
    shown : (N,) int
        The end that stands for each node, -1 for a node without a rod.
    first, second : (nc,) int
        Coordinates 3 end + axis with the entries +1 and -1 of each row of C; second is -1 for a guide.
    target : (nc,) m
        b: 0 for a joint, where the ground holds a guide.
    weights : (size of ends,)
        Mean rod mass over the mass of each coordinate.
    ranks : (chains,) int
        Independent rows of each chain of rods.
    anchor : (N, 3) m
        Where the structure has its nodes; nodes without a rod stay there.
    """

    rods: Int[np.ndarray, "rods 2"]
    ends: RodManifold
    end_node: Int[np.ndarray, " ends"]
    shown: Int[np.ndarray, " nodes"]
    first: Int[np.ndarray, " rows"]
    second: Int[np.ndarray, " rows"]
    target: Float[np.ndarray, " rows"]
    weights: Float[np.ndarray, " coordinates"]
    ranks: Int[np.ndarray, " chains"]
    anchor: Float[np.ndarray, "nodes 3"]

    @classmethod
    def of(cls, structure: Structure, rod_mass: Float[np.ndarray, " rods"]) -> JointedManifold:
        """The manifold of a structure whose rods share nodes or are guided.

        Raises
        ------
        StructureError
            When double precision cannot tell how many rows are independent, or when rows lock.
        """
        end_node = structure.rods.ravel()
        split = np.arange(end_node.size).reshape(-1, 2)
        free = RodManifold.of(structure)
        ends = RodManifold(split, free.hold, free.lengths, end_node.size, free.planar)
        shown, first, second = _rows(structure)
        target = np.where(second < 0, structure.nodes[end_node].ravel()[first], 0.0)
        weights = rod_mass.mean() / ends.mass(rod_mass)
        none = np.zeros(0, int)
        rough = cls(structure.rods, ends, end_node, shown, first, second, target, weights, none, structure.nodes)
        manifold = replace(rough, ranks=rough._find_ranks())
        manifold._check_regular()
        return manifold

    @property
    def hold(self) -> Int[np.ndarray, " rods"]:
        """How the ground holds each rod."""
        return self.ends.hold

    @property
    def moving(self) -> Int[np.ndarray, " moving"]:
        """Rods with at least one free end."""
        return self.ends.moving

    @property
    def sign(self) -> Float[np.ndarray, "rods 2"]:
        """-1 at a free tail, +1 at a free head, 0 at a held end."""
        return self.ends.sign

    @property
    def lengths(self) -> Float[np.ndarray, " rods"]:
        """Rod lengths, m."""
        return self.ends.lengths

    @property
    def rank(self) -> int:
        """Independent rows."""
        return int(self.ranks.sum())

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return self.ends.size - self.rank

    def mass(self, rod_mass: Float[np.ndarray, " rods"]) -> Float[np.ndarray, " size"]:
        """Diagonal of the mass matrix: the mean rod mass for every coordinate, kg."""
        return np.full(self.size, rod_mass.mean())

    def directions(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "rods 3"]:
        """Unit vectors e from tail to head."""
        return self.ends.directions(nodes[self.end_node])

    def tangent(self, nodes: Float[np.ndarray, "nodes 3"]) -> sp.csr_array:
        """Map from coordinates y to nodal displacements, (3N, size)."""
        has_rod = np.flatnonzero(self.shown >= 0)
        rows, ends = ((3 * k[:, None] + np.arange(3)).ravel() for k in (has_rod, self.shown[has_rod]))
        free = ~self._held[rows]
        shape = nodes.size, 3 * self.end_node.size
        pick = sp.csr_array((np.ones(free.sum()), (rows[free], ends[free])), shape=shape)
        return pick @ self.ends.tangent(nodes[self.end_node]) @ self.basis(nodes)

    def bend(self, nodes: Float[np.ndarray, "nodes 3"], gradient: Float[np.ndarray, "nodes 3"]) -> sp.csr_array:
        """What bend adds to the Hessian under a nodal gradient and the rows' forces, (size, size), N/m."""
        at_ends = np.zeros((self.end_node.size, 3))
        has_rod = np.flatnonzero(self.shown >= 0)
        at_ends[self.shown[has_rod]] = gradient[has_rod]
        J, root = self.ends.tangent(nodes[self.end_node]), np.sqrt(self.weights)
        jacobian = self._jacobian(J)
        pull = root * (J.T @ at_ends.ravel())
        tied = np.zeros(self.first.size)
        for rows, columns in self._chains:
            block = (jacobian[rows][:, columns].toarray() * root[columns]).T
            tied[rows], *_ = np.linalg.lstsq(block, -pull[columns], rcond=_REDUNDANT)
        at_ends += (self._matrix.T @ tied).reshape(-1, 3)
        basis = self.basis(nodes)
        return sp.csr_array(basis.T @ sp.diags_array(self.ends.curvature(nodes[self.end_node], at_ends)) @ basis)

    def retract(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " size"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Nodes after a step, with exact rod lengths, closed joints and kept guides."""
        return self.tied(nodes, self.basis(nodes) @ step)

    def untied(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " coordinates"]:
        """Chart of nodes about a reference by the rods' own coordinates, as if nothing tied them; `tied` goes back."""
        return self.ends.logarithm(reference[self.end_node], nodes[self.end_node])

    def tied(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " coordinates"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Nodes after a step of the rods' own coordinates, brought back to closed joints and kept guides."""
        ends = self.ends.retract(nodes[self.end_node], step)
        root, size, before = np.sqrt(self.weights), np.ptp(self.anchor, axis=0).max(), np.inf
        for _ in range(_CLOSINGS):
            gap = self._matrix @ ends.ravel() - self.target
            worst = np.abs(gap).max(initial=0.0)
            if worst <= _CLOSED * size or not worst < before:
                break
            before = worst
            jacobian, back = self._jacobian(self.ends.tangent(ends)), np.zeros(self.ends.size)
            for rows, columns in self._chains:
                block = jacobian[rows][:, columns].toarray() * root[columns]
                back[columns], *_ = np.linalg.lstsq(block, -gap[rows], rcond=_REDUNDANT)
            ends = self.ends.retract(ends, root * back)
        moved, has_rod = nodes.copy(), self.shown >= 0
        moved[has_rod] = ends[self.shown[has_rod]]
        return np.where(self._held.reshape(-1, 3), self.anchor, moved)

    def chart(self, reference: Float[np.ndarray, "nodes 3"]) -> JoinedCircles:
        """The chart about a reference shape, for many shapes near it."""
        from tensctl.elements.great_circle import JoinedCircles

        down = sp.csr_array(self.basis(reference).T @ sp.diags_array(1 / self.weights))
        return JoinedCircles(self.ends.chart(reference[self.end_node]), self.end_node, down)

    def retraction(self, nodes: Float[np.ndarray, "nodes 3"]) -> Callable[[np.ndarray], np.ndarray]:
        """`tied` from one shape, for many steps of the rods' own coordinates."""
        return partial(self.tied, nodes)

    def logarithm(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """Chart of nodes about a reference: the rods' great-circle chart, projected square to the mass metric."""
        return self.chart(reference).at(nodes, np.zeros_like(nodes))[0]

    def velocity(
        self,
        reference: Float[np.ndarray, "nodes 3"],
        nodes: Float[np.ndarray, "nodes 3"],
        velocities: Float[np.ndarray, "nodes 3"],
    ) -> Float[np.ndarray, " size"]:
        """Rate of `logarithm` when the nodes move, m/s."""
        return self.chart(reference).at(nodes, velocities)[1]

    def coordinates_of(
        self, nodes: Float[np.ndarray, "nodes 3"], motion: Float[np.ndarray, "coordinates k"]
    ) -> Float[np.ndarray, "size k"]:
        """Coordinates y of nodal displacements (3N, k) that keep rods rigid, joints closed and guides."""
        rows = (3 * self.end_node[:, None] + np.arange(3)).ravel()
        xi = self.ends.coordinates_of(nodes[self.end_node], motion[rows])
        return self.basis(nodes).T @ (xi / self.weights[:, None])

    @cached_property
    def _held(self) -> np.ndarray:
        """Nodal coordinates that never move, (3N,) bool."""
        at_ends = np.repeat(self.ends.sign.ravel() == 0, 3)
        at_ends[self.first[self.second < 0]] = True
        held = np.zeros(self.anchor.size, bool)
        held[(3 * self.end_node[:, None] + np.arange(3)).ravel()[at_ends]] = True
        return held

    @cached_property
    def _matrix(self) -> sp.csr_array:
        """C, (nc, 3 ends)."""
        row, two = np.arange(self.first.size), self.second >= 0
        entries = np.concatenate([np.ones(row.size), -np.ones(int(two.sum()))])
        index = np.concatenate([row, row[two]]), np.concatenate([self.first, self.second[two]])
        return sp.csr_array(sp.coo_array((entries, index), shape=(row.size, 3 * self.end_node.size)))

    @cached_property
    def _chains(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows and rods' coordinates of each set of rods that rows tie together."""
        count = len(self.rods)
        one, two = self.first // 6, np.where(self.second < 0, self.first, self.second) // 6
        tied = sp.coo_array((np.ones(one.size), (one, two)), shape=(count, count))
        chains, of_rod = connected_components(tied, directed=False)
        of_column = np.zeros(self.ends.size, int)
        of_column[self.ends.centre_columns] = of_rod[self.ends.free][:, None]
        of_column[self.ends.direction_columns] = of_rod[self.ends.moving][:, None]
        return [(np.flatnonzero(of_rod[one] == k), np.flatnonzero(of_column == k)) for k in range(chains)]

    def _jacobian(self, J: sp.csr_array) -> sp.csr_array:
        """A: how rows change with the rods' coordinates, (nc, size of ends)."""
        return sp.csr_array(self._matrix @ J)

    def _factor(self, nodes: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Q of each chain's pivoted QR, and the sizes of its diagonal."""
        jacobian, root, factors = self._jacobian(self.ends.tangent(nodes[self.end_node])), np.sqrt(self.weights), []
        for rows, columns in self._chains:
            block = jacobian[rows][:, columns].toarray() * root[columns]
            Q, R, _ = sla.qr(block.T, pivoting=True) if block.size else (np.eye(columns.size), np.zeros((0, 0)), None)
            factors.append((Q, np.abs(np.diag(R))))
        return factors

    def basis(self, nodes: np.ndarray) -> sp.csr_array:
        """Z, (size of ends, size): square in the mass metric, rows keep their values along it."""
        key = nodes.tobytes()
        if self._kept.get("key") != key:
            blocks = [Q[:, rank:] for (Q, _), rank in zip(self._factor(nodes), self.ranks, strict=True)]
            order = np.argsort(np.concatenate([columns for _, columns in self._chains]))
            square = sp.csr_array(sp.block_diag(blocks, format="csr"))[order]
            self._kept.update(key=key, basis=sp.csr_array(sp.diags_array(np.sqrt(self.weights)) @ square))
        return self._kept["basis"]

    @cached_property
    def _kept(self) -> dict:
        """The last basis made: gradient, Hessian and step ask for the same one."""
        return {}

    def _find_ranks(self) -> np.ndarray:
        diagonals = [diagonal for _, diagonal in self._factor(self.anchor)]
        largest = max([diagonal.max(initial=1e-300) for diagonal in diagonals])
        sizes = np.concatenate(diagonals) / largest
        close = sizes[(sizes > 1e-13) & (sizes < 1e-6)]
        if close.size:
            raise StructureError(
                f"joints or guides are independent or redundant by {close[0]:.0e} of their size, which double "
                "precision cannot tell; move the nodes a little, or leave a redundant one out."
            )
        return np.array([int((diagonal > _REDUNDANT * largest).sum()) for diagonal in diagonals])

    def _check_regular(self) -> None:
        """Rows that are redundant at the structure's own nodes only leave no manifold there."""
        if self.rank == self.first.size or self.size == 0:
            return
        way = np.random.default_rng(0).standard_normal(self.size)
        step = _NEARBY * self.ends.lengths.mean() / np.linalg.norm(way) * way
        arrived = self.logarithm(self.anchor, self.retract(self.anchor, step))
        if not np.linalg.norm(arrived - step) <= _ARRIVES * np.linalg.norm(step):
            raise StructureError(
                f"joints and guides lock or branch at the structure's own nodes, where {self.rank} of their "
                f"{self.first.size} conditions are independent; move the nodes a little, or hold fewer directions."
            )


def _rows(structure: Structure) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The end that stands for each node, and both coordinates of every joint's and guide's rows."""
    end_node, axes = structure.rods.ravel(), range(structure.dimension)
    shown, first, second = np.full(len(structure.nodes), -1), [], []
    for end, node in enumerate(end_node):
        if shown[node] < 0:
            shown[node] = end
        elif not structure.pinned[node]:
            first += [3 * shown[node] + axis for axis in axes]
            second += [3 * end + axis for axis in axes]
    guided, axis = np.nonzero(structure.guides & (shown >= 0)[:, None])
    first = np.concatenate([np.array(first, int), 3 * shown[guided] + axis])
    second = np.concatenate([np.array(second, int), np.full(guided.size, -1)])
    return shown, first, second
