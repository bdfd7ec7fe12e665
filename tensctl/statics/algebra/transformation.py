"""Coordinates in which the bars decouple: bar coordinates q_d and the place q_e of every bar cluster ([W] Theorem 11).

    p = P' q (30),   C_b' P' = [V_B1, 0],   P = [P1; P2],   S1 = P1 C_s,   S2 = P2 C_s              (31)-(33)
    S1 t = V_B1' f + D1 w,   S2 t = D2 w,   D1 = P1 C_w,   D2 = P2 C_w                               (34), (35)

(31) writes P and means what (75) and Step 1 call P'; here P is that of (31), stacked rows P1 over P2. Nothing in
Lemmas 17-23 needs orthonormal V_B1, only C_b' P' = [V_B1, 0] with P nonsingular, so integer transformations serve as
well: Corollaries 13 and 14 for class 1, `forest_transformation` for every class.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.statics.algebra.forest import spanning_forest
from tensctl.statics.algebra.network import Network, component_labels

Kind = Literal["svd", "centres", "ends", "forest"]


@dataclass(frozen=True, eq=False)
class Transformation:
    """A nonsingular P with P C_b = [V_B1'; 0].

    Attributes
    ----------
    P : (n_p, n_p)
    V_B1 : (n_b, rho_B)
        Bars from bar coordinates, b = V_B1 q_d; the identity for class 1 under Corollaries 13 and 14.
    kind : "svd" (Theorem 11), "centres" (Corollary 13), "ends" (Corollary 14) or "forest"
    """

    P: Float[np.ndarray, "nodes nodes"]
    V_B1: Float[np.ndarray, "bars rho"]
    kind: Kind

    @property
    def rho_B(self) -> int:
        """Rank of C_b."""
        return self.V_B1.shape[1]

    @property
    def P1(self) -> Float[np.ndarray, "rho nodes"]:
        """Rows of the bar coordinates."""
        return self.P[: self.rho_B]

    @property
    def P2(self) -> Float[np.ndarray, "clusters nodes"]:
        """Rows of the clusters' places; constant on the nodes of each cluster of touching bars."""
        return self.P[self.rho_B :]

    def nodes(self, q: Float[np.ndarray, "nodes d"]) -> Float[np.ndarray, "nodes d"]:
        """Nodes p = P' q, m (30)."""
        return self.P.T @ q

    def coordinates(self, p: Float[np.ndarray, "nodes d"]) -> Float[np.ndarray, "nodes d"]:
        """The q with P' q = p, m: q_d in the first rho_B rows, then q_e."""
        return np.linalg.solve(self.P.T, p)

    def split(self, C: sparse.csr_array) -> tuple[np.ndarray, np.ndarray]:
        """P1 C and P2 C: S1, S2 from C_s (33), D1, D2 from C_w (35)."""
        both = (C.T @ self.P.T).T
        return both[: self.rho_B], both[self.rho_B :]

    def residual(self, network: Network) -> float:
        """Largest entry of C_b' P' - [V_B1, 0]."""
        off = network.C_b.T @ self.P.T
        off[:, : self.rho_B] -= self.V_B1
        return float(np.abs(off).max(initial=0.0))


def theorem11(network: Network) -> Transformation:
    """P1 = Sigma_B1^-1 U_B1', P2 = U_B2' from the singular value decomposition of C_b (28)-(31).

    The rank comes from the graph (Lemma 7), and U_B2 is known without arithmetic: C_b' x = 0 means that x is constant
    on every cluster of touching bars, so its columns are indicators over the square root of the cluster's size. The
    condition of P is that of C_b, at most about n_p for a chain of bars. Dense: n_p n_b^2 operations.
    """
    pieces, piece = component_labels(network.n_p, network.bars)
    rho = network.n_p - pieces
    U, sigma, Vt = np.linalg.svd(network.C_b.toarray().astype(float), full_matrices=False)
    P = np.zeros((network.n_p, network.n_p))
    P[:rho] = U[:, :rho].T / sigma[:rho, None]
    P[rho + piece, np.arange(network.n_p)] = 1 / np.sqrt(np.bincount(piece, minlength=pieces)[piece])
    return Transformation(P, Vt[:rho].T.copy(), "svd")


def forest_transformation(network: Network) -> Transformation:
    """Integer P for any class: q_d are the bars of a spanning forest, q_e one node of each cluster.

    p = [paths, R] q with the forest's paths and R = 1 where a node belongs to a cluster, so P has entries -1, 0, 1 and
    determinant +-1. V_B1 = C_b' paths writes every bar by those of the forest. [W] has this for class 1 only, as
    Corollary 14 (with the even node as root); for class k it is an addition of this project.
    """
    forest = spanning_forest(network.n_p, network.bars)
    P = np.zeros((network.n_p, network.n_p))
    P[: len(forest.tree)] = forest.paths.T.toarray()
    P[len(forest.tree) + forest.root_of, np.arange(network.n_p)] = 1
    V_B1 = (network.C_b.T @ forest.paths).toarray().astype(float)
    return Transformation(P, V_B1, "forest")


def bar_coordinates(transformation: Transformation, b: Float[np.ndarray, "bars d"]) -> Float[np.ndarray, "rho d"]:
    """q_d from the bars: q_d = V_B1' b for orthonormal V_B1 (32), its pseudo-inverse in general."""
    return np.linalg.lstsq(transformation.V_B1, b, rcond=None)[0]
