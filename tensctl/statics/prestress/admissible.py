"""An admissible prestress: tensions above a floor that balance the loads at given nodes.

    A_t T + A_r c + w = 0,   T >= tension_min,   T <= tension_max

chosen by one of three goals: the largest smallest tension (LP), the least norm, or the nearest to wanted tensions (QP).
The result carries the multipliers of the balance, from which it bounds the optimum itself: `gap` is the distance
between what was found and what duality says is possible, recomputed from structure, nodes and loads.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import EquilibriumError
from tensctl.statics.prestress.choose import ACCEPTABLE, choose_largest, choose_nearest
from tensctl.statics.prestress.groups import Groups, tendon_groups
from tensctl.statics.prestress.matrix import EquilibriumMatrix, equilibrium_matrix
from tensctl.statics.prestress.optimum import largest_minimum_bound, least_squares_gap
from tensctl.statics.prestress.program import Program
from tensctl.structure import Structure
from tensctl.structure.labels import by_label

Goal = Literal["largest minimum", "least norm", "nearest"]
PerTendon = float | dict[str, float] | Float[np.ndarray, " tendons"]


@dataclass(frozen=True, eq=False)
class Prestress:
    """Tensions and rod forces that balance loads at given nodes, within bounds.

    Attributes
    ----------
    structure : Structure
    nodes : (N, 3) m
    loads : (N, 3) N
    lower, upper : (nt,) N
        Bounds asked for; infinity where there are none.
    groups : (nt,) int
        Tendons of one group carry one tension.
    goal : "largest minimum", "least norm" or "nearest"
    weights, wanted : (nt,), (nt,) N
        Goal sum of weights (T - wanted)^2; ignored by "largest minimum".
    tensions : (nt,) N
    rod_forces : (nr,) N, > 0 in compression
    multipliers : (free,)
        Multipliers y of the balance: a virtual motion of the free node components.
    """

    structure: Structure
    nodes: Float[np.ndarray, "nodes 3"]
    loads: Float[np.ndarray, "nodes 3"]
    lower: Float[np.ndarray, " tendons"]
    upper: Float[np.ndarray, " tendons"]
    groups: Int[np.ndarray, " tendons"]
    goal: Goal
    weights: Float[np.ndarray, " tendons"]
    wanted: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    rod_forces: Float[np.ndarray, " rods"]
    multipliers: Float[np.ndarray, " free"]

    @cached_property
    def matrix(self) -> EquilibriumMatrix:
        """The equilibrium matrix, made again from structure and nodes."""
        return equilibrium_matrix(self.structure, self.nodes)

    @property
    def force_densities(self) -> Float[np.ndarray, " tendons"]:
        """Tension over length of each tendon, gamma of [W], N/m."""
        return self.tensions / _length(self.nodes, self.structure.tendons)

    @property
    def rod_force_densities(self) -> Float[np.ndarray, " rods"]:
        """Compression over length of each rod, lambda of [W], N/m."""
        return self.rod_forces / _length(self.nodes, self.structure.rods)

    @property
    def smallest(self) -> float:
        """Smallest tension of a tendon with a free end, N."""
        return float(self.tensions[self.matrix.acting_tendons].min(initial=np.inf))

    @property
    def scale(self) -> float:
        """Largest tension or load, N: what forces are compared with."""
        loads = np.linalg.norm(self.loads, axis=1).max(initial=0.0)
        return float(max(np.abs(self.tensions).max(initial=0.0), loads)) or 1.0

    @property
    def residual(self) -> float:
        """Largest nodal force out of balance over the largest tension or load."""
        left = self.matrix.left_over(self.tensions, self.rod_forces, self.loads)
        return float(np.linalg.norm(left, axis=1).max(initial=0.0)) / self.scale

    @property
    def beyond(self) -> float:
        """Largest violation of a bound or of a tie within a group, over the largest tension or load."""
        out = np.maximum(self.lower - self.tensions, self.tensions - self.upper).max(initial=0.0)
        low, high = np.full(self.tensions.size, np.inf), np.full(self.tensions.size, -np.inf)
        np.minimum.at(low, self.groups, self.tensions)
        np.maximum.at(high, self.groups, self.tensions)
        return float(max(out, (high - low).max(initial=0.0))) / self.scale

    @property
    def gap(self) -> float:
        """Distance to the best that duality allows, relative to the goal's own size; 0 is the proven optimum."""
        if self.goal == "largest minimum":
            return (largest_minimum_bound(self._program, self.multipliers) - self.smallest) / self.scale
        return least_squares_gap(self._program, self.weights, self.wanted, self.tensions, self.multipliers)

    def verify(self, tol: float = ACCEPTABLE) -> None:
        """Check balance, bounds, ties and optimality from the inputs alone.

        Raises
        ------
        EquilibriumError
            With the first check that fails and its number.
        """
        checks = {
            "out of balance": self.residual,
            "beyond a bound or a tie": self.beyond,
            "away from the optimum": self.gap,
        }
        for text, value in checks.items():
            if not value <= tol:
                raise EquilibriumError(
                    f"the prestress is {text} by {value:.1e}, relative; at most {tol:.0e} is expected."
                )

    @cached_property
    def _program(self) -> Program:
        return Program(self.matrix, self.loads, self.lower, self.upper, self.groups)


