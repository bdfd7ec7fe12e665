"""Cables summed over a structure: one tension along all segments couples the nodes that a cable runs through.

With segments i of lengths l_i and unit vectors n_i, l = sum l_i and g = dl/dp, the gradient of the total length:

    V = V(l, L),   dV/dp = T g,   d2V/dp2 = sum_i (T / l_i) S_i' (I - n_i n_i') S_i + (dT/dl) g g'

S_i is the signed incidence of a segment. V, T and their slopes are those of the tendon element.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.elements.assembly import scatter_blocks, tendon_terms
from tensctl.structure import Law, Structure


@dataclass(frozen=True, eq=False)
class CableTerms:
    """Tendons of a structure with cables at given nodes and rest lengths, and their sums over nodes.

    Attributes
    ----------
    structure : Structure
    nodes : (N, 3) m
    energies : (nt,) J
    tensions : (nt,) N
    slopes : (nt,) N/m
        dT/dl, by total length.
    through : (nt,) N/m
        Growth of the tension when the rest length shrinks.
    """

    structure: Structure
    nodes: Float[np.ndarray, "nodes 3"]
    energies: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    slopes: Float[np.ndarray, " tendons"]
    through: Float[np.ndarray, " tendons"]

    @cached_property
    def length_map(self) -> sp.csr_array:
        """dl/dp, (nt, 3N)."""
        return length_map(self.structure, self.nodes)

    @property
    def gradient(self) -> Float[np.ndarray, "nodes 3"]:
        """dV/dp: minus the tendon force on each node, N."""
        return (self.length_map.T @ self.tensions).reshape(-1, 3)

    @property
    def stiffness(self) -> sp.csr_array:
        """d2V/dp2, (3N, 3N), N/m."""
        unit, length = unit_vectors(self.structure, self.nodes)
        pull = self.tensions[self.structure.segment_tendon] / np.where(length > 0, length, np.inf)
        blocks = pull[:, None, None] * (np.eye(3) - unit[:, :, None] * unit[:, None, :])
        across = scatter_blocks(self.structure.segments, blocks, len(self.nodes))
        return sp.csr_array(across + self.length_map.T @ sp.diags_array(self.slopes) @ self.length_map)

    @property
    def input_map(self) -> sp.csr_array:
        """-d2V/dp dL, (3N, nt): growth of the gradient when each rest length shrinks, N/m."""
        return sp.csr_array(self.length_map.T @ sp.diags_array(self.through))


def cable_terms(
    nodes: Float[np.ndarray, "nodes 3"],
    structure: Structure,
    rest_lengths: Float[np.ndarray, " tendons"],
    stiffness: Float[np.ndarray, " tendons"],
    law: Law,
) -> CableTerms:
    """Evaluate the tendon element for every tendon of a structure with cables, each stretched out straight."""
    straight = np.zeros((2 * len(structure.tendons), 3))
    straight[1::2, 0] = structure.lengths_at(nodes)
    ends = np.arange(len(straight)).reshape(-1, 2)
    terms = tendon_terms(straight, ends, rest_lengths, stiffness, law)
    return CableTerms(structure, nodes, terms.energies, terms.tensions, terms.blocks[:, 0, 0], terms.shortening[:, 0])


def unit_vectors(structure: Structure, nodes: Float[np.ndarray, "nodes 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors from tail to head and lengths of the segments, (ns, 3) and (ns,) m; zero where both ends meet."""
    d = nodes[structure.segments[:, 1]] - nodes[structure.segments[:, 0]]
    length = np.linalg.norm(d, axis=1)
    return d / np.where(length > 0, length, 1.0)[:, None], length


def length_map(structure: Structure, nodes: Float[np.ndarray, "nodes 3"]) -> sp.csr_array:
    """Growth of each tendon's length per nodal displacement, (nt, 3N)."""
    segments, (unit, _) = structure.segments, unit_vectors(structure, nodes)
    rows = np.broadcast_to(structure.segment_tendon[:, None, None], (*segments.shape, 3))
    columns = 3 * segments[:, :, None] + np.arange(3)
    values = np.stack([-unit, unit], axis=1)
    entries = (values.ravel(), (rows.ravel(), columns.ravel()))
    return sp.csr_array(sp.coo_array(entries, shape=(len(structure.tendons), nodes.size)))
