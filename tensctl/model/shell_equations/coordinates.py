"""From nodes to coordinates and back, element by element ([S] (4.3)-(4.6), (4.13)), sparse.

q1 = p2 + p1,   q2 = p2 - p1 = r1,   q3 = p4 + p3,   q4 = p4 - p3 = r2;   p = P q
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.model.shell_equations.blocks import band, times_identity
from tensctl.model.shell_equations.layout import check_size

NODES_FROM_Q = np.array([[1, -1, 0, 0], [1, 1, 0, 0], [0, 0, 1, -1], [0, 0, 1, 1]]) / 2
"""P_1 of (4.6), times I_3: nodes of an element from its q."""

Q_FROM_NODES = np.array([[1, 1, 0, 0], [-1, 1, 0, 0], [0, 0, 1, 1], [0, 0, -1, 1]])
"""Its inverse, (4.5)."""

POINTS_FROM_Q = np.array([[1, -1, 0, 0], [0, 2, 0, 0], [0, 0, 1, -1], [0, 0, 0, 2]]) / 2
"""(4.13), times I_3: (rho, r1, rhohat, r2) of an element from its q."""


def P_1() -> Float[np.ndarray, "12 12"]:
    """P_1 of (4.6)."""
    return times_identity(NODES_FROM_Q)


def P_matrix(n: int, m: int) -> sparse.csr_array:
    """P of (4.6), (12nm, 12nm): p = P q, nodes in the project's order."""
    check_size(n, m)
    return band(n * m, {0: P_1()})


def q_of(nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, " q"]:
    """Coordinates q of nodes in the project's order (4.5), m; velocities of nodes give q'."""
    p = np.asarray(nodes, float).reshape(-1, 4, 3)
    return np.einsum("ab,ebx->eax", Q_FROM_NODES, p).ravel()
