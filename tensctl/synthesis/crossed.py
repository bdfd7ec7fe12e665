"""Riccati equations with a cross term, brought to the form without one and judged in their own.

    continuous  A'P + PA - (PB + N) R^-1 (B'P + N') + Q = 0
    discrete    A'PA - P - (A'PB + N)(R + B'PB)^-1 (B'PA + N') + Q = 0

Real, or complex with Hermitian weights; ' is the conjugate transpose. u = v - R^-1 N'x removes the cross term:
A - B R^-1 N' and Q - N R^-1 N' take the places of A and Q. Accuracy ends where that difference loses its digits; the
residual, of the equation as it stands above, shows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Inexact

from tensctl.errors import SynthesisError
from tensctl.synthesis.riccati import care, dare
from tensctl.synthesis.weights import Cost

# What a certificate allows to be left of the equation, as part of its terms.
TOLERATED = 1e-9


@dataclass(frozen=True, eq=False)
class Optimum:
    """Stabilising solution P, its gain u = -K x, and what it leaves of its equation, over the sum of the terms."""

    P: Inexact[np.ndarray, "n n"]
    K: Inexact[np.ndarray, "m n"]
    residual: float


def undecided(advice: str) -> SynthesisError:
    """What is said where inputs reach every mode, and double precision finds no solution; `advice` ends it."""
    return SynthesisError(
        "double precision finds no solution of the Riccati equation, though no mode is out of reach: some mode is "
        f"driven or weighed too weakly, or the weights of states and inputs are too far apart ({advice})."
    )


def optimal(
    A: np.ndarray, B: np.ndarray, cost: Cost, *, sampled: bool = False, advice: str = "raise R"
) -> Optimum:  # fmt: skip
    """Least cost of dx/dt = A x + B u, or of x_(k+1) = A x_k + B u_k when sampled; `advice` ends a refusal.

    Raises
    ------
    SynthesisError
        When no stabilising solution is found, or none that keeps its residual.
    """
    from_state = np.linalg.solve(cost.R, cost.N.conj().T)
    rest = cost.Q - cost.N @ from_state
    solve = dare if sampled else care
    try:
        P = solve(A - B @ from_state, B, 0.5 * (rest + rest.conj().T), cost.R).X
    except SynthesisError:
        raise undecided(advice) from None
    if sampled:
        K = np.linalg.solve(cost.R + B.conj().T @ P @ B, B.conj().T @ P @ A + cost.N.conj().T)
    else:
        K = np.linalg.solve(cost.R, B.conj().T @ P + cost.N.conj().T)
    left = residual(A, B, cost, P, sampled=sampled)
    if not left <= TOLERATED:
        raise SynthesisError(
            f"the Riccati equation was solved only to {left:.1e} of its terms; bring the weights of states and inputs "
            f"nearer to each other ({advice})."
        )
    return Optimum(P, K, left)


def residual(A: np.ndarray, B: np.ndarray, cost: Cost, P: np.ndarray, *, sampled: bool) -> float:
    """Norm of the equation's left side over the sum of its terms' norms."""
    left, terms = left_over(A, B, cost, P, sampled=sampled)
    return left / sum(terms) if sum(terms) > 0 else 0.0


def left_over(
    A: np.ndarray, B: np.ndarray, cost: Cost, P: np.ndarray, *, sampled: bool
) -> tuple[float, tuple[float, ...]]:  # fmt: skip
    """Norm of the equation's left side, and those of its terms."""
    if sampled:
        coupling = A.conj().T @ P @ B + cost.N
        weight = cost.R + B.conj().T @ P @ B
        terms = (A.conj().T @ P @ A, -P, -coupling @ np.linalg.solve(weight, coupling.conj().T), cost.Q)
    else:
        coupling = P @ B + cost.N
        terms = (A.conj().T @ P, P @ A, -coupling @ np.linalg.solve(cost.R, coupling.conj().T), cost.Q)
    return float(np.linalg.norm(np.sum(terms, axis=0))), tuple(float(np.linalg.norm(term)) for term in terms)
