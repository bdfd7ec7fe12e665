"""Algebraic Riccati equations by structure-preserving doubling, finished by one Newton step.

    continuous  A'X + XA - XGX + Q = 0,   G = B R^-1 B'
    discrete    A'X (I + GX)^-1 A - X + Q = 0

Each doubling step squares the closed loop (Chu, Fan and Lin, Linear Algebra Appl. 396, 2005), so convergence is
quadratic and costs products and solves of size n only; the continuous equation enters through a Cayley transform. The
residual is computed from A, B, Q, R and is the answer's own judge. Accuracy is lost when a mode is driven more weakly
than rounding: the residual then stays large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.threads import one_blas_thread

_STEPS = 60
_DONE = 1e-15
# The closed loop, squared at every step, has decayed to this when the doubling is done. An undamped mode that nothing
# drives stays at size one, however little the solution still grows.
_DECAYED = 1e-4
# Rounding of G times the solution; above this, rounding alone would stabilise a mode that nothing drives.
_NOTICED = 1e-3
# Part of the closed loop's speed, about |G|^1/2 |Q|^1/2, below which the Cayley shift is not taken: A may be zero.
_SLOW = 1e-2
# A solution that leaves more than this of its own terms is no solution.
_REFUSED = 1e-6

Matrix = Float[np.ndarray, "n n"]


@dataclass(frozen=True, eq=False)
class Riccati:
    """A stabilising solution and how well it solves the equation.

    Attributes
    ----------
    X : (n, n), symmetric
    K : (m, n), u = -K x
    residual : float
        Frobenius norm of the equation's left side over the sum of its terms' norms.
    """

    X: Matrix
    K: Float[np.ndarray, "m n"]
    residual: float


@one_blas_thread()
def care(A: Matrix, B: np.ndarray, Q: Matrix, R: np.ndarray) -> Riccati:
    """Solve the continuous-time equation.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found: some mode is neither damped nor driven.
    """
    weighted = np.linalg.solve(R, B.T)
    G = B @ weighted
    X = _doubling(*_cayley(A, G, Q))
    X = _newton(A, G, Q, X)
    terms = (A.T @ X, X @ A, -X @ G @ X, Q)
    return Riccati(X, weighted @ X, _checked(terms))


@one_blas_thread()
def dare(A: Matrix, B: np.ndarray, Q: Matrix, R: np.ndarray) -> Riccati:
    """Solve the discrete-time equation.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found.
    """
    X = _doubling(A, B @ np.linalg.solve(R, B.T), Q)
    inner = R + B.T @ X @ B
    K = np.linalg.solve(inner, B.T @ X @ A)
    terms = (A.T @ X @ A, -(A.T @ X @ B) @ K, -X, Q)
    return Riccati(X, K, _checked(terms))


def _cayley(A: Matrix, G: Matrix, Q: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Discrete triple with the same stabilising solution; gamma beyond the spectrum keeps A - gamma I well posed."""
    eye = np.eye(len(A))
    open_loop = np.sqrt(np.linalg.norm(A, 1) * np.linalg.norm(A, np.inf))
    closed_loop = np.sqrt(np.linalg.norm(G) * np.linalg.norm(Q))
    gamma = 1.1 * float(max(open_loop, _SLOW * closed_loop, np.finfo(float).tiny))
    shifted = np.linalg.inv(A - gamma * eye)
    W = np.linalg.inv(A.T - gamma * eye + Q @ shifted @ G)
    return eye + 2 * gamma * W.T, 2 * gamma * shifted @ G @ W, 2 * gamma * W @ Q @ shifted


def _doubling(A: Matrix, G: Matrix, H: Matrix) -> Matrix:
    eye, drive = np.eye(len(A)), np.linalg.norm(G)
    for _ in range(_STEPS):
        factor = sla.lu_factor(eye + G @ H, check_finite=False)
        forward = sla.lu_solve(factor, A, check_finite=False)
        growth = A.T @ H @ forward
        G = _symmetric(G + A @ sla.lu_solve(factor, G @ A.T, check_finite=False))
        A, H = A @ forward, _symmetric(H + growth)
        with np.errstate(over="ignore"):
            size = np.linalg.norm(H)
        if not np.isfinite(size):
            break
        if np.linalg.norm(growth) <= _DONE * size and np.linalg.norm(A) <= _DECAYED:
            if np.finfo(float).eps * drive * size <= _NOTICED:
                return H
            break
    raise SynthesisError(
        "the Riccati equation has no stabilising solution: some mode is neither damped nor driven by an input; "
        "see the controllability report, or give the mode a tendon that reaches it."
    )


def _newton(A: Matrix, G: Matrix, Q: Matrix, X: Matrix) -> Matrix:
    """One Newton-Kleinman correction, kept only when it lowers the residual."""
    residual = A.T @ X + X @ A - X @ G @ X + Q
    closed = A - G @ X
    try:
        better = _symmetric(X + sla.solve_continuous_lyapunov(closed.T, -residual))
    except (np.linalg.LinAlgError, ValueError):
        return X
    left = A.T @ better + better @ A - better @ G @ better + Q
    return better if np.linalg.norm(left) < np.linalg.norm(residual) else X


def _checked(terms: tuple[np.ndarray, ...]) -> float:
    total = np.sum(terms, axis=0)
    residual = float(np.linalg.norm(total) / sum(np.linalg.norm(term) for term in terms))
    if not residual <= _REFUSED:
        raise SynthesisError(
            f"the Riccati equation was solved only to {residual:.1e} of its terms; "
            "scale the weights, or leave out modes that the inputs hardly drive."
        )
    return residual


def _symmetric(M: Matrix) -> Matrix:
    return 0.5 * (M + M.T)
