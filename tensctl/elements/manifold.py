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

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.elements.rod import Hold
from tensctl.structure import Structure


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
            return np.cross([0.0, 0.0, 1.0], e)[:, None]
        across = np.eye(3)[np.abs(e).argmin(axis=1)]
        first = np.cross(e, across)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, np.cross(e, first)], axis=1)

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

    def logarithm(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """Step that `retract` would take from the reference to the nodes (rods less than half a turn away)."""
        e, target = self.directions(reference), self.directions(nodes)
        cosine = np.einsum("ri,ri->r", e, target)
        across = target - cosine[:, None] * e
        sine = np.linalg.norm(across, axis=1)
        stretch = np.where(sine > 0, np.arctan2(sine, cosine) / np.where(sine > 0, sine, 1.0), 1.0)
        tau = (self.lever * stretch)[:, None] * across
        return self._coordinates(reference, self._base(nodes) - self._base(reference), tau)

    def untied(
        self, reference: Float[np.ndarray, "nodes 3"], nodes: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " size"]:
        """The same as `logarithm`: nothing ties these rods."""
        return self.logarithm(reference, nodes)

    def tied(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " size"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """The same as `retract`."""
        return self.retract(nodes, step)

    def velocity(
        self,
        reference: Float[np.ndarray, "nodes 3"],
        nodes: Float[np.ndarray, "nodes 3"],
        velocities: Float[np.ndarray, "nodes 3"],
    ) -> Float[np.ndarray, " size"]:
        """Rate of `logarithm` when the nodes move, exact: the derivative of the great-circle chart, m/s."""
        e, target = self.directions(reference), self.directions(nodes)
        turning = (velocities[self.rods[:, 1]] - velocities[self.rods[:, 0]]) / self.lengths[:, None]
        cosine = np.einsum("ri,ri->r", e, target)
        across = target - cosine[:, None] * e
        sine = np.linalg.norm(across, axis=1)
        angle = np.arctan2(sine, cosine)
        unit = across / np.where(sine > 0, sine, 1.0)[:, None]
        cosine_rate = np.einsum("ri,ri->r", e, turning)
        across_rate = turning - cosine_rate[:, None] * e
        sine_rate = np.einsum("ri,ri->r", unit, across_rate)
        stretch = np.where(sine > 0, angle / np.where(sine > 0, sine, 1.0), 1.0)
        tau_rate = stretch[:, None] * (across_rate - sine_rate[:, None] * unit)
        tau_rate += (cosine * sine_rate - sine * cosine_rate)[:, None] * unit
        tau_rate = np.where(sine[:, None] > 1e-12, self.lever[:, None] * tau_rate, self.lever[:, None] * across_rate)
        return self._coordinates(reference, self._base(velocities), tau_rate)

    def _coordinates(self, reference: np.ndarray, centre: np.ndarray, tau: np.ndarray) -> np.ndarray:
        step = np.zeros(self.size)
        step[self.centre_columns] = centre[self.free, : self.dimension]
        step[self.direction_columns] = np.einsum("ri,rki->rk", tau, self.frames(reference))[self.moving]
        return step

    def _base(self, nodes: np.ndarray) -> np.ndarray:
        """The point that each rod turns about: its centre when free, its held end otherwise."""
        tail, head = nodes[self.rods[:, 0]], nodes[self.rods[:, 1]]
        middle = 0.5 * (tail + head)
        held_tail = np.isin(self.hold, (Hold.TAIL, Hold.FIXED))[:, None]
        return np.where(held_tail, tail, np.where((self.hold == Hold.HEAD)[:, None], head, middle))

    def _ends(self, nodes: np.ndarray, base: np.ndarray, e: np.ndarray) -> np.ndarray:
        result = nodes.copy()
        for side in (0, 1):
            at = self.sign[:, side] != 0
            result[self.rods[at, side]] = base[at] + (self.sign[at, side] * self.lever[at])[:, None] * e[at]
        return result
