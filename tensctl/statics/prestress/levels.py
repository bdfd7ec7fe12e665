"""Stiffness against the level of prestress: the same nodes, all tensions scaled.

    H(s) = J'(K_E(s) + s K_G) J,   K_E = k uu' (constant k) or (EA + s T)/l uu' (constant EA)

A mechanism has only the geometric part, so its frequency grows as sqrt(s); the others start from the elastic part.
Which is which, and how much prestress a wanted stiffness takes, is what this table shows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.equilibrium import Equilibrium
from tensctl.statics.prestress.law import rest_length_of


@dataclass(frozen=True, eq=False)
class PrestressLevels:
    """Lowest stiffness and frequency at several levels of one prestress.

    Attributes
    ----------
    scales : (k,)
        Tension over that of the equilibrium given.
    equilibria : k equilibria
        Same nodes, other rest lengths.
    """

    scales: Float[np.ndarray, " k"]
    equilibria: tuple[Equilibrium, ...]

    @property
    def rest_lengths(self) -> Float[np.ndarray, "k tendons"]:
        """Rest lengths that make each level, m."""
        return np.stack([rest.rest_lengths for rest in self.equilibria])

    @property
    def omega2(self) -> Float[np.ndarray, " k"]:
        """Lowest squared frequency that is no rigid-body motion, rad^2/s^2; negative where the level is unstable."""
        return np.array([rest.smallest for rest in self.equilibria])

    @property
    def frequency(self) -> Float[np.ndarray, " k"]:
        """Lowest natural frequency, Hz; 0 where the level is unstable."""
        return np.sqrt(np.maximum(self.omega2, 0.0)) / (2 * np.pi)

    @property
    def stiffness(self) -> Float[np.ndarray, " k"]:
        """Smallest eigenvalue of the Hessian across rigid-body motions, N/m in displacements of rod ends."""
        return np.array([_lowest(rest) for rest in self.equilibria])

    def verify(self, tol: float = 1e-9) -> None:
        """Check that each level balances and has its tensions.

        Raises
        ------
        EquilibriumError
            With the first level that fails. Weak prestress of stiff tendons cannot pass: its tensions are differences
            of lengths, with an error of 1e-16 k l.
        """
        one = self.equilibria[0].tensions / self.scales[0]
        for scale, rest in zip(self.scales, self.equilibria, strict=True):
            rest.verify(tol)
            off = np.abs(rest.tensions - scale * one).max(initial=0.0) / (scale * one.max(initial=1e-300))
            if not off <= tol:
                raise EquilibriumError(
                    f"at scale {scale:g} tensions are off by {off:.1e}; at most {tol:.0e} is expected."
                )


def prestress_levels(equilibrium: Equilibrium, scales: Float[np.ndarray, " k"] | list[float]) -> PrestressLevels:
    """Scale the prestress of an unloaded equilibrium; nodes stay, rest lengths follow the tendon law.

    Parameters
    ----------
    scales : positive numbers
        1 is the equilibrium's own level.

    Raises
    ------
    EquilibriumError
        Under loads (only self-stress can be scaled), for scales that are not positive, or where a rest length would
        fall to zero.
    """
    potential = equilibrium.potential
    if potential.members.forces.any():
        raise EquilibriumError(
            "loads act on the structure, and only a self-stress can be scaled; leave loads and weight out."
        )
    levels = np.asarray(scales, float)
    if not (levels > 0).all():
        raise EquilibriumError(
            f"scales are {levels.tolist()}; positive numbers are expected, 1 is the present prestress."
        )
    taut = equilibrium.tensions > 0
    found = []
    for scale in levels:
        rest = rest_length_of(potential.members, equilibrium.lengths, scale * equilibrium.tensions)
        rest = np.where(taut, rest, equilibrium.rest_lengths)
        if not (rest > 0).all():
            label = equilibrium.structure.tendon_labels[int((rest <= 0).argmax())]
            raise EquilibriumError(
                f"at scale {scale:g} tendon {label} would need a rest length below zero; ask for less."
            )
        found.append(Equilibrium(potential, equilibrium.nodes, rest, 0))
    return PrestressLevels(levels, tuple(found))


def _lowest(rest: Equilibrium) -> float:
    hessian = rest.point.hessian.toarray()
    rigid = np.linalg.qr(rest.spectrum.rigid.basis, mode="complete")[0][:, rest.spectrum.rigid_count :]
    across = rigid.T @ hessian @ rigid
    return float(sla.eigvalsh(0.5 * (across + across.T))[0]) if across.size else 0.0
