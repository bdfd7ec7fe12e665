"""What the strings allow once the bars are set: places of the bar clusters, then tensions ([W] Lemmas 17 and 18).

    S2 = U1 Sigma11 V1' (64);   (58) has a solution q2 if and only if V2'(s - S1' q1) = 0 (65)
    t = V2 M^-1 V2' S1' q1,   M = V2' Gamma^-1 V2 (67)
    q2 = L q1 + U2 z2,   L = U1 Sigma11^-1 V1' (Gamma^-1 V2 M^-1 V2' - I) S1' (68), (76)

(64) and (66) print n_b - rho_2 for the columns of U2 and the entries of z2: in general there are n_p - rho_B - rho_2.
(68) and (76) print I_3 inside L where I has n_s rows. These are the tensions of springs of zero rest length and
stiffness gamma between bars held at q1, with the clusters' places left to them; the equal and better conditioned form

    V2 M^-1 V2' = Gamma - Gamma S2' (S2 Gamma S2')^+ S2 Gamma,   L = -(S2 Gamma S2')^+ S2 Gamma S1'

is what is computed: M^-1 loses about as many digits as the coefficients spread over, this form hardly any.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra.graph_ranks import ranks
from tensctl.statics.algebra.network import Network
from tensctl.statics.algebra.transformation import Transformation


@dataclass(frozen=True, eq=False)
class StringSpace:
    """S1, S2 and the singular value decomposition of S2, split at its exact rank.

    Attributes
    ----------
    S1, S2 : (rho_B, n_s), (n_p - rho_B, n_s)
    U1, sigma, V1 : (n_p - rho_B, rho_2), (rho_2,), (n_s, rho_2)
    U2 : (n_p - rho_B, pieces)
        Orthonormal; each piece's common translation. Signs are such that z2 > 0 moves along the axes.
    V2 : (n_s, n_s - rho_2)
        Orthonormal basis of the string forces that leave every bar cluster in balance.
    """

    S1: np.ndarray
    S2: np.ndarray
    U1: np.ndarray
    sigma: np.ndarray
    V1: np.ndarray
    U2: np.ndarray
    V2: np.ndarray

    def places(self, s: Float[np.ndarray, "strings d"], q1: Float[np.ndarray, "rho d"]) -> np.ndarray:
        """q2 of (66) with z2 = 0, m, for string vectors that satisfy (65)."""
        return self.U1 @ ((self.V1.T @ (s - self.S1.T @ q1)) / self.sigma[:, None])

    def misfit(self, s: Float[np.ndarray, "strings d"], q1: Float[np.ndarray, "rho d"]) -> np.ndarray:
        """V2'(s - S1' q1), m: zero when (58) has a solution (65)."""
        return self.V2.T @ (s - self.S1.T @ q1)


def lemma17(network: Network, transformation: Transformation) -> StringSpace:
    """Decompose S2; its rank rho_2 comes from the graph, not from the singular values.

    Dense: needs (n_s)^2 numbers, so some thousand strings are the limit.
    """
    S1, S2 = transformation.split(network.C_s)
    rho = ranks(network).rho_2
    U, sigma, Vt = np.linalg.svd(S2)
    U2 = U[:, rho:]
    sign = np.where((transformation.P2.T @ U2).sum(axis=0) < 0, -1.0, 1.0)
    return StringSpace(S1, S2, U[:, :rho], sigma[:rho], Vt[:rho].T, U2 * sign, Vt[rho:].T)


@dataclass(frozen=True, eq=False)
class StringForces:
    """Lemma 18: tensions and places as linear functions of q1, for given gamma.

    Attributes
    ----------
    space : StringSpace
    gamma : (n_s,) N/m
    Q, R : (n_s, rho_2), (rho_2, rho_2)
        Gamma^(1/2) S2' U1 = Q R, so that U1' S2 Gamma S2' U1 = R' R without ever being formed.
    """

    space: StringSpace
    gamma: Float[np.ndarray, " strings"]
    Q: np.ndarray
    R: np.ndarray

    @property
    def M(self) -> np.ndarray:
        """V2' Gamma^-1 V2, m/N (67)."""
        return self.space.V2.T @ (self.space.V2 / self.gamma[:, None])

    @cached_property
    def T(self) -> np.ndarray:
        """V2 M^-1 V2' S1' (n_s, rho_B), N/m: t = T q1 when unloaded (67)."""
        return np.sqrt(self.gamma)[:, None] * self._half

    @cached_property
    def L(self) -> np.ndarray:
        """q2 = L q1 + U2 z2 when unloaded (76), (n_p - rho_B, rho_B)."""
        pull = self.Q.T @ (np.sqrt(self.gamma)[:, None] * self.space.S1.T)
        return -self.space.U1 @ sla.solve_triangular(self.R, pull)

    @cached_property
    def X(self) -> np.ndarray:
        """(S1 V2) M^-1 (S1 V2)', N/m (70): what the strings do to the bars, symmetric and never negative."""
        return self._half.T @ self._half

    def carried(self, D2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tensions G1 (79) and places of the clusters that a load takes for itself, at q1 = 0.

        G1 = (I - V2 M^-1 V2' Gamma^-1) V1 Sigma11^-1 U1' D2 = Gamma S2' (S2 Gamma S2')^+ D2, and the places are
        (S2 Gamma S2')^+ D2 = U1 Sigma11^-1 V1' Gamma^-1 G1.
        """
        pushed = sla.solve_triangular(self.R, self.space.U1.T @ D2, trans="T")
        return np.sqrt(self.gamma)[:, None] * (self.Q @ pushed), self.space.U1 @ sla.solve_triangular(self.R, pushed)

    @cached_property
    def _half(self) -> np.ndarray:
        return _remainder(self.space, self.gamma, self.Q)


def lemma18(space: StringSpace, gamma: Float[np.ndarray, " strings"] | float) -> StringForces:
    """Tensions for given tensile coefficients gamma > 0, N/m.

    Raises
    ------
    StructureError
        A number of coefficients that is not the number of strings.
    EquilibriumError
        A coefficient that is not positive.
    """
    gamma = coefficients(gamma, space.V2.shape[0], "gamma", "strings")
    if not (gamma > 0).all():
        n = int((~(gamma > 0)).argmax())
        raise EquilibriumError(
            f"gamma of string {n} is {gamma[n]:g} N/m; Definition 5 wants every gamma > 0 (M = V2' Gamma^-1 V2), so "
            "leave a slack string out of the network."
        )
    return StringForces(space, gamma, *_graded_qr(space, gamma))


def _graded_qr(space: StringSpace, gamma: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Q and R of Gamma^(1/2) S2' U1; rows of falling size keep Householder's method accurate row by row."""
    order = np.argsort(-gamma, kind="stable")
    rows = np.sqrt(gamma)[:, None] * (space.S2.T @ space.U1)
    Q = np.empty_like(rows)
    Q[order], R = np.linalg.qr(rows[order])
    return Q, R


def _remainder(space: StringSpace, gamma: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """(I - Q Q') Gamma^(1/2) S1', (n_s, rho_B): X is its square."""
    full = np.sqrt(gamma)[:, None] * space.S1.T
    half = full - Q @ (Q.T @ full)
    return half - Q @ (Q.T @ half)  # twice is enough (Kahan): what cancelled in the first pass is cleaned in the second


def coefficients(given: np.ndarray | float, count: int, name: str, members: str) -> Float[np.ndarray, " count"]:
    """One finite coefficient a member from a number or an array, N/m."""
    values = np.asarray(given, float)
    if values.ndim > 1 or (values.ndim == 1 and len(values) != count):
        raise StructureError(f"{name} has shape {values.shape}; one number or {count} (one for each of the {members}).")
    if not np.isfinite(values).all():
        raise StructureError(f"{name} holds a value that is not finite; give force coefficients in N/m.")
    return np.broadcast_to(values, (count,)).copy()
