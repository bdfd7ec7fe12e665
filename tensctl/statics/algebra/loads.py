"""Equilibrium under load: inhomogeneous terms and the two conditions of solvability ([W] Theorem 22, Lemma 23).

    t = V2 M^-1 V2' S1' q1 + G1 w,   G1 = (I - V2 M^-1 V2' Gamma^-1) V1 Sigma11^-1 U1' D2          (79)
    Y q1 = G w,   U2' D2 w = 0,   G = D1 - S1 G1                                                     (80), (81)
    q1 = V_Y2 z + Y^+ G w  with  U_Y2' G w = 0
    q2 = L q1 + U1 Sigma11^-1 V1' Gamma^-1 G1 w + U2 z_e

(80) and Lemma 23 print P2 where D2 belongs; after Theorem 22 D stands for G and Lambda - X for Y; (75) and Steps 3-4
leave out both load terms of q1 and q2; (84) calls G1 "D1". w is the force applied TO the node, N.

By Lemma 23, U2' P2 = e [1, ..., 1] for a connected structure, so the second condition of (80) says: the loads balance.
(Its proof looks at strings only, but rows of U2' P2 are constant across bars too, since P2 C_b = 0; without that, a
structure whose strings alone are not connected would escape.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra.bars import BarCondition
from tensctl.statics.algebra.incidence_matrices import load_incidence
from tensctl.statics.algebra.strings import StringForces
from tensctl.statics.algebra.transformation import Transformation

# Loads are typed by hand with sums that cancel to rounding; what is left over comes back as force residual.
SOLVABLE = 1e-9


@dataclass(frozen=True, eq=False)
class LoadTerms:
    """Theorem 22 for loads w on given nodes.

    Attributes
    ----------
    w : (n_w, d) N
    load_nodes : (n_w,) int
    D1, D2, G1, G : (rho_B, n_w), (n_p - rho_B, n_w), (n_s, n_w), (rho_B, n_w)
    places : (n_p - rho_B, n_w) m/N
        U1 Sigma11^-1 V1' Gamma^-1 G1, the load's own part of q2.
    """

    w: Float[np.ndarray, "loads d"]
    load_nodes: Int[np.ndarray, " loads"]
    D1: np.ndarray
    D2: np.ndarray
    G1: np.ndarray
    places: np.ndarray
    G: np.ndarray


def theorem22(
    forces: StringForces,
    transformation: Transformation,
    w: Float[np.ndarray, "loads d"],
    load_nodes: Int[np.ndarray, " loads"] | None = None,
) -> LoadTerms:
    """G1 and G of (79) and (81); without `load_nodes` there is one load for every node (C_w = I).

    Raises
    ------
    StructureError
        Loads whose shape does not fit their nodes.
    """
    n_p = len(transformation.P)
    w = np.asarray(w, float)
    nodes = np.arange(n_p) if load_nodes is None else np.asarray(load_nodes, int)
    if w.ndim != 2 or len(w) != len(nodes):
        raise StructureError(f"loads have shape {w.shape}; one row of 1 to 3 components (N) for each of {len(nodes)}.")
    if not np.isfinite(w).all():
        raise StructureError("loads hold a value that is not finite; give forces in N.")
    D1, D2 = transformation.split(load_incidence(n_p, nodes))
    G1, places = forces.carried(D2)
    return LoadTerms(w, nodes, D1, D2, G1, places, D1 - forces.space.S1 @ G1)


def lemma23(forces: StringForces, transformation: Transformation) -> np.ndarray:
    """U2' P2 (pieces, n_p): every row is constant on every connected piece (82).

    (82) prints n_s columns and one vector e for any structure; it has n_p columns, and one e only when connected.
    """
    return forces.space.U2.T @ transformation.P2


def require_balance(forces: StringForces, terms: LoadTerms) -> None:
    """Check U2' D2 w = 0, the second condition of (80).

    Raises
    ------
    EquilibriumError
        With the sum of the loads, N.
    """
    left = forces.space.U2.T @ terms.D2 @ terms.w
    bound = np.abs(forces.space.U2.T @ terms.D2) @ np.abs(terms.w)
    if (np.abs(left) > SOLVABLE * bound).any():
        total = np.array2string(terms.w.sum(axis=0), precision=4)
        raise EquilibriumError(
            f"the loads add up to {total} N (U2' D2 w is not zero, Lemma 23); a structure that nothing holds balances "
            "only loads of sum zero, so add the reactions of the supports to them."
        )


def require_reach(condition: BarCondition, terms: LoadTerms) -> None:
    """Check U_Y2' G w = 0: a singular Y reaches only some loads.

    The null vectors of Y are the shapes that these coefficients hold at any size, such as the affine images of a
    prestressed structure; a load that does work on one of them is resisted by none.

    Raises
    ------
    EquilibriumError
        With the size of the part that cannot be reached.
    """
    left = condition.U_Y2.T @ (terms.G @ terms.w)
    bound = np.linalg.norm(terms.G) * np.linalg.norm(terms.w)
    size = float(np.linalg.norm(left))
    if size > SOLVABLE * bound:
        raise EquilibriumError(
            f"the loads act on the null space of Y = X - V_B1' Lambda V_B1 (U_Y2' G w is {size:.1e} N, "
            f"{size / bound:.1e} of its bound, 0 is expected; {condition.rank}); change the loads, or the coefficients "
            "so that Y becomes regular."
        )
