"""What the five steps leave behind, by the letters of [W], and how well all of it holds ([W] section 5).

residual = max of (13), (19), (23), b = V_B1 q1 and Y q1 = G w, each relative to its own terms
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.algebra.bars import BarCondition
from tensctl.statics.algebra.configuration import Configuration
from tensctl.statics.algebra.loads import LoadTerms
from tensctl.statics.algebra.rank_decision import RankDecision
from tensctl.statics.algebra.shape import Shapes
from tensctl.statics.algebra.strings import StringForces
from tensctl.statics.algebra.transformation import Transformation


@dataclass(frozen=True, eq=False)
class FiveSteps:
    """What each step made, the structure it ends in, and how well all of it holds.

    Attributes
    ----------
    transformation : Transformation
    forces : StringForces
    condition : BarCondition
    terms : LoadTerms or None
    shapes : Shapes
        Every other structure with these coefficients and loads.
    z_d, z_e : (rho_B - rank Y, d), (n_p - rho_B - rho_2, d) m
    q : (n_p, d) m
    configuration : Configuration
        The structure: p, s, b, t, f with network, coefficients and loads.
    """

    transformation: Transformation
    forces: StringForces
    condition: BarCondition
    terms: LoadTerms | None
    shapes: Shapes
    z_d: np.ndarray
    z_e: np.ndarray
    q: Float[np.ndarray, "nodes d"]
    configuration: Configuration

    @property
    def P(self) -> np.ndarray:
        """Step 1: transformation (n_p, n_p), P1 over P2, p = P' q."""
        return self.transformation.P

    @property
    def S1(self) -> np.ndarray:
        """Step 1: P1 C_s (rho_B, n_s)."""
        return self.forces.space.S1

    @property
    def S2(self) -> np.ndarray:
        """Step 1: P2 C_s (n_p - rho_B, n_s)."""
        return self.forces.space.S2

    @property
    def V2(self) -> np.ndarray:
        """Step 1: orthonormal null space of S2 (n_s, n_s - rho_2)."""
        return self.forces.space.V2

    @property
    def M(self) -> np.ndarray:
        """Step 2: V2' Gamma^-1 V2, m/N."""
        return self.forces.M

    @property
    def X(self) -> np.ndarray:
        """Step 2: (S1 V2) M^-1 (S1 V2)', N/m."""
        return self.forces.X

    @property
    def Y(self) -> np.ndarray:
        """Step 2: X - V_B1' Lambda V_B1, N/m."""
        return self.condition.Y

    @property
    def rank_Y(self) -> RankDecision:
        """Step 2: rank of Y with its gap and tolerance."""
        return self.condition.rank

    @property
    def V_Y2(self) -> np.ndarray:
        """Step 2: null space of Y (rho_B, rho_B - rank Y)."""
        return self.condition.V_Y2

    @property
    def p(self) -> np.ndarray:
        """Step 4: nodes (n_p, d), m."""
        return self.configuration.p

    @property
    def s(self) -> np.ndarray:
        """Step 5: string vectors (n_s, d), m."""
        return self.configuration.s

    @property
    def b(self) -> np.ndarray:
        """Step 5: bar vectors (n_b, d), m."""
        return self.configuration.b

    @property
    def t(self) -> np.ndarray:
        """Step 5: string forces (n_s, d), N."""
        return self.configuration.t

    @property
    def f(self) -> np.ndarray:
        """Step 5: bar forces (n_b, d), N."""
        return self.configuration.f

    @property
    def bar_residual(self) -> float:
        """Misfit of b = V_B1 q1 over the longest bar component; tests the transformation."""
        off = self.b - self.transformation.V_B1 @ self.q[: self.transformation.rho_B]
        return float(np.abs(off).max(initial=0.0) / (np.abs(self.b).max(initial=0.0) or 1.0))

    @property
    def condition_residual(self) -> float:
        """Misfit of Y q1 = G w (80) over the size of its terms."""
        q1 = self.q[: self.transformation.rho_B]
        right = self.terms.G @ self.terms.w if self.terms else np.zeros_like(q1)
        size = self.rank_Y.scale * np.abs(q1).max(initial=0.0) + np.abs(right).max(initial=0.0)
        return float(np.abs(self.Y @ q1 - right).max(initial=0.0) / (size or 1.0))

    @property
    def residual(self) -> float:
        """Largest of all residuals: Definition 16, b = V_B1 q1 and (80)."""
        return max(self.configuration.residual, self.bar_residual, self.condition_residual)

    def verify(self, tol: float = 1e-9, *, bars_may_pull: bool = False) -> None:
        """Check Definition 16 and the identities of steps 1 to 4.

        Raises
        ------
        EquilibriumError
            The law that does not hold, with its residual.
        StructureError
            A bar of zero length.
        """
        self.configuration.verify(tol, bars_may_pull=bars_may_pull)
        for law, residual in (("b = V_B1 q1", self.bar_residual), ("Y q1 = G w (80)", self.condition_residual)):
            if not residual <= tol:
                raise EquilibriumError(f"{law}: false by {residual:.1e}, at most {tol:.0e} is expected.")
