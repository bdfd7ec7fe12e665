"""Lyapunov equations with their residual, and the H2 norm.

    continuous  AX + XA' + W = 0        sampled  AXA' - X + W = 0
    |G|_2^2 = tr(C X C') with W = B B': the variance of the outputs under white noise at the inputs

One solution by `schur_lyapunov` and one correction; a loop with slow poles has a large X, and the residual says how
much of it is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Inexact

from tensctl.errors import SynthesisError
from tensctl.synthesis.schur_lyapunov import LyapunovSolver


@dataclass(frozen=True, eq=False)
class Lyapunov:
    """Solution of a Lyapunov equation.

    Attributes
    ----------
    X : (n, n)
    left : float
        Norm (Frobenius) of what it leaves of the equation.
    terms : tuple of float
        Norms of the equation's terms.
    """

    X: Inexact[np.ndarray, "n n"]
    left: float
    terms: tuple[float, ...]

    @property
    def residual(self) -> float:
        """What is left of the equation over the sum of its terms."""
        return self.left / sum(self.terms) if sum(self.terms) > 0 else 0.0


def lyapunov(
    A: Inexact[np.ndarray, "n n"], W: Inexact[np.ndarray, "n n"], *, sampled: bool = False,
    solver: LyapunovSolver | None = None,
) -> Lyapunov:  # fmt: skip
    """Covariance of a stable loop; `solver` is A made ready, where several are asked for.

    Raises
    ------
    SynthesisError
        When A is not stable.
    """
    solver = ready(A, sampled=sampled) if solver is None else solver
    X = solver.solve(W)
    X = X + solver.solve(np.sum(_terms(A, X, W, sampled), axis=0))
    X = 0.5 * (X + X.conj().T)
    terms = _terms(A, X, W, sampled)
    return Lyapunov(X, float(np.linalg.norm(np.sum(terms, axis=0))), tuple(float(np.linalg.norm(M)) for M in terms))


def ready(A: Inexact[np.ndarray, "n n"], *, sampled: bool = False) -> LyapunovSolver:
    """A stable loop made ready for `lyapunov`.

    Raises
    ------
    SynthesisError
        When A is not stable.
    """
    try:
        solver = LyapunovSolver.of(A, sampled=sampled)
    except np.linalg.LinAlgError:
        solver = None
    if solver is None or not solver.stable:
        raise SynthesisError("the loop is not stable, so noise has no steady covariance in it.")
    return solver


def h2_norm(A: np.ndarray, B: np.ndarray, C: np.ndarray, *, sampled: bool = False) -> float:
    """H2 norm of C (sI - A)^-1 B, or of C (zI - A)^-1 B."""
    X = lyapunov(A, B @ B.T, sampled=sampled).X
    return float(np.sqrt(max(np.trace(C @ X @ C.T), 0.0)))


def _terms(A: np.ndarray, X: np.ndarray, W: np.ndarray, sampled: bool) -> tuple[np.ndarray, ...]:
    return (A @ X @ A.conj().T, -X, W) if sampled else (A @ X, X @ A.conj().T, W)
