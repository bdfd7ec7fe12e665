"""Algebraic Riccati equations by structure-preserving doubling, finished by one Newton step.

    continuous  A*X + XA - XGX + Q = 0,   G = B R^-1 B*
    discrete    A*X (I + GX)^-1 A - X + Q = 0

Real, or complex with Hermitian Q and R, as the harmonics of a cyclically symmetric structure have it. The residual is
computed from A, B, Q, R and is the answer's own judge. Accuracy is lost when a mode is driven more weakly than
rounding: the residual then stays large.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from jaxtyping import Inexact

from tensctl.errors import SynthesisError
from tensctl.synthesis.doubling import Square, cayley, cayley_shift, doubling, hermitian, lyapunov, no_solution
from tensctl.threads import one_blas_thread

# A solution that leaves more than this of its own terms is no solution.
_REFUSED = 1e-6
# What the doubling may leave out: Newton's step squares it.
_HALF = 1e-7
# Part of a pole's decay, or of the discrete loop, that rounding may make up: above it rounding alone could have
# stabilised a mode that nothing drives.
_NOTICED = 1e-3


@dataclass(frozen=True, eq=False)
class Riccati:
    """A stabilising solution and how well it solves the equation.

    Attributes
    ----------
    X : (n, n), Hermitian
    K : (m, n), u = -K x
    left : float
        Frobenius norm of the equation's left side.
    terms : tuple of float
        Those of its terms.
    """

    X: Square
    K: Inexact[np.ndarray, "m n"]
    left: float
    terms: tuple[float, ...]

    @property
    def residual(self) -> float:
        """What is left of the equation over the sum of its terms."""
        return self.left / sum(self.terms)


@one_blas_thread()
def care(A: Square, B: np.ndarray, Q: Square, R: np.ndarray) -> Riccati:
    """Solve the continuous-time equation.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found: some mode is neither damped nor driven.
    """
    weighted = np.linalg.solve(R, B.conj().T)
    G = hermitian(B @ weighted)
    gamma = cayley_shift(A, G, Q)
    forward, spread, weight = cayley(A, G, Q, gamma)
    X = doubling(forward, spread, weight, enough=_HALF)
    certain = _beyond_rounding(spread, X)
    X, left, terms = _newton(A, G, Q, X, gamma)
    K = weighted @ X
    if not certain and not _stable_for_every_rounding(A, B, K, sampled=False):
        raise no_solution()
    return _checked(X, K, left, terms)


@one_blas_thread()
def dare(A: Square, B: np.ndarray, Q: Square, R: np.ndarray) -> Riccati:
    """Solve the discrete-time equation.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found: some mode is neither damped nor driven.
    """
    G = B @ np.linalg.solve(R, B.conj().T)
    X = doubling(A, G, Q)
    K = np.linalg.solve(R + B.conj().T @ X @ B, B.conj().T @ X @ A)
    if not _beyond_rounding(G, X) and not _stable_for_every_rounding(A, B, K, sampled=True):
        raise no_solution()
    carried = A.conj().T @ X
    terms = (carried @ A, -(carried @ B) @ K, -X, Q)
    return _checked(X, K, _norm(np.sum(terms, axis=0)), tuple(map(_norm, terms)))


def continuous_left(A: Square, G: Square, Q: Square, X: Square) -> tuple[Square, tuple[float, ...]]:
    """Left side of the continuous equation at a Hermitian X, and the norms of its four terms."""
    linear, quadratic = X @ A, X @ G @ X
    return linear + linear.conj().T - quadratic + Q, (_norm(linear), _norm(linear), _norm(quadratic), _norm(Q))


def _newton(A: Square, G: Square, Q: Square, X: Square, gamma: float) -> tuple[Square, float, tuple[float, ...]]:
    """One Newton-Kleinman correction, kept only when it lowers the residual; with the residual and its terms."""
    left, terms = continuous_left(A, G, Q, X)
    change = lyapunov(A - G @ X, left, gamma)
    if change is not None:
        after, terms_after = continuous_left(A, G, Q, X + change)
        if _norm(after) < _norm(left):
            return X + change, _norm(after), terms_after
    return X, _norm(left), terms


def _beyond_rounding(G: Square, X: Square) -> bool:
    """Whether rounding of the doubling's first G is too small, beside its solution, to have stabilised anything."""
    return bool(np.finfo(float).eps * np.linalg.norm(G) * np.linalg.norm(X) <= _NOTICED)


def _stable_for_every_rounding(A: Square, B: np.ndarray, K: np.ndarray, *, sampled: bool) -> bool:
    """Whether every pole of A - BK stays stable, to first order, when columns of B change by rounding of their length.

    Stable is left of the axis, or in the unit circle when sampled. A pole with left and right eigenvectors w, v moves
    by w* dB K v / w*v, and by the rounding of the eigenvalue solver, which balances the loop. Asked where
    `_beyond_rounding` says no, since a stiff mode has a large G and a soft one a large X; at 628 states all
    eigenvectors take a tenth to a quarter of the solve's time.
    """
    balanced: Any = sla.matrix_balance(A - B @ K, permute=False, separate=True)
    loop, (scales, _) = balanced
    poles, left, right = sla.eig(loop, left=True)
    moved = np.linalg.norm(B, axis=0) @ np.abs(K @ (scales[:, None] * right))
    moved = moved * np.linalg.norm(left / scales[:, None], axis=0) + np.linalg.norm(loop)
    moved = moved / np.abs(np.sum(left.conj() * right, axis=0))
    decay = 1 - np.abs(poles) if sampled else -poles.real
    return bool((np.finfo(float).eps * moved <= _NOTICED * decay).all())


def _norm(M: np.ndarray) -> float:
    return float(np.linalg.norm(M))


def _checked(X: np.ndarray, K: np.ndarray, left: float, terms: tuple[float, ...]) -> Riccati:
    if not left <= _REFUSED * sum(terms):
        raise SynthesisError(
            f"the Riccati equation was solved only to {left / sum(terms):.1e} of its terms; "
            "scale the weights, or leave out modes that the inputs hardly drive."
        )
    return Riccati(X, K, left, terms)
