"""Three dimensions as three times one: the Kronecker reduction ([W] Lemmas 1 and 2).

    (A x I_d) vec(X) = vec(A X)      with vec(X) = (x_1', x_2', ...)', row after row                      (5)-(10)

So a stacked vector of 3 n entries and an (n, 3) array are the same thing, and no product with I_3 is ever formed: all
functions of this sub-package take (n, d) arrays, d = 1, 2 or 3. Lemma 2 (iv) prints svd(A) on the left where
svd(A x I_p) is meant, and (iii), (v) count z with n - r entries where it has m - r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.errors import EquilibriumError
from tensctl.statics.algebra.rank_decision import RankDecision, decide_rank


def kron(A: np.ndarray | sparse.csr_array, d: int = 3) -> sparse.csr_array:
    """A x I_d, sparse (d n, d m); for readers of the paper and for tests, nothing here needs it."""
    return sparse.csr_array(sparse.kron(sparse.csr_array(A), sparse.eye_array(d, dtype=np.int64), format="csr"))


def stack(X: Float[np.ndarray, "n d"]) -> Float[np.ndarray, " nd"]:
    """The paper's vector of (5), (11) and (14) from an array with one row a node or member."""
    return np.ascontiguousarray(X).reshape(-1)


def unstack(x: Float[np.ndarray, " nd"], d: int = 3) -> Float[np.ndarray, "n d"]:
    """One row a node or member from the paper's vector."""
    return np.asarray(x).reshape(-1, d)


@dataclass(frozen=True, eq=False)
class SVD:
    """A = U1 diag(sigma) V1', with U2 and V2 completing U and V to orthonormal bases (1)-(4).

    Attributes
    ----------
    U1, sigma, V1 : (n, r), (r,), (m, r)
    U2, V2 : (n, n - r), (m, m - r)
        U2' A = 0 and A V2 = 0.
    rank : RankDecision
        How r was found.
    """

    U1: np.ndarray
    sigma: np.ndarray
    V1: np.ndarray
    U2: np.ndarray
    V2: np.ndarray
    rank: RankDecision


def svd(A: Float[np.ndarray, "n m"], *, rank_tol: float | None = None) -> SVD:
    """Singular value decomposition in the four parts of Lemma 2 (i), (ii); dense, n m min(n, m) operations."""
    U, sigma, Vt = np.linalg.svd(A)
    scale = float(sigma.max(initial=0.0))
    rounding = 4 * max(*A.shape, 1) * np.finfo(float).eps * scale
    decision = decide_rank(sigma, scale=scale, rounding=rounding, rank_tol=rank_tol)
    r = decision.rank
    return SVD(U[:, :r], sigma[:r], Vt[:r].T, U[:, r:], Vt[r:].T, decision)


@dataclass(frozen=True, eq=False)
class LinearSolutions:
    """All X with A X = Y: particular + null @ z for every z.

    Attributes
    ----------
    particular : (m, d)
        The solution of least norm, V1 diag(1/sigma) U1' Y.
    null : (m, m - r)
        V2, orthonormal.
    misfit : float
        Largest entry of U2' Y over the largest entry of Y: 0 when Y can be reached.
    rank : RankDecision
    """

    particular: np.ndarray
    null: np.ndarray
    misfit: float
    rank: RankDecision


def solve(A: Float[np.ndarray, "n m"], Y: Float[np.ndarray, "n d"], *, tol: float = 1e-10) -> LinearSolutions:
    """Solve (A x I_d) x = y by d one-dimensional systems (Lemma 2 (iii), (v)).

    Raises
    ------
    EquilibriumError
        When U2' Y is not zero to `tol` of the largest entry of Y: no solution exists.
    """
    parts = svd(A)
    size = np.abs(Y).max(initial=0.0)
    misfit = float(np.abs(parts.U2.T @ Y).max(initial=0.0) / size) if size > 0 else 0.0
    if misfit > tol:
        raise EquilibriumError(
            f"A X = Y has no solution: the part of Y outside the range of A is {misfit:.1e} of its size, at most "
            f"{tol:.0e} is expected ({parts.rank}); change the right-hand side."
        )
    particular = parts.V1 @ ((parts.U1.T @ Y) / parts.sigma[:, None])
    return LinearSolutions(particular, parts.V2, misfit, parts.rank)
