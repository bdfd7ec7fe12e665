"""One sector of a cyclically symmetric structure, whose neighbours are turned copies of itself.

A tendon from node a of the sector to node b of the sector d turns on spans R^d p_b - p_a, so with the sparse span map
S_k (-I at a, exp(2 pi i k d/n) R^d at b), the sector's nodes p and its rods' manifold

    V = sum_t V_t(S_0 p) - sum w . (p - p_initial),   gradient J' V_p,   H_k = J' S_k* V_dd S_k J + curvature

H_0 is the exact Hessian of what the whole structure does symmetrically, a sector of it; H_k with k = 1 ... n - 1 that
of motions in which each sector repeats the one before it, turned by 2 pi/n and delayed by 2 pi k/n. Together the n
blocks are the whole Hessian in other coordinates: it is stable when each of them is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.elements import Potential, RodManifold, TendonTerms, tendon_terms
from tensctl.statics import balance
from tensctl.statics.newton import DENSE_SECTOR, orthonormal
from tensctl.statics.rigid import works_on
from tensctl.statics.symmetry import CyclicSymmetry
from tensctl.structure import Structure

# A stretch below this part of the length is rounding of the length itself (as in `elements.potential`).
_STRETCH_NOISE = 1e-14


@dataclass(frozen=True, eq=False)
class Sector:
    """The part of a potential that decides for all, about a centre on the axis.

    Attributes
    ----------
    potential : Potential
        The whole structure.
    symmetry : CyclicSymmetry
    rest_lengths : (nt,) m
        Of the whole structure.
    manifold : RodManifold
        Of the sector's rods.
    tails, heads, apart : (sector tendons,) int
        Each tendon runs from a node of this sector to a node of the sector `apart` turns on.
    """

    potential: Potential
    symmetry: CyclicSymmetry
    rest_lengths: Float[np.ndarray, " tendons"]
    manifold: RodManifold
    tails: Int[np.ndarray, " sector_tendons"]
    heads: Int[np.ndarray, " sector_tendons"]
    apart: Int[np.ndarray, " sector_tendons"]

    @classmethod
    def of(cls, potential: Potential, symmetry: CyclicSymmetry, rest_lengths: np.ndarray) -> Sector:
        """The sector in row 0 of the symmetry's members."""
        structure = potential.structure
        turn_of, place = symmetry.turns_to, np.empty(len(structure.nodes), int)
        place[symmetry.nodes] = np.arange(symmetry.nodes.shape[1])
        ends = structure.tendons[symmetry.tendons[0]]
        apart = (turn_of[ends[:, 1]] - turn_of[ends[:, 0]]) % symmetry.order
        manifold = RodManifold.of(_part(structure, symmetry, place))
        return cls(potential, symmetry, rest_lengths, manifold, place[ends[:, 0]], place[ends[:, 1]], apart)

    @property
    def scale(self) -> float:
        """Mean rod length, m."""
        return float(self.manifold.lengths.mean())

    @property
    def dense(self) -> bool:
        """Whether all eigenvectors of a sector's Hessian are taken."""
        return self.manifold.size <= DENSE_SECTOR

    @cached_property
    def forces(self) -> Float[np.ndarray, "sector_nodes 3"]:
        """Loads on the sector's nodes, the mean over all sectors turned back, N."""
        loads = self.potential.members.forces[self.symmetry.nodes]
        return np.einsum("sji,saj->ai", self.symmetry.turns, loads) / self.symmetry.order

    @property
    def start(self) -> Float[np.ndarray, "sector_nodes 3"]:
        """The structure's own nodes, from the centre, m."""
        return self.restrict(self.potential.structure.nodes)

    @cached_property
    def pinned(self) -> np.ndarray:
        """Nodes on the ground."""
        return self.potential.structure.pinned[self.symmetry.nodes[0]]

    @property
    def _directions_held(self) -> np.ndarray:
        return self.potential.structure.held[self.symmetry.nodes[0]]

    def restrict(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "sector_nodes 3"]:
        """The sector's nodes, from the centre, m."""
        return nodes[self.symmetry.nodes[0]] - self.symmetry.centre

    def span_map(self, harmonic: int = 0) -> sp.csr_array:
        """S_k, (3 sector tendons, 3 sector nodes); complex unless every phase is real."""
        turned = self.symmetry.turns[self.apart]
        if harmonic:
            turned = turned * np.exp(2j * np.pi * harmonic * self.apart / self.symmetry.order)[:, None, None]
        count = len(self.tails)
        blocks = np.concatenate([np.broadcast_to(-np.eye(3), turned.shape), turned])
        rows = 3 * np.tile(np.arange(count), 2)[:, None, None] + np.arange(3)[:, None]
        columns = 3 * np.concatenate([self.tails, self.heads])[:, None, None] + np.arange(3)
        index = tuple(np.broadcast_to(k, blocks.shape).ravel() for k in (rows, columns))
        return sp.csr_array(sp.coo_array((blocks.ravel(), index), shape=(3 * count, 3 * self.symmetry.nodes.shape[1])))

    @cached_property
    def spans(self) -> sp.csr_array:
        """S_0."""
        return self.span_map()

    def at(self, nodes: Float[np.ndarray, "sector_nodes 3"]) -> SectorPoint:
        """The energy of the sector, with derivatives."""
        d = (self.spans @ nodes.ravel()).reshape(-1, 3)
        members, which = self.potential.members, self.symmetry.tendons[0]
        ends = np.arange(2 * len(d)).reshape(2, -1).T
        origin_and_end = np.vstack([np.zeros_like(d), d])
        rest, stiffness = self.rest_lengths[which], members.stiffness[which]
        terms = tendon_terms(origin_and_end, ends, rest, stiffness, members.law)
        return SectorPoint(self, nodes, np.linalg.norm(d, axis=1), terms)

    def retract(self, nodes: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Nodes after a step, exactly on the manifold."""
        return self.manifold.retract(nodes, step)

    def residual(self, point: SectorPoint) -> float:
        """Largest unbalanced force over the largest tension or load; 0 when there are neither."""
        if point.at_ease:
            return 0.0
        left = balance.left_over(self.manifold, self._directions_held, point.nodes, point.nodal_forces)
        return balance.relative(left, point.terms.tensions, self.forces)

    def held(self, point: SectorPoint) -> np.ndarray:
        """Motion along and turn about the axis, where nothing is pinned and no load sees them."""
        if self.pinned.any():
            return np.zeros((self.manifold.size, 0))
        axis = self.symmetry.axis
        fields = np.stack([np.concatenate([axis, 0 * axis]), np.concatenate([0 * axis, axis])], axis=1)
        fields = fields[:, ~works_on(self.forces, fields)]
        motion = fields[:3] + np.cross(fields[3:].T[None], point.nodes[:, None, :]).transpose(0, 2, 1)
        return orthonormal(self.manifold.coordinates_of(point.nodes, motion.reshape(point.nodes.size, fields.shape[1])))


@dataclass(frozen=True, eq=False)
class SectorPoint:
    """A sector's energy at given nodes; derivatives are made when asked for."""

    sector: Sector
    nodes: Float[np.ndarray, "sector_nodes 3"]
    lengths: Float[np.ndarray, " sector_tendons"]
    terms: TendonTerms

    @cached_property
    def energy(self) -> float:
        """Elastic energy less the work of loads, J, of one sector."""
        work = float((self.sector.forces * (self.nodes - self.sector.start)).sum())
        return float(self.terms.energies.sum()) - work

    @property
    def at_ease(self) -> bool:
        """Whether nothing pulls at all: every tendon slack to rounding, and no load."""
        rest = self.sector.rest_lengths[self.sector.symmetry.tendons[0]]
        return bool((self.lengths - rest <= _STRETCH_NOISE * self.lengths).all()) and not self.sector.forces.any()

    @cached_property
    def nodal_forces(self) -> Float[np.ndarray, "sector_nodes 3"]:
        """Tendon forces and loads on each node, N."""
        return self.sector.forces - (self.sector.spans.T @ self.terms.pulls.ravel()).reshape(-1, 3)

    @cached_property
    def tangent(self) -> sp.csr_array:
        """The map J of the sector's manifold."""
        return self.sector.manifold.tangent(self.nodes)

    @cached_property
    def gradient(self) -> Float[np.ndarray, " size"]:
        """Gradient in the sector's tangent coordinates, N."""
        return -(self.tangent.T @ self.nodal_forces.ravel())

    @property
    def hessian(self) -> sp.csr_array:
        """H_0, N/m."""
        return self.harmonic(0)

    def harmonic(self, k: int) -> sp.csr_array:
        """H_k, N/m: real for k = 0, Hermitian otherwise."""
        spans = (self.sector.spans if k == 0 else self.sector.span_map(k)) @ self.tangent
        elastic = spans.conj().T @ _block_diagonal(self.terms.blocks) @ spans
        return sp.csr_array(elastic + self.sector.manifold.bend(self.nodes, -self.nodal_forces))


def _part(structure: Structure, symmetry: CyclicSymmetry, place: np.ndarray) -> Structure:
    """The sector's nodes and rods as a structure of their own, without tendons."""
    nodes, rods = symmetry.nodes[0], symmetry.rods[0]
    return replace(
        structure,
        nodes=structure.nodes[nodes],
        rods=place[structure.rods[rods]],
        tendons=np.zeros((0, 2), int),
        node_labels=tuple(structure.node_labels[i] for i in nodes),
        rod_labels=tuple(structure.rod_labels[r] for r in rods),
        tendon_labels=(),
        pinned=structure.pinned[nodes],
        guides=structure.guides[nodes],
    )


def _block_diagonal(blocks: Float[np.ndarray, "k 3 3"]) -> sp.bsr_array:
    count = len(blocks)
    return sp.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count))
