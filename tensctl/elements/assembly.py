"""Tendon elements summed over a structure: energy, nodal forces, stiffness and input maps.

With V = sum_t V_t(p_head - p_tail, L_t): gradient over nodes g = S' dV/dd and stiffness S' K S, where S is the
signed incidence of the tendons ([W] C_s). The sparse Hessian is built from 3 x 3 element blocks, so code and
memory grow with the number of tendons only.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.elements.tendon import tendon_statics
from tensctl.structure import Law


@dataclass(frozen=True, eq=False)
class TendonTerms:
    """Tendon elements at given nodes and rest lengths, and their sums over nodes.

    Attributes
    ----------
    tendons : (nt, 2) int
    energies : (nt,) J
    tensions : (nt,) N
    pulls : (nt, 3) N
        dV/dd: the force on the tail.
    blocks : (nt, 3, 3) N/m
        d2V/dd2.
    shortening : (nt, 3) N/m
        Growth of the pull when the rest length shrinks.
    """

    tendons: Int[np.ndarray, "tendons 2"]
    node_count: int
    energies: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    pulls: Float[np.ndarray, "tendons 3"]
    blocks: Float[np.ndarray, "tendons 3 3"]
    shortening: Float[np.ndarray, "tendons 3"]

    @property
    def gradient(self) -> Float[np.ndarray, "nodes 3"]:
        """dV/dp: minus the tendon force on each node, N."""
        gradient = np.zeros((self.node_count, 3))
        np.add.at(gradient, self.tendons[:, 1], self.pulls)
        np.subtract.at(gradient, self.tendons[:, 0], self.pulls)
        return gradient

    @property
    def stiffness(self) -> sp.csr_array:
        """d2V/dp2, (3N, 3N), N/m."""
        return scatter_blocks(self.tendons, self.blocks, self.node_count)

    @property
    def input_map(self) -> sp.csr_array:
        """-d2V/dp dL, (3N, nt): growth of the gradient when each rest length shrinks, N/m."""
        count = len(self.tendons)
        rows = 3 * self.tendons[:, :, None] + np.arange(3)
        values = np.stack([-self.shortening, self.shortening], axis=1)
        columns = np.broadcast_to(np.arange(count)[:, None, None], rows.shape)
        entries = (values.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_array(sp.coo_array(entries, shape=(3 * self.node_count, count)))


def scatter_blocks(
    tendons: Int[np.ndarray, "tendons 2"], blocks: Float[np.ndarray, "tendons 3 3"], node_count: int
) -> sp.csr_array:
    """Sum of S' block S over tendons, (3N, 3N): +block on both ends, -block across."""
    ends = 3 * tendons[:, :, None] + np.arange(3)
    rows, columns, values = [], [], []
    for a in (0, 1):
        for b in (0, 1):
            shape = blocks.shape
            rows.append(np.broadcast_to(ends[:, a, :, None], shape).ravel())
            columns.append(np.broadcast_to(ends[:, b, None, :], shape).ravel())
            values.append((blocks if a == b else -blocks).ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sp.csr_array(sp.coo_array(entries, shape=(3 * node_count, 3 * node_count)))


@lru_cache(maxsize=16)
def _mapped(law: Law, count: int) -> ca.Function:
    return tendon_statics(law).map(count)


def tendon_terms(
    nodes: Float[np.ndarray, "nodes 3"],
    tendons: Int[np.ndarray, "tendons 2"],
    rest_lengths: Float[np.ndarray, " tendons"],
    stiffness: Float[np.ndarray, " tendons"],
    law: Law,
) -> TendonTerms:
    """Evaluate the tendon element for every tendon at once."""
    count = len(tendons)
    d = nodes[tendons[:, 1]] - nodes[tendons[:, 0]]
    if count == 0:
        zero = np.zeros(0)
        return TendonTerms(tendons, len(nodes), zero, zero, d, np.zeros((0, 3, 3)), d)
    V, T, g, K, G = (np.asarray(part) for part in _mapped(law, count)(d.T, rest_lengths[None], stiffness[None]))
    blocks = K.reshape(3, count, 3).transpose(1, 0, 2)
    return TendonTerms(tendons, len(nodes), V.ravel(), T.ravel(), g.T.copy(), blocks, G.T.copy())
