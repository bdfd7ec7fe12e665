"""Rods that meet in ball joints: the rods' manifold cut by closed joints.

Every rod keeps two ends of its own; a joint asks p_a - p_b = 0 of two of them, A xi = 0 in the rods' tangent
coordinates. Coordinates y of what is left are square in the mass metric, xi = Z y, Z'M Z = m I, m the mean rod mass:

    gradient Z'g,   Hessian Z' (H + curvature under the joint forces mu) Z,   mu = argmin |M^-1/2 (g + A'mu)|

A step goes along Z y and closes the joints again square to it, so rod lengths are exact and joints closed to rounding.
Redundant joints (loops of rods) lower the rank of A; it is decided once, at the structure's own nodes, from the
diagonal of a pivoted QR.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.elements.manifold import RodManifold
from tensctl.errors import StructureError
from tensctl.structure import Structure

# A diagonal of the pivoted QR below this part of the first is a redundant joint.
_REDUNDANT = 1e-9
_CLOSED = 1e-15
_CLOSINGS = 30


@dataclass(frozen=True, eq=False)
class JointedManifold:
    """Tangent coordinates of rods with ball joints; the same calls as `RodManifold`.

    Attributes
    ----------
    rods : (nr, 2) int
        Nodes of each rod; a node may end several.
    ends : RodManifold
        The rods with two ends of their own: end 2r is the tail of rod r, end 2r + 1 its head.
    end_node : (2 nr,) int
    shown : (N,) int
        The end that stands for each node, -1 for a node without a rod.
    pairs : (joints, 2) int
        Ends that coincide.
    weights : (size of ends,)
        Mean rod mass over the mass of each coordinate.
    rank : int
        Independent joint equations.
    anchor : (N, 3) m
        Where the structure has its nodes; nodes without a rod stay there.
    """

    rods: Int[np.ndarray, "rods 2"]
    ends: RodManifold
    end_node: Int[np.ndarray, " ends"]
    shown: Int[np.ndarray, " nodes"]
    pairs: Int[np.ndarray, "joints 2"]
    weights: Float[np.ndarray, " coordinates"]
    rank: int
    anchor: Float[np.ndarray, "nodes 3"]

    @classmethod
    def of(cls, structure: Structure, rod_mass: Float[np.ndarray, " rods"]) -> JointedManifold:
        """The manifold of a structure whose rods share nodes.

        Raises
        ------
        StructureError
            When double precision cannot tell how many joint equations are independent.
        """
        end_node = structure.rods.ravel()
        split = np.arange(end_node.size).reshape(-1, 2)
        free = RodManifold.of(structure)
        ends = RodManifold(split, free.hold, free.lengths, end_node.size)
        shown, pairs = _joints(structure)
        weights = rod_mass.mean() / ends.mass(rod_mass)
        rough = cls(structure.rods, ends, end_node, shown, pairs, weights, 0, structure.nodes)
        return cls(structure.rods, ends, end_node, shown, pairs, weights, rough._find_rank(), structure.nodes)

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
        moved = self.ends.tangent(nodes[self.end_node]) @ self._basis(nodes)
        full = np.zeros((nodes.size, self.size))
        has_rod = np.flatnonzero(self.shown >= 0)
        rows, ends = (3 * k[:, None] + np.arange(3) for k in (has_rod, self.shown[has_rod]))
        full[rows.ravel()] = moved[ends.ravel()]
        full[np.repeat(self._pinned_nodes, 3)] = 0.0
        return sp.csr_array(full)

    def bend(
        self, nodes: Float[np.ndarray, "nodes 3"], gradient: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, "size size"]:
        """What the bend of the manifold adds to the Hessian under a nodal gradient and its joint forces, N/m."""
        at_ends = np.zeros((self.end_node.size, 3))
        has_rod = np.flatnonzero(self.shown >= 0)
        at_ends[self.shown[has_rod]] = gradient[has_rod]
        J, root = self.ends.tangent(nodes[self.end_node]), np.sqrt(self.weights)
        jacobian = self._jacobian(J)
        pull = root * (J.T @ at_ends.ravel())
        joint, *_ = np.linalg.lstsq((jacobian * root).T, -pull, rcond=_REDUNDANT)
        joint = joint.reshape(-1, 3)
        np.add.at(at_ends, self.pairs[:, 0], joint)
        np.subtract.at(at_ends, self.pairs[:, 1], joint)
        basis = self._basis(nodes)
        return basis.T @ (self.ends.curvature(nodes[self.end_node], at_ends)[:, None] * basis)

    def retract(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " size"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Nodes after a step, with exact rod lengths and closed joints."""
        ends = self.ends.retract(nodes[self.end_node], self._basis(nodes) @ step)
        root, size, before = np.sqrt(self.weights), np.ptp(self.anchor, axis=0).max(), np.inf
        for _ in range(_CLOSINGS):
            gap = ends[self.pairs[:, 0]] - ends[self.pairs[:, 1]]
            worst = np.abs(gap).max(initial=0.0)
            if worst <= _CLOSED * size or not worst < before:
                break
            before = worst
            jacobian = self._jacobian(self.ends.tangent(ends)) * root
            back, *_ = np.linalg.lstsq(jacobian, -gap.ravel(), rcond=_REDUNDANT)
            ends = self.ends.retract(ends, root * back)
        moved, has_rod = nodes.copy(), self.shown >= 0
        moved[has_rod] = ends[self.shown[has_rod]]
        return moved

    def logarithm(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """Chart of nodes about a reference: the rods' great-circle chart, projected square to the mass metric."""
        xi = self.ends.logarithm(reference[self.end_node], nodes[self.end_node])
        return self._basis(reference).T @ (xi / self.weights)

    def velocity(
        self,
        reference: Float[np.ndarray, "nodes 3"],
        nodes: Float[np.ndarray, "nodes 3"],
        velocities: Float[np.ndarray, "nodes 3"],
    ) -> Float[np.ndarray, " size"]:
        """Rate of `logarithm` when the nodes move, m/s."""
        at_ends = (array[self.end_node] for array in (reference, nodes, velocities))
        return self._basis(reference).T @ (self.ends.velocity(*at_ends) / self.weights)

    def coordinates_of(
        self, nodes: Float[np.ndarray, "nodes 3"], motion: Float[np.ndarray, "coordinates k"]
    ) -> Float[np.ndarray, "size k"]:
        """Coordinates y of nodal displacements (3N, k) that keep rods rigid and joints closed."""
        rows = (3 * self.end_node[:, None] + np.arange(3)).ravel()
        xi = self.ends.coordinates_of(nodes[self.end_node], motion[rows])
        return self._basis(nodes).T @ (xi / self.weights[:, None])

    @cached_property
    def _pinned_nodes(self) -> np.ndarray:
        held = np.zeros(len(self.anchor), bool)
        held[self.end_node[self.ends.sign.ravel() == 0]] = True
        return held

    def _jacobian(self, J: sp.csr_array) -> np.ndarray:
        """A: how joints open with the rods' coordinates, (3 joints, size of ends)."""
        first, second = (3 * self.pairs[:, k][:, None] + np.arange(3) for k in (0, 1))
        return (J[first.ravel()] - J[second.ravel()]).toarray()

    def _factor(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        jacobian = self._jacobian(self.ends.tangent(nodes[self.end_node])) * np.sqrt(self.weights)
        Q, R, _ = sla.qr(jacobian.T, pivoting=True)
        return Q, np.abs(np.diag(R))

    def _basis(self, nodes: np.ndarray) -> Float[np.ndarray, "coordinates size"]:
        """Z: square in the mass metric, joints stay closed along it."""
        key = nodes.tobytes()
        if self._kept.get("key") != key:
            Q, _ = self._factor(nodes)
            self._kept.update(key=key, basis=np.sqrt(self.weights)[:, None] * Q[:, self.rank :])
        return self._kept["basis"]

    @cached_property
    def _kept(self) -> dict:
        """The last basis made: gradient, Hessian and step ask for the same one."""
        return {}

    def _find_rank(self) -> int:
        _, diagonal = self._factor(self.anchor)
        sizes = diagonal / diagonal.max(initial=1e-300)
        rank = int((sizes > _REDUNDANT).sum())
        close = sizes[(sizes > 1e-13) & (sizes < 1e-6)]
        if close.size:
            raise StructureError(
                f"the joints are independent or redundant by {close[0]:.0e} of their size, which double precision "
                "cannot tell; move the nodes a little, or leave a redundant joint out."
            )
        return rank


def _joints(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """The end that stands for each node, and the pairs of free ends that share one."""
    end_node = structure.rods.ravel()
    shown, pairs = np.full(len(structure.nodes), -1), []
    for end, node in enumerate(end_node):
        if shown[node] < 0:
            shown[node] = end
        elif not structure.pinned[node]:
            pairs.append((shown[node], end))
    return shown, np.array(pairs, int).reshape(-1, 2)
