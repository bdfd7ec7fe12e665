"""Inverse statics: the rest lengths that hold given nodes.

    A_t T + A_r c + w = 0,   T >= tension_min,   L(T) >= floor,   L = l - T/k   or   L = EA l/(EA + T)

The nodes are given, so lengths l are numbers and only tensions are unknown: a convex program. For the least change of
rest lengths it minimises |L(T) - L0|^2, which is weighted least squares for constant k; for constant EA, L bends with
T, and the program is solved again about its own answer until it repeats (Gauss-Newton).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.errors import EquilibriumError
from tensctl.statics.equilibrium import Equilibrium
from tensctl.statics.prestress.admissible import PerTendon, Prestress, per_tendon
from tensctl.statics.prestress.choose import choose_nearest
from tensctl.statics.prestress.groups import Groups, tendon_groups
from tensctl.statics.prestress.law import rest_length_of, tension_of
from tensctl.statics.prestress.matrix import EquilibriumMatrix, equilibrium_matrix
from tensctl.statics.prestress.program import Balanced, Program
from tensctl.structure import Members
from tensctl.structure.structure import lengths

HoldGoal = Literal["rest lengths", "least norm", "nearest"]

_REPEATS = 60
_SAME = 1e-13
# Nodes whose rods differ from the structure's by more than this part of their length are another structure.
_RIGID = 1e-9


@dataclass(frozen=True, eq=False)
class HeldShape:
    """Rest lengths that hold given nodes.

    Attributes
    ----------
    potential : Potential
        Structure, materials and loads.
    prestress : Prestress
        Tensions with their bounds, and the goal that chose them.
    rest_lengths : (nt,) m
    """

    potential: Potential
    prestress: Prestress
    rest_lengths: Float[np.ndarray, " tendons"]

    @property
    def nodes(self) -> Float[np.ndarray, "nodes 3"]:
        """The nodes held, m."""
        return self.prestress.nodes

    @property
    def tensions(self) -> Float[np.ndarray, " tendons"]:
        """Tendon tensions, N."""
        return self.prestress.tensions

    @property
    def rod_forces(self) -> Float[np.ndarray, " rods"]:
        """Rod forces, N, > 0 in compression."""
        return self.prestress.rod_forces

    @property
    def change(self) -> Float[np.ndarray, " tendons"]:
        """Rest-length change u = L0 - L of every tendon, m, > 0 shortens."""
        return self.potential.members.rest_lengths - self.rest_lengths

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """The shape as an equilibrium; its tensions come from the tendon law, not from the program."""
        return Equilibrium(self.potential, self.nodes, self.rest_lengths, 0)

    @property
    def residual(self) -> float:
        """Largest unbalanced nodal force over the largest tension or load, from the tendon law."""
        return self.equilibrium.residual

    def verify(self, tol: float = 1e-9) -> None:
        """Check balance by the tendon law, bounds, rest-length floors and optimality.

        Raises
        ------
        EquilibriumError
            With the first check that fails and its number.
        """
        self.prestress.verify(tol)
        self.equilibrium.verify(tol)
        kept = ~self.potential.structure.grounded_tendons
        short = ((self.potential.members.floors - self.rest_lengths) / self.prestress_lengths)[kept].max(initial=0.0)
        off = np.abs(self.equilibrium.tensions - self.tensions).max(initial=0.0) / self.prestress.scale
        for text, value in (("a rest length is below its floor", short), ("tensions differ from the tendon law", off)):
            if not value <= tol:
                raise EquilibriumError(f"{text} by {value:.1e}, relative; at most {tol:.0e} is expected.")

    @property
    def prestress_lengths(self) -> Float[np.ndarray, " tendons"]:
        """Tendon lengths at the nodes, m."""
        return lengths(self.nodes, self.potential.structure.tendons)


def inverse_statics(
    potential: Potential,
    nodes: Float[np.ndarray, "nodes 3"] | None = None,
    *,
    tension_min: PerTendon,
    tension_max: PerTendon = np.inf,
    goal: HoldGoal = "rest lengths",
    wanted: PerTendon | None = None,
    groups: Groups | None = None,
    actuated_only: bool = False,
) -> HeldShape:
    """Find rest lengths that hold given nodes under the scene's loads.

    Parameters
    ----------
    potential : Potential
        `Potential.of(scene)`, or an equilibrium's.
    nodes : (N, 3) m, optional
        The structure's own by default; rods keep their lengths.
    tension_min, tension_max : number, table by label pattern, or (nt,), N
        Upper bounds are lowered further where the rest length would fall below its floor (`Members.floors`). With a
        floor of 0 N a tendon may be slack; it keeps its rest length where that is long enough.
    goal : "rest lengths", "least norm" or "nearest"
        Least change |L - L0|^2, least |T|^2, or least |T - wanted|^2.
    wanted : like tension_min, N
    groups : optional
        Tendons that carry one tension, as `tendon_groups` takes them.
    actuated_only : bool
        Leave the rest lengths of unactuated tendons as they are.

    Raises
    ------
    EquilibriumError
        When no rest lengths hold the nodes; `nearest_shape` then finds the nearest nodes that can be held.
    """
    structure, members = potential.structure, potential.members
    matrix = equilibrium_matrix(structure, nodes)
    _check_rods(potential, matrix)
    length = lengths(matrix.nodes, structure.tendons)
    labels = structure.tendon_labels
    lower, upper = per_tendon(tension_min, labels, "tension_min"), per_tendon(tension_max, labels, "tension_max")
    upper = np.minimum(upper, tension_of(members, length, members.floors))
    fixed = structure.grounded_tendons | (actuated_only & ~members.actuated)
    lower, upper = _fixed(potential, length, lower, upper, fixed)
    program = Program(matrix, members.forces, lower, upper, tendon_groups(structure, groups))
    found, weights, target = _solve(program, members, length, goal, wanted, labels)
    slack = (found.tensions <= 0) & (members.rest_lengths >= length)
    rest = np.where(fixed | slack, members.rest_lengths, rest_length_of(members, length, found.tensions))
    chosen = Prestress(
        structure=structure,
        nodes=matrix.nodes,
        loads=members.forces,
        lower=lower,
        upper=upper,
        groups=program.groups,
        goal="nearest",
        weights=weights,
        wanted=target,
        tensions=found.tensions,
        rod_forces=found.rod_forces,
        multipliers=found.multipliers,
    )
    return HeldShape(potential, chosen, rest)


def _check_rods(potential: Potential, matrix: EquilibriumMatrix) -> None:
    structure = potential.structure
    off = np.abs(lengths(matrix.nodes, structure.rods) / structure.rod_lengths - 1.0)
    if off.max(initial=0.0) > _RIGID:
        r = int(off.argmax())
        raise EquilibriumError(
            f"rod {structure.rod_labels[r]} is {structure.rod_lengths[r]:.6g} m long but "
            f"{lengths(matrix.nodes, structure.rods)[r]:.6g} m at the given nodes; rods are rigid, so give nodes that "
            "keep their lengths (nearest_shape takes any nodes)."
        )
    moved = np.abs(matrix.nodes - structure.nodes)[structure.pinned].max(initial=0.0)
    if moved > _RIGID * np.ptp(structure.nodes, axis=0).max(initial=0.0):
        raise EquilibriumError(
            f"the given nodes move a pinned node by {moved:.3g} m; leave pinned nodes where they are."
        )


def _fixed(
    potential: Potential, length: np.ndarray, lower: np.ndarray, upper: np.ndarray, fixed: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Bounds where tendons that keep their rest length carry what the law gives."""
    structure, members = potential.structure, potential.members
    carried = np.maximum(tension_of(members, length, members.rest_lengths), 0.0)
    low = fixed & (carried < lower) & ~structure.grounded_tendons
    if low.any():
        t = int(low.argmax())
        raise EquilibriumError(
            f"tendon {structure.tendon_labels[t]} has no actuator and carries {carried[t]:.4g} N at these nodes, below "
            f"tension_min = {lower[t]:.4g} N; give it an actuator, another rest length or a lower floor."
        )
    return np.where(fixed, carried, lower), np.where(fixed, carried, upper)


