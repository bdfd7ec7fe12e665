"""Incidence matrices: who ends where, as sparse integers ([W] (18)-(21), S, B and D there, C_s, C_b and C_w here).

    C[i, k] = +1 if member k enters node i (its head), -1 if it leaves node i (its tail), so that C' p = p_head - p_tail
    C_w[i, j] = +1 if load j acts on node i

Example 8 of [W] prints -1 in the columns of its loads against (21), and (27) counts w as leaving the node. Here w
is the force applied TO the node, which is (21) and (23) as printed: C_s t = C_b f + C_w w.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Int
from scipy import sparse

from tensctl.errors import StructureError


def incidence(n_p: int, members: Int[np.ndarray, "members 2"]) -> sparse.csr_array:
    """Incidence matrix (n_p, members) of int64 for members given as (tail, head) pairs of indices from 0."""
    k = np.arange(len(members))
    rows = np.concatenate([members[:, 0], members[:, 1]])
    signs = np.repeat(np.array([-1, 1], np.int64), len(members))
    return sparse.csr_array((signs, (rows, np.concatenate([k, k]))), shape=(n_p, len(members)))


def load_incidence(n_p: int, load_nodes: Int[np.ndarray, " loads"]) -> sparse.csr_array:
    """C_w (n_p, loads) of int64: one column a load, one +1 in it (21).

    Raises
    ------
    StructureError
        A load on a node that the network does not have.
    """
    load_nodes = np.asarray(load_nodes, int)
    outside = (load_nodes < 0) | (load_nodes >= n_p)
    if outside.any():
        j = int(outside.argmax())
        raise StructureError(
            f"load {j} acts on node {load_nodes[j]}; the network has {n_p} nodes, counted from 0, "
            "so give an index below that."
        )
    ones = np.ones(len(load_nodes), np.int64)
    return sparse.csr_array((ones, (load_nodes, np.arange(len(load_nodes)))), shape=(n_p, len(load_nodes)))
