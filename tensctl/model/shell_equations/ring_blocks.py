"""Nodal forces of one ring of elements: B_1 to B_8 and B_5bar ([S] (C.5), (E.17)-(E.20)), sparse.

f_1 = B_3 fbar_1^d + B_4 f_2^d + B_1 f_1^0 + B_2 f_2^0 + W_1 w_1                                          (E.17)
f_2 = B_5 fbar_1^d + B_6 f_2^d + B_4 f_3^d + B_7 f_2^0 + B_2 f_3^0 + W_1 w_2                              (E.18)
f_j = B_5bar f_(j-1)^d + B_6 f_j^d + B_4 f_(j+1)^d + B_7 f_j^0 + B_2 f_(j+1)^0 + W_1 w_j                  (E.19)
f_m = B_5bar f_(m-1)^d + B_8 f_m^d + B_7 f_m^0 + W_1 w_m                                                  (E.20)
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tensctl.model.shell_equations.blocks import band, ring, stack
from tensctl.model.shell_equations.element_blocks import force_block


def B_1(n: int) -> sparse.csr_array:
    """(12n, 6n): f_1^0 on the first ring; f1 of element n is left to B_3."""
    around = sparse.lil_array(band(n, {0: force_block("B0_11"), -1: force_block("B0_01")}))
    around[-12:, -6:] = force_block("B0_n1")
    return _without_zeros(around)


def B_2(n: int) -> sparse.csr_array:
    """(12n, 6n): f_(j+1)^0 on ring j."""
    return band(n, {0: force_block("B0_12")})


def B_3(n: int, *, single: bool = False) -> sparse.csr_array:
    """(12n, 24n + 3): fbar_1^d = (f_1n1, f_1^d) on the first ring.

    Parameters
    ----------
    single : the shell has one stage, whose top is closed too (C.5).
    """
    hat = "_hat" if single else ""
    own, left = force_block(f"Bd_11{hat}"), force_block(f"Bd_01{hat}")
    around = ring(n, {0: own, 1: force_block("Bd_21"), -1: left})
    first = np.zeros((12 * n, 3))
    first[:12], first[-12:] = force_block("B_1n1"), force_block("B_1n1_bar")
    return stack([[sparse.csr_array(first), around]])


def B_4(n: int) -> sparse.csr_array:
    """(12n, 24n): f_(j+1)^d on ring j."""
    return band(n, {0: force_block("Bd_12")})


def B_5(n: int) -> sparse.csr_array:
    """(12n, 24n + 3): fbar_1^d on the second ring, [0, B_5bar]."""
    return stack([[sparse.csr_array((12 * n, 3)), B_5bar(n)]])


def B_5bar(n: int) -> sparse.csr_array:
    """(12n, 24n): f_(j-1)^d on ring j."""
    return ring(n, {-1: force_block("Bd_n1_bar")})


def B_6(n: int) -> sparse.csr_array:
    """(12n, 24n): f_j^d on its own ring, between first and last."""
    return ring(n, {0: force_block("Bd_12_bar"), 1: force_block("Bd_21"), -1: force_block("Bd_n2")})


def B_7(n: int) -> sparse.csr_array:
    """(12n, 6n): f_j^0 on its own ring, j > 1."""
    return band(n, {0: force_block("B0_11")})


def B_8(n: int) -> sparse.csr_array:
    """(12n, 24n): f_m^d on the last ring."""
    return ring(n, {0: force_block("Bd_1m"), 1: force_block("Bd_21"), -1: force_block("Bd_nm")})


def W_1(n: int) -> sparse.csr_array:
    """(12n, 12n): external forces on a ring."""
    return band(n, {0: force_block("W")})


def _without_zeros(matrix: sparse.lil_array) -> sparse.csr_array:
    result = sparse.csr_array(matrix)
    result.eliminate_zeros()
    return result
