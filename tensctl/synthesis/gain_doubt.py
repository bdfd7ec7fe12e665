"""How far the data determine an optimal gain: what rounding of A, B and the weights does to it, estimated.

    L(dP) + E = 0,   L(Y) = (A - BK)'Y + Y(A - BK)   (sampled: (A - BK)'Y(A - BK) - Y),   W dK = B' dP + ...

E is what the equation leaves, and by itself each of a few random changes of the data by rounding; W is R, or R + B'PB
when sampled. The optimal K makes its own change vanish from E, so E = dA'P + PdA + dQ + ... at the K that there is.
A residual judges the solver; this judges the question too, which a mode that is hardly driven leaves open at any
residual. A few probes estimate the worst change within a small factor with high probability (Kenney and Laub, SIAM
J. Sci. Comput. 15, 1994); they are no bound.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Int

from tensctl.synthesis.schur_lyapunov import LyapunovSolver
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

_PROBES = 4


@dataclass(frozen=True)
class Doubt:
    """What is known of one gain, or of one harmonic of it, in |W^1/2 .| (Frobenius).

    Attributes
    ----------
    residual : float
        Change of the gain by what the equation leaves.
    rounding : (probes,)
        Changes by a few random changes of the data.
    size : float
        The gain itself.
    """

    residual: float
    rounding: Float[np.ndarray, " probes"]
    size: float

    @property
    def relative(self) -> float:
        """The change over the gain."""
        return (self.residual + self.rounding.max()) / self.size if self.size > 0 else 0.0


def doubt_of_all(doubts: Sequence[Doubt], copies: Int[np.ndarray, " harmonics"]) -> Doubt:
    """Of a gain in harmonics, each there so many times: squares add up, since the transform is unitary."""

    def together(values: Iterable) -> np.ndarray:
        return np.sqrt(copies @ np.square(list(values)))

    residual, size = together(one.residual for one in doubts), together(one.size for one in doubts)
    return Doubt(float(residual), together(one.rounding for one in doubts), float(size))


@one_blas_thread()
def gain_doubt(
    A: np.ndarray, B: np.ndarray, cost: Cost, P: np.ndarray, K: np.ndarray, *, sampled: bool = False,
    current: bool = False, rounding: float = float(np.finfo(float).eps),
) -> Doubt:  # fmt: skip
    """Estimate of |W^1/2 dK| beside |W^1/2 K|, to first order: of the residual, and of the data's rounding.

    Parameters
    ----------
    A, B, cost, P, K : the data and the optimum, u = -K x; real, or complex with Hermitian weights
    sampled : bool
    current : bool
        Judge M = W^-1 B'P, by which a sampled filter (the dual) corrects its estimate at once, in place of K = M A.
    rounding : float
        Relative change of each entry of A, B and the weights.
    """
    loop, rng, back = A - B @ K, np.random.default_rng(0), B.conj().T
    after, before = (P @ loop, loop) if sampled else (P, np.eye(len(A)))
    W = cost.R + back @ P @ B if sampled else cost.R
    root = sla.cholesky(W, lower=True)
    sizes = np.real(np.diag(P))
    scale = np.sqrt(np.maximum(sizes, np.finfo(float).eps * sizes.max(initial=0.0)) + np.finfo(float).tiny)
    # Each state over its size: Y of loop* Y + Y loop + E = 0, or of loop* Y loop - Y + E = 0.
    apart = np.outer(scale, scale)
    solver = LyapunovSolver.of((loop * np.outer(scale, 1 / scale)).conj().T, sampled=sampled)
    gain = K
    if current:
        gain = sla.cho_solve((root, True), back @ P)
        before = np.eye(len(A)) - B @ gain

    def change(E: np.ndarray, straight: np.ndarray | float) -> float:
        moved = back @ (apart * solver.solve(E / apart)) @ before + straight
        return float(np.linalg.norm(sla.solve_triangular(root, moved, lower=True)))

    def noise(M: np.ndarray) -> np.ndarray:
        return rounding * M * rng.choice([-1.0, 1.0], M.shape)

    def probe() -> float:
        dA, dB, dN, dQ, dR = noise(A), noise(B), noise(cost.N), _mirrored(noise(cost.Q)), _mirrored(noise(cost.R))
        half = after.conj().T @ (dA - dB @ K) - dN @ K
        straight = dB.conj().T @ P @ before - dR @ gain
        if sampled:
            straight -= back @ P @ dB @ gain
        if not current:
            straight += dN.conj().T + (back @ P @ dA if sampled else 0.0)
        return change(half + half.conj().T + dQ + K.conj().T @ dR @ K, straight)

    crossed = cost.N @ K
    weighed = cost.Q + K.conj().T @ cost.R @ K - crossed - crossed.conj().T
    left = weighed + (loop.conj().T @ after - P if sampled else loop.conj().T @ P + P @ loop)
    size = float(np.linalg.norm(root.conj().T @ gain))
    return Doubt(change(left, 0.0), np.array([probe() for _ in range(_PROBES)]), size)


def _mirrored(M: np.ndarray) -> np.ndarray:
    """The Hermitian matrix of an upper triangle."""
    return np.triu(M) + np.triu(M, 1).conj().T
