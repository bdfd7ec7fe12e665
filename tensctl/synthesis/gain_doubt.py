"""How far the data determine an optimal gain: what rounding of A, B and the weights does to it, estimated.

    L(dP) + E = 0,   L(Y) = (A - BK)'Y + Y(A - BK)   (sampled: (A - BK)'Y(A - BK) - Y),   W dK = B' dP + ...

E is what the equation leaves, and by itself each of a few random changes of the data by rounding; W is R, or R + B'PB
when sampled. The optimal K makes its own change vanish from E, so E = dA'P + PdA + dQ + ... at the K that there is.
A residual judges the solver; this judges the question too, which a mode that is hardly driven leaves open at any
residual. A few probes estimate the worst change within a small factor with high probability (Kenney and Laub, SIAM
J. Sci. Comput. 15, 1994); they are no bound.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

_PROBES = 4


@one_blas_thread()
def gain_doubt(
    A: np.ndarray, B: np.ndarray, cost: Cost, P: np.ndarray, K: np.ndarray, *, sampled: bool = False,
    rounding: float = float(np.finfo(float).eps),
) -> float:  # fmt: skip
    """Estimate of |W^1/2 dK| over |W^1/2 K| (Frobenius), to first order: of the residual, and of the data's rounding.

    Parameters
    ----------
    A, B, cost, P, K : the data and the optimum, u = -K x
    sampled : bool
    rounding : float
        Relative change of each entry of A, B and the weights.
    """
    loop, rng = A - B @ K, np.random.default_rng(0)
    after, before = (P @ loop, loop) if sampled else (P, np.eye(len(A)))
    W = cost.R + B.T @ P @ B if sampled else cost.R
    root = sla.cholesky(W, lower=True)

    def change(E: np.ndarray, straight: np.ndarray | float) -> float:
        moved = B.T @ _solution(loop, E, np.sqrt(np.diag(P)), sampled) @ before + straight
        return float(np.linalg.norm(sla.solve_triangular(root, moved, lower=True)))

    def noise(M: np.ndarray) -> np.ndarray:
        return rounding * M * rng.choice([-1.0, 1.0], M.shape)

    def probe() -> float:
        dA, dB, dN, dQ, dR = noise(A), noise(B), noise(cost.N), np.triu(noise(cost.Q)), np.triu(noise(cost.R))
        dQ, dR = dQ + np.triu(dQ, 1).T, dR + np.triu(dR, 1).T
        half = after.T @ (dA - dB @ K) - dN @ K
        straight = dB.T @ after + dN.T - dR @ K + (B.T @ P @ (dA - dB @ K) if sampled else 0.0)
        return change(half + half.T + dQ + K.T @ dR @ K, straight)

    weighed = cost.Q + K.T @ cost.R @ K - cost.N @ K - (cost.N @ K).T
    left = weighed + (loop.T @ after - P if sampled else loop.T @ P + P @ loop)
    size = float(np.linalg.norm(root.T @ K))
    return (change(left, 0.0) + max(probe() for _ in range(_PROBES))) / size if size > 0 else 0.0


def _solution(loop: np.ndarray, E: np.ndarray, scale: np.ndarray, sampled: bool) -> np.ndarray:
    """Y of L(Y) + E = 0, each state seen over its scale."""
    apart = np.outer(scale, scale)
    form, W = (loop * np.outer(scale, 1 / scale)).T, E / apart
    return apart * (sla.solve_discrete_lyapunov(form, W) if sampled else sla.solve_continuous_lyapunov(form, -W))
