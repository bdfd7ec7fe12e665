"""Does a prestress hold its shape? First order, second order, and for every size of motion, each as a number.

    first order     no mechanism: A'v = 0 only for rigid-body motions
    prestress       v'(Omega x I)v > 0 on every mechanism v, and with stiffness k on every motion that keeps rods
    super-stable    Omega >= 0, rank Omega = N - d - 1, and no affine motion keeps the members' lengths

Motions are displacements of nodes that lengthen no rod at first order, square to rigid-body motions and of norm one, so
eigenvalues are in N/m and do not depend on masses. First order and prestress stability: Connelly and Whiteley 1996, doi
10.1137/S0895480192229236. Super-stability is Connelly's sufficient condition that no other shape, in any dimension, has
tendons no longer and rods no shorter: Connelly 1982, doi 10.1007/BF01403501; Connelly and Guest, Frameworks,
Tensegrities and Symmetry, 2022, chapter 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.algebra.rank_decision import RankDecision
from tensctl.statics.prestress.matrix import equilibrium_matrix
from tensctl.statics.prestress.self_stress import SelfStress, rod_motions, self_stress
from tensctl.statics.prestress.stress_matrix import second_variation
from tensctl.statics.prestress.super_stability import SuperStability, super_stability
from tensctl.statics.stability import Stability
from tensctl.structure import Structure
from tensctl.structure.structure import lengths

_EPS = np.finfo(float).eps
_ACCEPTABLE = 1e-9


@dataclass(frozen=True, eq=False)
class Margin:
    """A smallest eigenvalue, with the size below which it is rounding.

    Attributes
    ----------
    smallest : float, N/m
        Infinity where there is nothing to hold.
    tolerance : float, N/m
    """

    smallest: float
    tolerance: float

    @property
    def verdict(self) -> Stability:
        """Yes above the tolerance, no below minus the tolerance, undecided between."""
        if self.smallest > self.tolerance:
            return Stability.YES
        return Stability.NO if self.smallest < -self.tolerance else Stability.UNDECIDED

    def __str__(self) -> str:
        return f"{self.verdict}: smallest {self.smallest:.3g} N/m, tolerance {self.tolerance:.1e}"


@dataclass(frozen=True, eq=False)
class StabilityOrders:
    """What holds a prestressed shape, and by how much.

    Attributes
    ----------
    structure : Structure
    nodes : (N, 3) m
    tensions, rod_forces : (nt,), (nr,) N
    stiffness : (nt,) N/m
        dT/dl of each tendon.
    spaces : SelfStress
        Mechanisms and the rank decision behind their number.
    on_mechanisms : Margin
        Smallest eigenvalue of the stress on the mechanisms: what prestress alone holds, whatever the stiffness.
    on_all : Margin
        Smallest eigenvalue of stress and elastic stiffness on all motions that keep rods.
    for_ever : SuperStability
        Super-stability and its three conditions.
    residual : float
        Largest unbalanced nodal force over the largest tension or load.
    """

    structure: Structure
    nodes: Float[np.ndarray, "nodes 3"]
    tensions: Float[np.ndarray, " tendons"]
    rod_forces: Float[np.ndarray, " rods"]
    stiffness: Float[np.ndarray, " tendons"]
    spaces: SelfStress
    on_mechanisms: Margin
    on_all: Margin
    for_ever: SuperStability
    residual: float

    @property
    def mechanisms(self) -> int:
        """Number of first-order mechanisms."""
        return self.spaces.mechanism_count

    @property
    def rank(self) -> RankDecision:
        """The decision behind the number of mechanisms: values around the gap, gap and tolerance."""
        return self.spaces.decision

    @property
    def first_order(self) -> Stability:
        """Whether geometry alone holds the shape, tendons taken as bars."""
        if not self.rank.decided:
            return Stability.UNDECIDED
        return Stability.NO if self.mechanisms else Stability.YES

    @property
    def prestress_stable(self) -> Stability:
        """Whether this prestress holds every mechanism, for tendons stiff enough.

        Yes also where there is nothing to hold. A no means that this prestress does not; another one might.
        """
        if not self.rank.decided:
            return Stability.UNDECIDED
        return self.on_mechanisms.verdict

    @property
    def stable(self) -> Stability:
        """Whether the shape is a strict minimum of the energy with the given stiffness."""
        return self.on_all.verdict

    @property
    def super_stable(self) -> Stability:
        """Whether the prestress holds the shape for any stiffness and against any motion."""
        return self.for_ever.verdict

    def verify(self, tol: float = _ACCEPTABLE) -> None:
        """Check that the forces balance and that the bases are what they claim.

        Raises
        ------
        EquilibriumError
            With the number that fails.
        """
        self.spaces.verify(max(1e-10, self.rank.tolerance))
        if not self.residual <= tol:
            raise EquilibriumError(
                f"the prestress is out of balance by {self.residual:.1e}, relative; {tol:.0e} is expected."
            )


def stability_orders(
    structure: Structure,
    nodes: Float[np.ndarray, "nodes 3"] | None,
    tensions: Float[np.ndarray, " tendons"],
    rod_forces: Float[np.ndarray, " rods"],
    *,
    stiffness: float | Float[np.ndarray, " tendons"],
    loads: Float[np.ndarray, "nodes 3"] | None = None,
    rank_tol: float | None = None,
) -> StabilityOrders:
    """Judge a prestress at given nodes to first order, second order and for every size of motion.

    Parameters
    ----------
    nodes : (N, 3) m
        None for the structure's own.
    tensions, rod_forces : N
        As `Prestress` or `Equilibrium` has them; rods > 0 in compression.
    stiffness : N/m
        dT/dl: k, or EA/L for constant EA. A slack tendon holds nothing: its stiffness is taken as zero, and for the
        mechanisms it counts as a member all the same.
    loads : (N, 3) N, optional
        Dead loads. They bend no energy themselves; super-stability is not defined under them ("undecided").
    rank_tol : float, optional
        As in `self_stress`, for nodes that are themselves rounded. By default ten times the residual of the forces
        given, up to 1e-6: where these balance to 1e-12 only, so does the self-stress of the nodes.
    """
    matrix = equilibrium_matrix(structure, nodes)
    loads = np.zeros_like(matrix.nodes) if loads is None else np.asarray(loads, float)
    k = np.where(tensions > 0, np.broadcast_to(np.asarray(stiffness, float), tensions.shape), 0.0)
    left = np.linalg.norm(matrix.left_over(tensions, rod_forces, loads), axis=1).max(initial=0.0)
    size = max(np.abs(tensions).max(initial=0.0), np.linalg.norm(loads, axis=1).max(initial=0.0)) or 1.0
    residual = float(left) / float(size)
    spaces = self_stress(structure, nodes, rank_tol=min(10 * residual, 1e-6) if rank_tol is None else rank_tol)
    motions = _keeping_rods(spaces)
    floppy = spaces.mechanisms.reshape(-1, matrix.nodes.size)[:, matrix.free].T
    none = np.zeros(tensions.size)
    return StabilityOrders(
        structure=structure,
        nodes=matrix.nodes,
        tensions=tensions,
        rod_forces=rod_forces,
        stiffness=k,
        spaces=spaces,
        on_mechanisms=_margin(matrix, tensions, rod_forces, none, floppy, 1.0 / spaces.decision.gap),
        on_all=_margin(matrix, tensions, rod_forces, k, motions, 0.0),
        for_ever=super_stability(structure, matrix.nodes, tensions, rod_forces, loaded=bool(loads.any())),
        residual=residual,
    )


def _keeping_rods(spaces: SelfStress) -> Float[np.ndarray, "free k"]:
    """Motions that lengthen no rod, square to rigid-body motions."""
    free = spaces.matrix.free
    basis = rod_motions(spaces.structure, spaces.nodes).left_null
    rigid = spaces.rigid.reshape(-1, spaces.nodes.size)[:, free].T
    inside = basis.T @ rigid
    return basis @ np.linalg.qr(inside, mode="complete")[0][:, inside.shape[1] :]


def _margin(matrix, tensions, rod_forces, k, motions: np.ndarray, blur: float) -> Margin:
    """Smallest eigenvalue and its rounding: the terms' own size times how many add up, and how far motions are blurred.

    Mechanisms are known to 1/gap: rounding mixes that much of the other motions into them.
    """
    if not motions.shape[1]:
        return Margin(np.inf, 0.0)
    form = second_variation(matrix, tensions, rod_forces, k, motions)
    length, rod_length = lengths(matrix.nodes, matrix.structure.tendons), lengths(matrix.nodes, matrix.structure.rods)
    stretch = np.linalg.norm(matrix.tendons.T @ motions, axis=1)
    terms = np.concatenate([k * stretch**2, 4 * np.abs(tensions) / length, 4 * np.abs(rod_forces) / rod_length])
    values = np.linalg.eigvalsh(0.5 * (form + form.T))
    return Margin(float(values[0]), (max(len(motions), 10) * _EPS + 2 * blur) * float(terms.max(initial=0.0)))
