"""q from an independent set of vectors and back: Q and its inverse ([S] (4.7)-(4.9), Appendix B), sparse.

    q = Q l,   l_11 = (rho, r1, r2, t5),   l_i1 = (t1_(i-1)1, r1, r2, t5),   l_ij = (r1, r2, t5, t1) for j > 1

Q is block lower triangular and full below its diagonal. Its inverse is not: (B.9) on, which the scan has lost, are
rebuilt from (B.6) as

    Lambda_11 = Q11^-1,   Lambda_jj = Q22^-1,   Lambda_21 = -Q22^-1 Q21 Q11^-1,   Lambda_j(j-1) = -Q22^-1 Q32 Q22^-1

and every Lambda further down vanishes, because Q32 Q22^-1 leaves the columns of Q21 and of Q32 as they are. Block by
block only the row of t1 reaches outside its element, t1_ij = P2_ij - P4_i(j-1) and t1_(i-1)1 = P2_(i-1)1 - P1_i1, so
Q^-1 has 30nm - 6 nonzero entries and none is found numerically.

The printed matrix G has the third row [2 2 0 2]; it is [-2 2 0 2].
"""

from __future__ import annotations

import numpy as np
from scipy import sparse

from tensctl.model.shell_equations.blocks import Block, band, kron, stack, times_identity, total
from tensctl.model.shell_equations.layout import check_size

TABLES = {
    "A": [[2, 1, 0, 0], [0, 1, 0, 0], [2, 2, -1, 2], [0, 0, 1, 0]],
    "B": [[-2, 1, 0, 0], [0, 1, 0, 0], [-2, 2, -1, 2], [0, 0, 1, 0]],
    "C": [[-1, 0, 0, 2], [1, 0, 0, 0], [0, -1, 2, 2], [0, 1, 0, 0]],
    "D": [[2, 2, 0, 0], [0, 0, 0, 0], [2, 2, 0, 0], [0, 0, 0, 0]],
    "E": [[-2, 2, 0, 0], [0, 0, 0, 0], [-2, 2, 0, 0], [0, 0, 0, 0]],
    "F": [[2, 2, 0, 2], [0, 0, 0, 0], [2, 2, 0, 2], [0, 0, 0, 0]],
    "G": [[-2, 2, 0, 2], [0, 0, 0, 0], [-2, 2, 0, 2], [0, 0, 0, 0]],
    "J": [[0, 0, 2, 2], [0, 0, 0, 0], [0, 0, 2, 2], [0, 0, 0, 0]],
}
"""The matrices A to J under (4.7), times I_3; G as corrected."""

# Twice the inverses of A, B, C, row by row what l says: 2 rho = q1 - q2, r1 = q2, r2 = q4, 2 t5 = q3 + q4 - q1 - q2.
_INVERSES = {
    "A": [[1, -1, 0, 0], [0, 2, 0, 0], [0, 0, 0, 2], [-1, -1, 1, 1]],
    "B": [[-1, 1, 0, 0], [0, 2, 0, 0], [0, 0, 0, 2], [-1, -1, 1, 1]],
    "C": [[0, 2, 0, 0], [0, 0, 0, 2], [-1, -1, 1, 1], [1, 1, 0, 0]],
}
# Twice -B^-1 D A^-1 = -B^-1 E B^-1: t1_(i-1)1 reaches to P2 of element i - 1.
_LEFT = [[1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
# Twice -C^-1 J C^-1: t1_ij reaches to P4 of element i(j-1).
_BELOW = [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, -1, -1]]


def Q_table(name: str) -> np.ndarray:
    """One of the 12 x 12 matrices A to J under (4.7)."""
    return times_identity(np.array(TABLES[name]))


def Q_11(n: int) -> sparse.csr_array:
    """(12n, 12n): the first ring from its own vectors (4.9)."""
    return _ring_from_base(n, "A", "B")


def Q_21(n: int) -> sparse.csr_array:
    """(12n, 12n): every higher ring from the first ring's vectors (4.9)."""
    return _ring_from_base(n, "F", "G")


def Q_22(n: int) -> sparse.csr_array:
    """(12n, 12n): a higher ring from its own vectors (4.9)."""
    return band(n, {0: Q_table("C")})


def Q_32(n: int) -> sparse.csr_array:
    """(12n, 12n): a ring from the vectors of a ring between it and the first (4.9)."""
    return band(n, {0: Q_table("J")})


def Q_matrix(n: int, m: int) -> sparse.csr_array:
    """Q of (4.8), (4.9), (12nm, 12nm)."""
    check_size(n, m)
    rows: list[list[Block | None]] = [[Q_21(n), *[Q_32(n)] * (j - 1), Q_22(n), *[None] * (m - 1 - j)] for j in range(m)]
    rows[0] = [Q_11(n), *[None] * (m - 1)]
    return stack(rows)


def Lambda(j: int, k: int, n: int) -> sparse.csr_array:
    """Block (j, k) of Q^-1, (12n, 12n), j and k from 1 ((B.7), (B.8); closed forms rebuilt)."""
    if j == k == 1:
        return _inverse_of_base(n)
    if j == k:
        return band(n, {0: _half(_INVERSES["C"])})
    return band(n, {0: _half(_BELOW)}) if j == k + 1 else sparse.csr_array((12 * n, 12 * n))


def Q_inverse(n: int, m: int) -> sparse.csr_array:
    """Q^-1 of Appendix B in closed form, (12nm, 12nm), 30nm - 6 nonzeros: l = Q^-1 q."""
    check_size(n, m)
    rows: list[list[Block | None]] = [[None] * m for _ in range(m)]
    for j in range(1, m + 1):
        for k in range(max(1, j - 1), j + 1):
            rows[j - 1][k - 1] = Lambda(j, k, n)
    return stack(rows)


def _half(table: list[list[int]]) -> np.ndarray:
    return times_identity(np.array(table) / 2)


def _ring_from_base(n: int, corner: str, own: str) -> sparse.csr_array:
    """First diagonal block `corner`, the others `own`, first column D, E between (4.9)."""
    at = np.zeros((4, n, n))
    at[0, 0, 0] = 1
    at[1, 1:, 1:] = np.eye(n - 1)
    at[2, 1:, 0] = 1
    at[3, 1:, 1:] = np.tril(np.ones((n - 1, n - 1)), -1)
    return total(kron(a, Q_table(name)) for a, name in zip(at, (corner, own, "D", "E"), strict=True))


def _inverse_of_base(n: int) -> sparse.csr_array:
    first, others = np.zeros((n, n)), np.eye(n)
    first[0, 0], others[0, 0] = 1, 0
    own = (("A", first), ("B", others))
    parts = (kron(at, _half(_INVERSES[name])) for name, at in own)
    return total([*parts, band(n, {-1: _half(_LEFT)})])