def admissible_prestress(
    structure: Structure,
    nodes: Float[np.ndarray, "nodes 3"] | None = None,
    *,
    tension_min: PerTendon,
    tension_max: PerTendon = np.inf,
    goal: Goal = "least norm",
    wanted: PerTendon | None = None,
    loads: Float[np.ndarray, "nodes 3"] | None = None,
    groups: Groups | None = None,
) -> Prestress:
    """Choose tensions that hold a structure at given nodes.

    Parameters
    ----------
    nodes : (N, 3) m, optional
        The structure's own by default.
    tension_min, tension_max : number, table by label pattern, or (nt,), N
        The goal "largest minimum" needs an upper bound: without one a self-stress grows without end.
    goal : "largest minimum", "least norm" or "nearest"
        The first maximises the smallest tension; "least norm" and "nearest" minimise |T|^2 or |T - wanted|^2.
    wanted : like tension_min, N
        Tensions that "nearest" goes for.
    loads : (N, 3) N, optional
        Forces on the nodes.
    groups : patterns, table or (nt,) int, optional
        Tendons that carry one tension, as `tendon_groups` takes them; `cyclic_orbits(...).groups` ties the orbits.

    Raises
    ------
    EquilibriumError
        When no tensions fit: what was asked, the largest smallest tension that can be reached, and what to try.
    StructureError
        For labels or groups that do not fit the structure.
    """
    matrix = equilibrium_matrix(structure, nodes)
    labels = structure.tendon_labels
    lower, upper = (per_tendon(v, labels, k) for v, k in ((tension_min, "tension_min"), (tension_max, "tension_max")))
    target = _target(structure, goal, wanted)
    program = Program(matrix, _loads(structure, loads), lower, upper, tendon_groups(structure, groups))
    largest = goal == "largest minimum"
    found = choose_largest(program) if largest else choose_nearest(program, np.ones(lower.size), target)
    return Prestress(
        structure=structure,
        nodes=matrix.nodes,
        loads=program.loads,
        lower=lower,
        upper=upper,
        groups=program.groups,
        goal=goal,
        weights=np.ones(lower.size),
        wanted=target,
        tensions=found.tensions,
        rod_forces=found.rod_forces,
        multipliers=found.multipliers,
    )


def per_tendon(values: PerTendon, labels: tuple[str, ...], key: str) -> Float[np.ndarray, " tendons"]:
    """One number a tendon, from a number, a table by label pattern or an array."""
    if isinstance(values, np.ndarray):
        if values.shape != (len(labels),):
            raise EquilibriumError(
                f"{key} has shape {values.shape}; one number a tendon is expected, ({len(labels)},)."
            )
        return values.astype(float)
    return by_label(labels, values, key)


def _target(structure: Structure, goal: Goal, wanted: PerTendon | None) -> np.ndarray:
    if goal not in ("largest minimum", "least norm", "nearest"):
        raise EquilibriumError(f'goal is "{goal}"; expected "largest minimum", "least norm" or "nearest".')
    if (goal == "nearest") != (wanted is not None):
        raise EquilibriumError('wanted tensions go with the goal "nearest", and only with it.')
    return per_tendon(0.0 if wanted is None else wanted, structure.tendon_labels, "wanted")


def _loads(structure: Structure, loads: np.ndarray | None) -> np.ndarray:
    loads = np.zeros_like(structure.nodes) if loads is None else np.asarray(loads, float)
    if loads.shape != structure.nodes.shape:
        raise EquilibriumError(
            f"loads have shape {loads.shape}; one force a node is expected, {structure.nodes.shape}."
        )
    return loads


def _length(nodes: np.ndarray, members: np.ndarray) -> np.ndarray:
    return np.linalg.norm(nodes[members[:, 1]] - nodes[members[:, 0]], axis=1)
