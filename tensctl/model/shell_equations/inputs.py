"""Each tendon's input once: the matrix T ([S] (5.16)-(5.20), Appendix C at m = 1).

    u~ = T u,   u~ in R^(10nm + 1) with its copies, u in R^(n(10m - 2)), 8nm for a primal shell

[S] prints u10 = -u7 and u9 = -u1, from t10 = -t7 and t9 = -t1; but u is a change of length, which has no direction, so
the copies are equal. (The nodal forces read neither copy, so the printed signs do no harm there.) (5.17) also prints
T as (10m + 1) rows for 10nm + 1. In a primal shell t9 and t10 are absent: their columns go, and their rows are zero
except for the copies.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tensctl.model.shell_equations.layout import absent_numbers, all_members, check_size, input_members, original

_T_1_KEPT = (0, 1, 2, 3, 4, 5, 7)


def T_1() -> np.ndarray:
    """(8, 7) of (5.18): (u2 u3 u4 u6 u7 u8 u9 u10) of a first-stage element from the same without u9."""
    return np.eye(8)[:, _T_1_KEPT]


def T_1_prime() -> np.ndarray:
    """(8, 6) of Appendix C: without u9 and u10, u10 = u7 (corrected sign)."""
    return np.vstack([np.eye(6), np.zeros((1, 6)), np.eye(6)[4:5]])


def T_2() -> np.ndarray:
    """(8, 7) of (5.18): of a last-stage element from the same without u10, u10 = u7 (corrected sign)."""
    return np.vstack([np.eye(7), np.eye(7)[4:5]])


def S_block() -> np.ndarray:
    """(8, 2) of (5.18): u9 of a first-stage element is u1 (corrected sign), from (u5, u1)."""
    return np.vstack([np.zeros((6, 2)), [[0, 1]], np.zeros((1, 2))])


def T_matrix(n: int, m: int, *, primal: bool = False) -> sparse.csr_array:
    """T of (5.17), (10nm + 1, n(10m - 2)), or (10nm + 1, 8nm) for a primal shell."""
    check_size(n, m)
    column = {member: c for c, member in enumerate(input_members(n, m, primal=primal))}
    sources = [column.get(original(member, m)) for member in all_members(n, m)]
    pairs = [(row, c) for row, c in enumerate(sources) if c is not None]
    rows, columns = np.array(pairs).T
    return sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(sources), len(column)))


def absent(n: int, m: int) -> np.ndarray:
    """Mask over u~ of the members that a primal shell has not, copies excepted (Definition 2.6)."""
    gone = absent_numbers(False, False, primal=True)
    return np.array([original(member, m).alpha in gone for member in all_members(n, m)])
