"""All coefficients at which a network can hold itself, as eigenvalues ([W] Corollary 20).

    X q1 = (lambda/gamma) V_B1' V_B1 q1      with Gamma = gamma I, Lambda = lambda I

V2 must be orthonormal: X = gamma S1 V2 V2' S1' only then, as M = I / gamma. With the V2 that Example 24 prints, the
matrix S1 V2 (S1 V2)' has eigenvalues {1, 3}; right is {1, 1}. The same line holds for patterns: with Gamma given and
Lambda = mu Lambda_0, the admissible mu are the eigenvalues of X q1 = mu V_B1' Lambda_0 V_B1 q1. An eigenvalue of
multiplicity d lets the structure fill d dimensions (Lemma 19), so a solid structure needs a triple one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Int

from tensctl.errors import EquilibriumError
from tensctl.statics.algebra.bars import norm, rounding
from tensctl.statics.algebra.network import Network
from tensctl.statics.algebra.rank_decision import DECISIVE_GAP
from tensctl.statics.algebra.strings import coefficients, lemma17, lemma18
from tensctl.statics.algebra.transformation import Transformation, theorem11


@dataclass(frozen=True, eq=False)
class Ratios:
    """Eigenvalues mu of the pencil and which of them coincide.

    Attributes
    ----------
    eigenvalues : (rho_B,), ascending, all >= 0 up to rounding
    vectors : (rho_B, rho_B)
        Bar coordinates q1, one column an eigenvalue, V_B1' Lambda_0 V_B1-orthonormal.
    values : (k,), ascending
        Distinct positive ones: the admissible lambda/gamma (Definition 5 wants lambda > 0).
    multiplicity : (k,) int
    tolerance : float
        Eigenvalues nearer than this count as one.
    separation : float
        Least distance between eigenvalues counted apart.
    """

    eigenvalues: Float[np.ndarray, " rho"]
    vectors: np.ndarray
    values: Float[np.ndarray, " k"]
    multiplicity: Int[np.ndarray, " k"]
    tolerance: float
    separation: float

    @property
    def decided(self) -> bool:
        """Whether double precision tells equal eigenvalues from different ones."""
        return bool(self.separation >= DECISIVE_GAP * self.tolerance)

    def filling(self, d: int) -> Float[np.ndarray, " k"]:
        """The admissible values that let a structure fill d dimensions."""
        return self.values[self.multiplicity >= d]


def admissible_ratios(
    network: Network,
    *,
    gamma: Float[np.ndarray, " strings"] | float = 1.0,
    lam: Float[np.ndarray, " bars"] | float = 1.0,
    transformation: Transformation | None = None,
) -> Ratios:
    """All mu for which Gamma = diag(gamma) and Lambda = mu diag(lam) have an equilibrium without load.

    Parameters
    ----------
    network : Network
    gamma, lam : N/m
        Patterns; with both equal to 1, mu is the ratio lambda/gamma of Corollary 20.
    transformation : Transformation, optional
        Theorem 11's by default; mu does not depend on it.

    Raises
    ------
    EquilibriumError
        A pattern that is not positive.
    StructureError
        A network that sections 4 and 5 do not cover, or a pattern of the wrong length.
    """
    network.verify()
    transformation = theorem11(network) if transformation is None else transformation
    forces = lemma18(lemma17(network, transformation), gamma)
    lam = coefficients(lam, network.n_b, "lam", "bars")
    if not (lam > 0).all():
        m = int((~(lam > 0)).argmax())
        raise EquilibriumError(f"lam of bar {m} is {lam[m]:g}; the pattern of a compressed bar is positive.")
    V = transformation.V_B1
    metric = V.T @ (lam[:, None] * V)
    eigenvalues, vectors = sla.eigh(forces.X, metric)
    tolerance = rounding(forces, norm(forces.X)) / float(np.linalg.eigvalsh(metric)[0])
    apart = np.diff(eigenvalues) > tolerance
    groups = np.split(eigenvalues, np.flatnonzero(apart) + 1)
    positive = [group for group in groups if group.mean() > tolerance]
    return Ratios(
        eigenvalues=eigenvalues,
        vectors=vectors,
        values=np.array([group.mean() for group in positive]),
        multiplicity=np.array([len(group) for group in positive], int),
        tolerance=tolerance,
        separation=float(np.diff(eigenvalues)[apart].min(initial=np.inf)),
    )
