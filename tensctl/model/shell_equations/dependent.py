"""The dependent tendon vectors from q: E_1 to E_7 and R ([S] (4.12)-(4.17), (C.6)), sparse, from the topology.

    t_ij^d = E_1 q_i(j-1) + E_2 q_(i-1)j + E_3 q_ij + E_4 q_(i+1)j + E_5 q_(i+1)(j+1)                          (4.16)
    l^d = R q = R Q l                                                                                   (4.17), (4.18)

E_4 is E4hat in the first stage (no E_1 there), E4bar in the last (no E_5), E4tilde when both are one. (4.16) prints
q_(n+1)j = q_ij for q_1j.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.model.shell_equations.blocks import Block, ring, stack, times_identity
from tensctl.model.shell_equations.coordinates import NODES_FROM_Q
from tensctl.model.shell_equations.independent import Q_inverse
from tensctl.model.shell_equations.layout import DEPENDENT, check_size, ends_at

_OFFSETS = {"E_1": (0, -1), "E_2": (-1, 0), "E_3": (0, 0), "E_4": (1, 0), "E_5": (1, 1)}
# (first stage, last stage) of each version of E_4.
_E4 = {"E_4": (False, False), "E_4_hat": (True, False), "E_4_bar": (False, True), "E_4_tilde": (True, True)}


def E_block(name: str) -> Float[np.ndarray, "rows 12"]:
    """E_1 to E_5, E_4_hat, E_4_bar, E_4_tilde (24, 12), E_6, E_7 (3, 12) of (4.14)-(4.17), (C.6)."""
    if name == "E_6":
        return times_identity(ends_at((1,), (1, 0), True, False) @ NODES_FROM_Q)
    if name == "E_7":
        return times_identity(ends_at((1,), (0, 0), True, False) @ NODES_FROM_Q)
    first, last = _E4.get(name, (False, False))
    return times_identity(ends_at(DEPENDENT, _OFFSETS[name[:3]], first, last) @ NODES_FROM_Q)


def R_11(n: int, first: bool, last: bool) -> sparse.csr_array:
    """(24n, 12n): a ring's dependent vectors from its own q; hat, bar, tilde by the kind of stage (4.17), (C.6)."""
    version = {kind: name for name, kind in _E4.items()}[(first, last)]
    return ring(n, {0: E_block("E_3"), 1: E_block(version), -1: E_block("E_2")})


def R_12(n: int) -> sparse.csr_array:
    """(24n, 12n): from the q of the ring above (4.17)."""
    return ring(n, {1: E_block("E_5")})


def R_21(n: int) -> sparse.csr_array:
    """(24n, 12n): from the q of the ring below (4.17)."""
    return ring(n, {0: E_block("E_1")})


def R_0(n: int) -> sparse.csr_array:
    """(3, 12n): t_1n1 = R_0 q_1 (4.15)."""
    return stack([[E_block("E_6"), *[np.zeros((3, 12))] * (n - 2), E_block("E_7")]])


def R_matrix(n: int, m: int) -> sparse.csr_array:
    """R of (4.17), (24nm + 3, 12nm), at m = 1 of (C.6)."""
    check_size(n, m)
    rows: list[list[Block | None]] = [[None] * m for _ in range(m + 1)]
    rows[0][0] = R_0(n)
    for j in range(m):
        rows[j + 1][j] = R_11(n, j == 0, j == m - 1)
        if j + 1 < m:
            rows[j + 1][j + 1] = R_12(n)
            rows[j + 2][j] = R_21(n)
    return stack(rows)


def independent_rows(n: int, m: int) -> sparse.csr_array:
    """(6nm, 12nm): t5 and t1 of each element from q, rows of Q^-1, and R_0 for t_1n1 (which is not in l).

    What (5.10) needs for f^0; the text that says so is on a lost page.
    """
    rows = sparse.csr_array(sparse.vstack([Q_inverse(n, m), stack([[R_0(n), *_zeros(n, m)]])], format="csr"))
    element = np.arange(n * m)
    base = element < n
    t5 = 4 * element + np.where(base, 3, 2)
    t1 = np.where(base, 4 * (element + 1), 4 * element + 3)
    t1[n - 1] = 4 * n * m
    blocks = np.stack([t5, t1], axis=1).ravel()
    return sparse.csr_array(rows[(3 * blocks[:, None] + np.arange(3)).ravel()])


def _zeros(n: int, m: int) -> list[Block]:
    return [] if m == 1 else [sparse.csr_array((3, 12 * n * (m - 1)))]
