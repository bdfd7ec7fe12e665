"""What the bars must carry: the condition on bar coordinates and its three rank cases ([W] Lemma 19).

    Y q1 = 0 (69),   Y = X - V_B1' Lambda V_B1 (71),   X = (S1 V2) M^-1 (S1 V2)' (70)

    (i) rank Y = rho_B: only q1 = 0;   (ii) rank Y = 0: every q1;   (iii) between: q1 = V_Y2 z1 (72)

The rank of Y is the one rank of [W] that no graph decides. Each coordinate axis takes its own vector from the null
space, so its dimension is the most dimensions that the structure can fill: with nullity 1 all bars are parallel, a
flat structure needs 2, a solid one 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.statics.algebra.rank_decision import RankDecision, decide_rank
from tensctl.statics.algebra.strings import StringForces, coefficients
from tensctl.statics.algebra.transformation import Transformation


@dataclass(frozen=True, eq=False)
class BarCondition:
    """The matrix of (71), its rank and its null space.

    Attributes
    ----------
    Y : (rho_B, rho_B) N/m
        X - V_B1' Lambda V_B1, symmetric.
    lam : (n_b,) N/m
    sizes, vectors : (rho_B,) N/m and (rho_B, rho_B)
        Eigenvalues by descending size and orthonormal eigenvectors: for a symmetric matrix these are the singular
        values with signs, V_Y, and U_Y up to signs.
    rank : RankDecision
        From the sizes, against rounding in X and Lambda.
    """

    Y: np.ndarray
    lam: Float[np.ndarray, " bars"]
    sizes: np.ndarray
    vectors: np.ndarray
    rank: RankDecision

    @property
    def V_Y2(self) -> np.ndarray:
        """Orthonormal null space of Y (73), (rho_B, rho_B - rho_Y); the identity in case (ii)."""
        return np.eye(len(self.Y)) if self.rank.rank == 0 else self.vectors[:, self.rank.rank :]

    @property
    def U_Y2(self) -> np.ndarray:
        """Orthonormal null space of Y': that of Y, since Y is symmetric."""
        return self.V_Y2

    @property
    def case(self) -> Literal["i", "ii", "iii"]:
        """Which case of Lemma 19 holds."""
        if self.rank.nullity == 0:
            return "i"
        return "ii" if self.rank.rank == 0 else "iii"

    def pinv(self, right: np.ndarray) -> np.ndarray:
        """Y^+ right, with the rank that was decided."""
        r = self.rank.rank
        return self.vectors[:, :r] @ ((self.vectors[:, :r].T @ right) / self.sizes[:r, None])


def lemma19(
    forces: StringForces,
    transformation: Transformation,
    lam: Float[np.ndarray, " bars"] | float,
    *,
    rank_tol: float | None = None,
) -> BarCondition:
    """Form Y for given compressive coefficients lambda, N/m, and decide its rank.

    Parameters
    ----------
    forces : StringForces
    transformation : Transformation
    lam : (n_b,) or number, N/m
        Any sign here; `Configuration.verify` asks for compression.
    rank_tol : float, optional
        Relative size below which a value counts as zero; needed for coefficients that were rounded on paper.

    Raises
    ------
    StructureError
        A number of coefficients that is not the number of bars.
    """
    V = transformation.V_B1
    lam = coefficients(lam, len(V), "lambda", "bars")
    carried = V.T @ (lam[:, None] * V)
    Y = forces.X - carried
    Y = 0.5 * (Y + Y.T)
    sizes, vectors = np.linalg.eigh(Y)
    order = np.argsort(-np.abs(sizes), kind="stable")
    pushed = V.T @ (np.abs(lam)[:, None] * V)
    scale = norm(forces.X) + norm(pushed)
    # Along each direction of bar coordinates strings and bars together have at least this stiffness.
    weakest = max(float(np.linalg.eigvalsh(forces.X + pushed)[0]), 0.0)
    decision = decide_rank(sizes, scale=scale, rounding=rounding(forces, scale), rank_tol=rank_tol, weakest=weakest)
    return BarCondition(Y, lam, sizes[order], vectors[:, order], decision)


def rounding(forces: StringForces, scale: float) -> float:
    """What a zero eigenvalue of Y may become, N/m.

    Two parts: the eigenvalue solver's own error, and that of X = H' H, where H is what is left of Gamma^(1/2) S1' and
    carries an error of eps |Gamma^(1/2) S1'| however small it is itself. Measured against rational arithmetic the
    bound is too wide by 19 and more, never too narrow, for coefficients that spread over up to 1e12.
    """
    eps = 4 * np.finfo(float).eps
    full, half = norm(forces.space.S1 * np.sqrt(forces.gamma)), np.sqrt(norm(forces.X))
    blur = eps * np.sqrt(len(forces.gamma)) * full
    return float(max(len(forces.X), 1) * eps * scale + blur * (2 * half + blur))


def norm(A: np.ndarray) -> float:
    """Spectral norm; 0 for an empty matrix."""
    return float(np.linalg.norm(A, 2)) if A.size else 0.0
