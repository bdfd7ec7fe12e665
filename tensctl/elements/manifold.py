"""The rods' own manifold: centres move straight, directions on great circles.

A free rod has p = c -+ (L/2) e with tangent coordinates (dc, tau), tau = (L/2) d e in the plane across e;
a rod held at one end has p_free = p_held +- L e with tau = L de. All coordinates are in metres: they are
displacements of rod ends, so the map to nodal displacements has entries of size one. To second order

    p(xi) = p + J xi - (|tau|^2 / (2 rho)) s e,   rho = L/2 or L,  s = +1 head, -1 tail

which gives the Riemannian Hessian J'VppJ - sum (s e . Vp / rho) I: the term of the rod's compression.
In these coordinates the mass matrix is diagonal: m for centres, m/3 for directions ([S] A.2, A.10).
In a plane a centre has two coordinates and a direction one, along z x e.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.elements.rod import Hold
from tensctl.structure import Structure

if TYPE_CHECKING:
    from tensctl.elements.great_circle import GreatCircles


@dataclass(frozen=True, eq=False)
class RodManifold:
    """Tangent coordinates of a structure whose rods are rigid and share no node.

    Attributes
    ----------
    rods : (nr, 2) int
    hold : (nr,) int, values of `Hold`
    lengths : (nr,) m
    node_count : int
    planar : bool
        Whether rods stay in the plane z = 0: 2 + 1 coordinates a free rod, 1 a rod held at one end.
    """

    rods: Int[np.ndarray, "rods 2"]
    hold: Int[np.ndarray, " rods"]
    lengths: Float[np.ndarray, " rods"]
    node_count: int
    planar: bool = False

    @classmethod
    def of(cls, structure: Structure) -> RodManifold:
        """The manifold of a structure with its rods and pins."""
        held = structure.pinned[structure.rods]
        hold = np.select([held.all(axis=1), held[:, 0], held[:, 1]], [Hold.FIXED, Hold.TAIL, Hold.HEAD], Hold.FREE)
        return cls(structure.rods, hold.astype(int), structure.rod_lengths, len(structure.nodes), structure.planar)

    @property
    def dimension(self) -> int:
        """3, or 2 when planar."""
        return 2 if self.planar else 3

    @cached_property
    def free(self) -> Int[np.ndarray, " free"]:
        """Rods with both ends free."""
        return np.flatnonzero(self.hold == Hold.FREE)

    @cached_property
    def moving(self) -> Int[np.ndarray, " moving"]:
        """Rods with at least one free end."""
        return np.flatnonzero(self.hold != Hold.FIXED)

    @cached_property
    def lever(self) -> Float[np.ndarray, " rods"]:
        """Distance rho from the point that the rod turns about to its free end, m."""
        return np.where(self.hold == Hold.FREE, 0.5, 1.0) * self.lengths

    @cached_property
    def sign(self) -> Float[np.ndarray, "rods 2"]:
        """-1 at a free tail, +1 at a free head, 0 at a held end."""
        tail_free = np.isin(self.hold, (Hold.FREE, Hold.HEAD))
        head_free = np.isin(self.hold, (Hold.FREE, Hold.TAIL))
        return np.column_stack([np.where(tail_free, -1.0, 0.0), np.where(head_free, 1.0, 0.0)])

    @cached_property
    def centre_columns(self) -> Int[np.ndarray, "free dimension"]:
        """Coordinates of the free rods' centres."""
        return self._first_column[self.free][:, None] + np.arange(self.dimension)

    @cached_property
    def direction_columns(self) -> Int[np.ndarray, "moving turns"]:
        """Coordinates of the moving rods' directions."""
        first = self._first_column[self.moving] + self.dimension * (self.hold[self.moving] == Hold.FREE)
        return first[:, None] + np.arange(self.dimension - 1)

    @cached_property
    def _sizes(self) -> np.ndarray:
        return np.select(
            [self.hold == Hold.FREE, self.hold == Hold.FIXED], [2 * self.dimension - 1, 0], self.dimension - 1
        )

    @cached_property
    def _first_column(self) -> np.ndarray:
        return np.concatenate([[0], np.cumsum(self._sizes)[:-1]]).astype(int)

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return int(self._sizes.sum())

    def mass(self, rod_mass: Float[np.ndarray, " rods"]) -> Float[np.ndarray, " size"]:
        """Diagonal of the mass matrix in tangent coordinates, kg."""
        diagonal = np.empty(self.size)
        diagonal[self.centre_columns] = rod_mass[self.free, None]
        diagonal[self.direction_columns] = rod_mass[self.moving, None] / 3
        return diagonal

    def directions(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "rods 3"]:
        """Unit vectors e from tail to head."""
        e = nodes[self.rods[:, 1]] - nodes[self.rods[:, 0]]
        return e / np.linalg.norm(e, axis=1, keepdims=True)

    def frames(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "rods turns 3"]:
        """Unit vectors across each rod, square to it and to each other: two, or one in a plane."""
        e = self.directions(nodes)
        if self.planar:
            return np.column_stack([-e[:, 1], e[:, 0], np.zeros(len(e))])[:, None]
        across = np.eye(3)[np.abs(e).argmin(axis=1)]
        first = _cross(e, across)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, _cross(e, first)], axis=1)

    def tangent(self, nodes: Float[np.ndarray, "nodes 3"]) -> sp.csr_array:
        """Sparse map J from tangent coordinates to nodal displacements, (3N, size), entries of size one."""
        frames = self.frames(nodes)
        rows, columns, values = [], [], []
        for side in (0, 1):
            row = 3 * self.rods[self.free, side][:, None] + np.arange(self.dimension)
            rows.append(row.ravel())
            columns.append(self.centre_columns.ravel())
            values.append(np.ones(row.size))
            at = self.moving[self.sign[self.moving, side] != 0]
            column = self.direction_columns[self.sign[self.moving, side] != 0]
            row = np.broadcast_to(3 * self.rods[at, side][:, None, None] + np.arange(3), (*column.shape, 3))
            rows.append(row.ravel())
            columns.append(np.broadcast_to(column[:, :, None], row.shape).ravel())
            values.append((self.sign[at, side][:, None, None] * frames[at]).ravel())
        index = (np.concatenate(rows), np.concatenate(columns))
        return sp.csr_array(sp.coo_array((np.concatenate(values), index), shape=(3 * self.node_count, self.size)))

    def curvature(
        self, nodes: Float[np.ndarray, "nodes 3"], gradient: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """Diagonal that the bend of the manifold adds to the Hessian, -(s e . gradient)/rho on directions, N/m."""
        pull = (self.sign[:, :, None] * gradient[self.rods]).sum(axis=1)
        along = np.einsum("ri,ri->r", self.directions(nodes), pull)
        diagonal = np.zeros(self.size)
        diagonal[self.direction_columns] = (-along / self.lever)[self.moving, None]
        return diagonal

    def bend(self, nodes: Float[np.ndarray, "nodes 3"], gradient: Float[np.ndarray, "nodes 3"]) -> sp.dia_array:
        """What the bend of the manifold adds to the Hessian, (size, size) N/m."""
        return sp.diags_array(self.curvature(nodes, gradient))

    def coordinates_of(
        self, nodes: Float[np.ndarray, "nodes 3"], motion: Float[np.ndarray, "coordinates k"]
    ) -> Float[np.ndarray, "size k"]:
        """Tangent coordinates of nodal displacements (3N, k) that keep rods rigid."""
        ends = np.zeros(self.size)
        ends[self.centre_columns] = 2.0
        ends[self.direction_columns] = np.where(self.hold[self.moving] == Hold.FREE, 2.0, 1.0)[:, None]
        return (self.tangent(nodes).T @ motion) / ends[:, None]

    def retract(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " size"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Nodes after a step in tangent coordinates, exactly on the manifold."""
        e, tau = self.directions(nodes), np.zeros((len(self.rods), 3))
        tau[self.moving] = np.einsum("rk,rki->ri", step[self.direction_columns], self.frames(nodes)[self.moving])
        angle = np.linalg.norm(tau, axis=1) / self.lever
        turned = np.cos(angle)[:, None] * e + (np.sinc(angle / np.pi) / self.lever)[:, None] * tau
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        moved = self._base(nodes)
        moved[self.free, : self.dimension] += step[self.centre_columns]
        return self._ends(nodes, moved, turned)

    def chart(self, reference: Float[np.ndarray, "nodes 3"]) -> GreatCircles:
        """The chart about a reference shape, for many shapes near it."""
        from tensctl.elements.great_circle import GreatCircles

        middle = 0.5 * (reference[self.rods[:, 0]] + reference[self.rods[:, 1]])[:, : self.dimension]
        return GreatCircles(
            self.rods, self.hold, self.lengths, self.lever, self._first_column, np.ascontiguousarray(middle),
            self.directions(reference), np.ascontiguousarray(self.frames(reference)), self.size,
        )  # fmt: skip

    def retraction(self, nodes: Float[np.ndarray, "nodes 3"]) -> Callable[[np.ndarray], np.ndarray]:
        """`retract` from one shape, compiled, for many steps."""
        return partial(self.chart(nodes).place, nodes)

    def logarithm(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """Step that `retract` would take from the reference to the nodes (rods less than half a turn away)."""
        return self.chart(reference).at(nodes, np.zeros_like(nodes))[0]

    def untied(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """The same as `logarithm`: nothing ties these rods."""
        return self.logarithm(reference, nodes)

    def velocity(
        self,
        reference: Float[np.ndarray, "nodes 3"],
        nodes: Float[np.ndarray, "nodes 3"],
        velocities: Float[np.ndarray, "nodes 3"],
    ) -> Float[np.ndarray, " size"]:
        """Rate of `logarithm` when the nodes move, exact: the derivative of the great-circle chart, m/s."""
        return self.chart(reference).at(nodes, velocities)[1]

    def _base(self, nodes: np.ndarray) -> np.ndarray:
        """The point that each rod turns about: its centre when free, its held end otherwise."""
        tail, head = nodes[self.rods[:, 0]], nodes[self.rods[:, 1]]
        share = self._head_share
        return (1 - share) * tail + share * head

    @cached_property
    def _head_share(self) -> np.ndarray:
        """Share of the head in the point that each rod turns about, (nr, 1)."""
        share = np.select([self.hold == Hold.FREE, self.hold == Hold.HEAD], [0.5, 1.0], 0.0)
        return share[:, None]

    def _ends(self, nodes: np.ndarray, base: np.ndarray, e: np.ndarray) -> np.ndarray:
        result = nodes.copy()
        for at, place, reach in self._free_ends:
            result[place] = base[at] + reach * e[at]
        return result

    @cached_property
    def _free_ends(self) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]:
        """For tails, then heads: rods whose end is free, its node, and where it is along e from their turning point."""
        sides = [(side, np.flatnonzero(self.sign[:, side])) for side in (0, 1)]
        return tuple((at, self.rods[at, side], (self.sign[at, side] * self.lever[at])[:, None]) for side, at in sides)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Row by row a x b; np.cross takes ten times as long for a few rows."""
    ax, ay, az, bx, by, bz = *a.T, *b.T
    return np.column_stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
