"""Tendon forces as functions of q, linear in u: K, b, K^d, K^0, P^d, P^0 ([S] (5.1)-(5.12)).

    f = F t/|t|                                                                                               (5.1)
    F = k (|t| - Lbar) when Lbar <= |t|, else 0,   Lbar = L0 - u >= 0                                   (5.2), (5.3)
    u <= L0                                                                                                   (5.4)
    t = R_alpha q,   f = -K_alpha q + b_alpha u                                                        (5.5), (5.6)
    K_alpha = k (L0/|t| - 1) R_alpha,   b_alpha = k R_alpha q/|R_alpha q|                              (5.7), (5.8)
    f_ij^d = -K_ij^d q + P_ij^d u_ij^d,   f_ij^0 = -K_ij^0 q + P_ij^0 u_ij^0                          (5.9), (5.10)

The scan has lost the page of (5.4)-(5.9), which is rebuilt here. K and b both vanish while a tendon is slack, so they
depend on u as well. (5.11) prints P^d as a column of blocks; it is their BlockDiag, as B^d P^d in (5.15) has it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.errors import StructureError
from tensctl.model.shell_equations.blocks import diagonal


@dataclass(frozen=True, eq=False)
class TendonForces:
    """Forces of stacked tendons at one q and u.

    Attributes
    ----------
    rows : (3N, q)
        R_alpha of each tendon below the other.
    t : (N, 3) m
        Tendon vectors (5.6).
    taut : (N,) bool
        Lbar <= |t| (5.2).
    stiffness, rest_lengths : (N,) N/m, m
        k when taut, and L0.
    """

    rows: sparse.csr_array
    t: Float[np.ndarray, "tendons 3"]
    taut: np.ndarray
    stiffness: Float[np.ndarray, " tendons"]
    rest_lengths: Float[np.ndarray, " tendons"]

    @property
    def lengths(self) -> Float[np.ndarray, " tendons"]:
        """|t|, m."""
        return np.linalg.norm(self.t, axis=1)

    @property
    def k(self) -> Float[np.ndarray, " tendons"]:
        """Stiffness k of (5.2), N/m: 0 while slack."""
        return np.where(self.taut, self.stiffness, 0.0)

    @property
    def K(self) -> sparse.csr_array:
        """K^d or K^0, (3N, q) N/m: K_alpha of each tendon (5.7), stacked (5.11), (5.12)."""
        factor = self.k * (self.rest_lengths / self._divisors - 1)
        return sparse.csr_array(sparse.diags_array(np.repeat(factor, self.t.shape[1])) @ self.rows)

    @property
    def P(self) -> sparse.csr_array:
        """P^d or P^0, (3N, N) N/m: BlockDiag of b_alpha (5.8), (5.11), (5.12)."""
        b = self.k[:, None] * self.t / self._divisors[:, None]
        return diagonal(b[:, :, None])

    def tensions(self, u: Float[np.ndarray, " tendons"]) -> Float[np.ndarray, " tendons"]:
        """F of (5.2), N."""
        return self.k * (self.lengths - self.rest_lengths + u)

    @property
    def _divisors(self) -> np.ndarray:
        # A tendon of no length is slack or rests at no length; either way its direction is multiplied by zero.
        return np.where(self.lengths > 0, self.lengths, 1.0)


def tendon_forces(
    rows: sparse.csr_array,
    q: Float[np.ndarray, " q"],
    u: Float[np.ndarray, " tendons"],
    stiffness: Float[np.ndarray, " tendons"],
    rest_lengths: Float[np.ndarray, " tendons"],
) -> TendonForces:
    """Decide which tendons pull and state their forces, (5.1)-(5.12).

    Parameters
    ----------
    rows : (3N, q), R for f^d (4.17), `independent_rows` for f^0
    q, u : m
    stiffness, rest_lengths : N/m and m, L0 before control

    Raises
    ------
    StructureError
        An input above L0 (5.4).
    """
    rest = np.asarray(rest_lengths, float) - u
    if (rest < 0).any():
        at = int(rest.argmin())
        raise StructureError(
            f"input {at} shortens its tendon by {np.asarray(u)[at]:g} m, more than its rest length "
            f"{rest_lengths[at]:g} m; keep u <= L0 (5.4)."
        )
    t = (rows @ q).reshape(len(rest), -1)
    return TendonForces(rows, t, rest <= np.linalg.norm(t, axis=1), np.asarray(stiffness), np.asarray(rest_lengths))
