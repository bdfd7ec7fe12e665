"""Forces on all nodes from tendon and external forces: B^d, B^0 and W^0 ([S] (2.15), (E.21); (C.5) at m = 1).

f = B^d f^d + B^0 f^0 + W^0 w,   N, 12nm entries: (f1 + f2, f1 - f2, f3 + f4, f3 - f4) of each element
"""

from __future__ import annotations

from scipy import sparse

from tensctl.model.shell_equations.blocks import Block, band, stack
from tensctl.model.shell_equations.element_blocks import force_block
from tensctl.model.shell_equations.layout import check_size
from tensctl.model.shell_equations.ring_blocks import B_1, B_2, B_3, B_4, B_5, B_6, B_7, B_8, B_5bar


def B_d(n: int, m: int) -> sparse.csr_array:
    """(12nm, 24nm + 3), sparse."""
    check_size(n, m)
    rows: list[list[Block | None]] = [[None] * m for _ in range(m)]
    rows[0][0] = B_3(n, single=m == 1)
    for j in range(1, m):
        rows[j - 1][j] = B_4(n)
        rows[j][j - 1] = B_5(n) if j == 1 else B_5bar(n)
        rows[j][j] = B_8(n) if j == m - 1 else B_6(n)
    return stack(rows)


def B_0(n: int, m: int) -> sparse.csr_array:
    """(12nm, 6nm), sparse."""
    check_size(n, m)
    rows: list[list[Block | None]] = [[None] * m for _ in range(m)]
    rows[0][0] = B_1(n)
    for j in range(1, m):
        rows[j - 1][j], rows[j][j] = B_2(n), B_7(n)
    return stack(rows)


def W_0(n: int, m: int) -> sparse.csr_array:
    """(12nm, 12nm), sparse: w holds the forces ON nodes P1..P4 of each element."""
    check_size(n, m)
    return band(n * m, {0: force_block("W")})