def _solve(
    program: Program, members: Members, length: np.ndarray, goal: HoldGoal, wanted: PerTendon | None, labels
) -> tuple[Balanced, np.ndarray, np.ndarray]:
    if (goal == "nearest") != (wanted is not None):
        raise EquilibriumError('wanted tensions go with the goal "nearest", and only with it.')
    ones = np.ones(length.size)
    if goal == "least norm" or wanted is not None:
        target = per_tendon(0.0 if wanted is None else wanted, labels, "wanted")
        return choose_nearest(program, ones, target), ones, target
    if goal != "rest lengths":
        raise EquilibriumError(f'goal is "{goal}"; expected "rest lengths", "least norm" or "nearest".')
    return _least_change(program, members, length)


def _least_change(program: Program, members: Members, length: np.ndarray) -> tuple[Balanced, np.ndarray, np.ndarray]:
    """Least |L(T) - L0|^2: about T_i, L - L0 = -s (T - g) with s = -dL/dT and g = T_i + (L_i - L0)/s."""
    # From the tensions that the program asks for at L0: without bending this is already the exact statement.
    tensions = np.clip(np.maximum(tension_of(members, length, members.rest_lengths), 0.0), program.lower, program.upper)
    for _ in range(_REPEATS):
        k = members.stiffness
        slope = 1.0 / k if members.law == "k" else k * length / (k + tensions) ** 2
        target = tensions + (rest_length_of(members, length, tensions) - members.rest_lengths) / slope
        weights = (slope / slope.max(initial=0.0)) ** 2
        found = choose_nearest(program, weights, target)
        moved = np.abs(found.tensions - tensions).max(initial=0.0)
        tensions = found.tensions
        if members.law == "k" or moved <= _SAME * np.abs(tensions).max(initial=0.0):
            return found, weights, target
    raise EquilibriumError(
        f"the least rest-length change did not settle in {_REPEATS} rounds; strains are very large: "
        'use the goal "least norm" or "nearest".'
    )
