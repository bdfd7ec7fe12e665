"""Lyapunov equations of one matrix for many right-hand sides: one Schur form, then products of blocks.

    continuous  A X + X A* + W = 0:   A = U T U*,   T Y + Y T* + U* W U = 0,   X = U Y U*
    sampled     A X A* - X + W = 0    is   L X + X L* + 2 M W M* = 0,   M = (A + I)^-1,   L = (A - I) M

Bartels and Stewart's method. T is halved again and again (Jonsson and Kagstrom, ACM Trans. Math. Softw. 28(4), 2002),

    T = [a b; 0 c]:   c Y3 + Y3 c* + F3 = 0,   a Y2 + Y2 c* + F2 + b Y3 = 0,   a Y1 + Y1 a* + F1 + b Y2* + Y2 b* = 0

so nearly all work is matrix products: 888 states take 0.05 s, LAPACK's column by column 0.9 s. M is large, and digits
are lost, when a sampled loop has a pole near -1: at half the sampling rate and hardly damped.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from jaxtyping import Inexact

# Blocks that LAPACK solves by itself; 32 and 128 take a tenth longer.
_BLOCK = 64


@dataclass(frozen=True, eq=False)
class LyapunovSolver:
    """A matrix made ready.

    Attributes
    ----------
    T, U : (n, n)
        Schur form of A, or of L when sampled.
    M : (n, n) or None
        (A + I)^-1 when sampled.
    """

    T: Inexact[np.ndarray, "n n"]
    U: Inexact[np.ndarray, "n n"]
    M: Inexact[np.ndarray, "n n"] | None

    @classmethod
    def of(cls, A: Inexact[np.ndarray, "n n"], *, sampled: bool = False) -> LyapunovSolver:
        """Make a matrix ready.

        Raises
        ------
        numpy.linalg.LinAlgError
            When a sampled one has the eigenvalue -1.
        """
        M = np.linalg.inv(A + np.eye(len(A))) if sampled else None
        T, U = sla.schur(A if M is None else (A - np.eye(len(A))) @ M, "complex" if np.iscomplexobj(A) else "real")
        return cls(T, U, M)

    @property
    def stable(self) -> bool:
        """Whether every eigenvalue is; L maps the unit circle to the imaginary axis."""
        return bool((np.real(np.diag(self.T)) < 0).all())

    def solve(self, W: Inexact[np.ndarray, "n n"]) -> Inexact[np.ndarray, "n n"]:
        """X for a Hermitian W."""
        if self.M is not None:
            W = 2 * self.M @ W @ self.M.conj().T
        F = self.U.conj().T @ W @ self.U
        return self.U @ _lyapunov(self.T, 0.5 * (F + F.conj().T)) @ self.U.conj().T


def _lyapunov(T: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Y of T Y + Y T* + F = 0, T a Schur form, F Hermitian."""
    if len(T) <= _BLOCK:
        return _small(T, T, F)
    k = _halved(T)
    a, b, c = T[:k, :k], T[:k, k:], T[k:, k:]
    Y3 = _lyapunov(c, F[k:, k:])
    Y2 = _sylvester(a, c, F[:k, k:] + b @ Y3)
    crossed = b @ Y2.conj().T
    Y1 = _lyapunov(a, F[:k, :k] + crossed + crossed.conj().T)
    return np.block([[Y1, Y2], [Y2.conj().T, Y3]])


def _sylvester(S: np.ndarray, T: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Y of S Y + Y T* + F = 0 for two Schur forms."""
    if max(F.shape) <= _BLOCK:
        return _small(S, T, F)
    if len(S) >= len(T):
        k = _halved(S)
        lower = _sylvester(S[k:, k:], T, F[k:])
        return np.vstack([_sylvester(S[:k, :k], T, F[:k] + S[:k, k:] @ lower), lower])
    k = _halved(T)
    right = _sylvester(S, T[k:, k:], F[:, k:])
    return np.hstack([_sylvester(S, T[:k, :k], F[:, :k] + right @ T[:k, k:].conj().T), right])


def _halved(T: np.ndarray) -> int:
    """Where to halve a Schur form: not through one of its blocks of two."""
    k = len(T) // 2
    return k + 1 if T[k, k - 1] != 0 else k


def _small(S: np.ndarray, T: np.ndarray, F: np.ndarray) -> np.ndarray:
    solve: Any = sla.get_lapack_funcs("trsyl", (S, T, F))
    Y, scale, _ = solve(S, T, -F, tranb="C" if np.iscomplexobj(F) else "T")
    return Y / scale
