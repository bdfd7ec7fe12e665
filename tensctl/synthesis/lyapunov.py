"""Lyapunov equations with their residual, and the H2 norm.

    continuous  AX + XA' + W = 0        sampled  AXA' - X + W = 0
    |G|_2^2 = tr(C X C') with W = B B': the variance of the outputs under white noise at the inputs

Bartels and Stewart's method and one correction; a loop with slow poles has a large X, and the residual says how much of
it is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Inexact

from tensctl.errors import SynthesisError


@dataclass(frozen=True, eq=False)
class Lyapunov:
    """Solution of a Lyapunov equation, and what it leaves of it over the sum of the terms."""

    X: Inexact[np.ndarray, "n n"]
    residual: float


def lyapunov(A: Inexact[np.ndarray, "n n"], W: Inexact[np.ndarray, "n n"], *, sampled: bool = False) -> Lyapunov:
    """Covariance of a stable loop.

    Raises
    ------
    SynthesisError
        When A is not stable.
    """
    poles = np.linalg.eigvals(A)
    if not (np.abs(poles) < 1 if sampled else np.real(poles) < 0).all():
        raise SynthesisError("the loop is not stable, so noise has no steady covariance in it.")
    solve = sla.solve_discrete_lyapunov if sampled else _continuous
    X = solve(A, W)
    X = X + solve(A, np.sum(_terms(A, X, W, sampled), axis=0))
    X = 0.5 * (X + X.conj().T)
    terms = _terms(A, X, W, sampled)
    size = sum(np.linalg.norm(term) for term in terms)
    return Lyapunov(X, float(np.linalg.norm(np.sum(terms, axis=0)) / size) if size > 0 else 0.0)


def h2_norm(A: np.ndarray, B: np.ndarray, C: np.ndarray, *, sampled: bool = False) -> float:
    """H2 norm of C (sI - A)^-1 B, or of C (zI - A)^-1 B."""
    X = lyapunov(A, B @ B.T, sampled=sampled).X
    return float(np.sqrt(max(np.trace(C @ X @ C.T), 0.0)))


def _continuous(A: np.ndarray, W: np.ndarray) -> np.ndarray:
    return sla.solve_continuous_lyapunov(A, -W)


def _terms(A: np.ndarray, X: np.ndarray, W: np.ndarray, sampled: bool) -> tuple[np.ndarray, ...]:
    return (A @ X @ A.conj().T, -X, W) if sampled else (A @ X, X @ A.conj().T, W)
