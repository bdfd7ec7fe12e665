"""The potential energy of a structure on the rods' manifold, with exact first and second derivatives.

V(xi) = sum_t V_t - sum_nodes w . (p - p_initial),   gradient J' V_p,   Hessian J' V_pp J + curvature
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.elements.assembly import TendonTerms, tendon_terms
from tensctl.elements.cables import CableTerms, cable_terms
from tensctl.elements.jointed import JointedManifold
from tensctl.elements.manifold import RodManifold
from tensctl.structure import Members, Structure, build_members, build_structure

if TYPE_CHECKING:
    from tensctl.scene import Scene


# A stretch below this part of the length is rounding of the length itself: such a tendon carries nothing.
_STRETCH_NOISE = 1e-14


@dataclass(frozen=True, eq=False)
class Potential:
    """Structure, materials and manifold: all that decides where the structure rests."""

    structure: Structure
    members: Members
    manifold: RodManifold | JointedManifold

    @classmethod
    def of(cls, scene: Scene) -> Potential:
        """The potential of a scene."""
        structure = build_structure(scene)
        members = build_members(scene, structure)
        if structure.jointed or structure.has_guides:
            return cls(structure, members, JointedManifold.of(structure, members.mass))
        return cls(structure, members, RodManifold.of(structure))

    def at(
        self, nodes: Float[np.ndarray, "nodes 3"], rest_lengths: Float[np.ndarray, " tendons"] | None = None
    ) -> PotentialPoint:
        """Everything about the potential at one set of nodes."""
        structure, members = self.structure, self.members
        rest = members.rest_lengths if rest_lengths is None else rest_lengths
        if structure.has_cables:
            cables = cable_terms(nodes, structure, rest, members.stiffness, members.law)
            return PotentialPoint(self, nodes, rest, cables)
        terms = tendon_terms(nodes, structure.tendons, rest, members.stiffness, members.law)
        return PotentialPoint(self, nodes, rest, terms)


@dataclass(frozen=True, eq=False)
class PotentialPoint:
    """The potential at given nodes and rest lengths; derivatives are made when asked for."""

    potential: Potential
    nodes: Float[np.ndarray, "nodes 3"]
    rest_lengths: Float[np.ndarray, " tendons"]
    terms: TendonTerms | CableTerms

    @cached_property
    def energy(self) -> float:
        """Elastic energy less the work of loads and weight since the initial nodes, J."""
        forces = self.potential.members.forces
        work = float((forces * (self.nodes - self.potential.structure.nodes)).sum())
        return float(self.terms.energies.sum()) - work

    @cached_property
    def nodal_forces(self) -> Float[np.ndarray, "nodes 3"]:
        """Tendon forces, loads and weight on each node, N; rods and ground are not among them."""
        return self.potential.members.forces - self.terms.gradient

    @cached_property
    def at_ease(self) -> bool:
        """Whether nothing pulls at all: every tendon slack to rounding, no load, no weight."""
        length = self.potential.structure.lengths_at(self.nodes)
        slack = length - self.rest_lengths <= _STRETCH_NOISE * length
        return bool(slack.all()) and not self.potential.members.forces.any()

    @cached_property
    def tangent(self) -> sp.csr_array:
        """The map J from tangent coordinates to nodal displacements."""
        return self.potential.manifold.tangent(self.nodes)

    @cached_property
    def gradient(self) -> Float[np.ndarray, " size"]:
        """Gradient in tangent coordinates, N."""
        return -(self.tangent.T @ self.nodal_forces.ravel())

    @cached_property
    def hessian(self) -> sp.csr_array:
        """Riemannian Hessian in tangent coordinates, N/m."""
        elastic = self.tangent.T @ self.terms.stiffness @ self.tangent
        return sp.csr_array(elastic + self.potential.manifold.bend(self.nodes, -self.nodal_forces))

    @cached_property
    def input_map(self) -> sp.csr_array:
        """Force in tangent coordinates per unit of rest-length shortening of each tendon, (size, nt), N/m."""
        return sp.csr_array(-(self.tangent.T @ self.terms.input_map))
