"""Which tendons to pull to move a node: least rest-length change, or fewest tendons, from static influence.

    dp = J K^-1 G u,   dT = dT/dl dl + dT/du u,   T + dT >= tension_min,   L0 - u >= floor

First order about the equilibrium; `Move.settled` is the equilibrium that the full structure finds with these rest
lengths, and `Move.bend` how far its node is from the promised place: it falls with the square of the move.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.analysis.least_change import Wanted, fewest, least_norm, optimality
from tensctl.errors import EquilibriumError
from tensctl.linear import LinearModel, best_fit
from tensctl.statics import Equilibrium, settle, static_influence, tension_influence
from tensctl.structure import matches

MoveGoal = Literal["least change", "fewest tendons"]
# Components of a wanted motion below this part of it count as nothing.
_NOTHING = 1e-9


@dataclass(frozen=True, eq=False)
class Move:
    """Rest-length changes that move a node, and what else they do.

    Attributes
    ----------
    equilibrium : Equilibrium
    node : int
    by : (3,) m
        What was asked.
    goal : "least change" or "fewest tendons"
    how : str
        What found it.
    program : Wanted
    inputs : (nu,) m
        Change of u of each acting tendon, > 0 shortens.
    """

    equilibrium: Equilibrium
    node: int
    by: Float[np.ndarray, " 3"]
    goal: MoveGoal
    how: str
    program: Wanted
    inputs: Float[np.ndarray, " nu"]

    @cached_property
    def displacements(self) -> Float[np.ndarray, "nodes 3"]:
        """First-order motion of every node, m; of a free structure within its own frame."""
        rest = self.equilibrium
        return (rest.point.tangent @ (static_influence(rest) @ self.inputs)).reshape(-1, 3)

    @cached_property
    def tension_changes(self) -> Float[np.ndarray, " tendons"]:
        """First-order change of every tension, N."""
        return tension_influence(self.equilibrium) @ self.inputs

    @property
    def reached(self) -> Float[np.ndarray, " 3"]:
        """How the node moves, to first order, m."""
        return self.displacements[self.node]

    @property
    def residual(self) -> Float[np.ndarray, " 3"]:
        """Part of the wanted motion that is not reached, m."""
        return self.by - self.reached

    @property
    def arrives(self) -> bool:
        """Whether the node gets where it should, to first order."""
        return bool(np.linalg.norm(self.residual) <= 1e-6 * np.linalg.norm(self.by))

    @property
    def tendons(self) -> tuple[tuple[str, float], ...]:
        """Tendons, or gangs by name, to pull (> 0) or let out, m, largest first."""
        labels, size = self.equilibrium.potential.members.gearing.labels, np.abs(self.inputs).max(initial=0.0)
        order = [k for k in np.argsort(-np.abs(self.inputs), kind="stable") if abs(self.inputs[k]) > _NOTHING * size]
        return tuple((labels[k], float(self.inputs[k])) for k in order)

    @cached_property
    def settled(self) -> Equilibrium:
        """Where the whole structure rests with these rest lengths."""
        rest = self.equilibrium
        return settle(rest.potential, start=rest.nodes, inputs=rest.inputs + self.inputs)

    @property
    def bend(self) -> float:
        """Distance of the settled node from its first-order place, m."""
        rest, nodes = self.equilibrium, self.settled.nodes
        if not rest.structure.held.any():
            nodes = best_fit(rest.potential, rest.nodes, nodes, np.zeros_like(nodes)).nodes(nodes)
        return float(np.linalg.norm(nodes[self.node] - rest.nodes[self.node] - self.reached))

    @property
    def optimality(self) -> float:
        """What is left of the optimality conditions, relative: of all inputs, or of the chosen few."""
        chosen = np.flatnonzero(self.inputs) if self.goal == "fewest tendons" else np.arange(self.inputs.size)
        return optimality(self.program.only(chosen), self.inputs[chosen])

    def verify(self, tol: float = 1e-6) -> None:
        """Check bounds and optimality from influence alone.

        Raises
        ------
        EquilibriumError
            With the condition that fails.
        """
        if not self.program.keeps(self.inputs):
            raise EquilibriumError("the rest-length changes break a tension floor or a rest-length floor.")
        if not self.optimality <= tol:
            raise EquilibriumError(
                f"the rest-length changes are not the least: {self.optimality:.1e} of the optimality conditions is "
                "left over."
            )

    def __str__(self) -> str:
        """The answer in sentences."""
        label, structure = self.equilibrium.structure.node_labels[self.node], self.equilibrium.structure
        pulls = ", ".join(f"{name} {1e3 * value:+.3g}" for name, value in self.tendons[:12])
        lines = [
            f"move {label} by ({', '.join(f'{1e3 * x:g}' for x in self.by)}) mm, {self.goal} ({self.how}):",
            f"  shorten (+) or let out (-) {len(self.tendons)} of {self.inputs.size} tendons, mm: {pulls or 'none'}"
            + (", ..." if len(self.tendons) > 12 else ""),
        ]
        if not self.arrives:
            missing = ", ".join(f"{1e3 * x:.3g}" for x in self.residual)
            lines.append(f"  not reached: ({missing}) mm")
        others = np.linalg.norm(self.displacements, axis=1)
        others[self.node] = 0.0
        also = [k for k in np.argsort(-others, kind="stable")[:3] if others[k] > 0]
        lines.append(
            "  also moves, mm: " + ", ".join(f"{structure.node_labels[k]} {1e3 * others[k]:.3g}" for k in also)
        )
        after = (self.equilibrium.tensions + self.tension_changes)[~structure.grounded_tendons]
        lines.append(
            f"  tensions change by {self.tension_changes.min():+.3g} to {self.tension_changes.max():+.3g} N; "
            f"lowest afterwards {after.min():.3g} N"
        )
        return "\n".join(lines)


def move(
    where: Equilibrium | LinearModel,
    node: str,
    by: tuple[float, float, float] | Float[np.ndarray, " 3"],
    *,
    tension_min: float = 0.0,
    goal: MoveGoal = "least change",
    weights: Float[np.ndarray, " nu"] | None = None,
) -> Move:
    """Find rest-length changes that move a node.

    Parameters
    ----------
    where : Equilibrium or LinearModel
        A free structure's node moves within the frame of the structure: rigid-body motion takes no tendon.
    node : str
        Label.
    by : (3,) m
    tension_min : float, N
        Floor of every tendon that is taut at the equilibrium.
    goal : "least change" or "fewest tendons"
        Least sum of w u^2, or least number of tendons: exact up to 60 inputs, by the 1-norm beyond (`Move.how`).
    weights : (nu,), optional
        w of each acting tendon; 1 by default.

    Raises
    ------
    EquilibriumError
        For a node or direction that is held, a motion without stiffness, or bounds that nothing keeps.
    """
    rest = where.equilibrium if isinstance(where, LinearModel) else where
    structure = rest.structure
    if goal not in ("least change", "fewest tendons"):
        raise EquilibriumError(f'goal is "{goal}"; expected "least change" or "fewest tendons".')
    wanted = np.asarray(by, float)
    if wanted.shape != (3,) or not np.isfinite(wanted).all():
        raise EquilibriumError(f"by is {by}; expected three finite numbers, m.")
    found = matches(structure.node_labels, node, "node")
    if len(found) != 1:
        raise EquilibriumError(f'node "{node}" names {len(found)} nodes; name one.')
    at = int(found[0])
    if (~structure.free[at] & (wanted != 0)).any():
        raise EquilibriumError(f"the ground holds node {node} in a direction in which it should move.")
    program = _program(rest, at, wanted, tension_min, weights)
    if goal == "least change":
        inputs, how = least_norm(program), "2-norm"
    else:
        inputs, how = fewest(program)
    return Move(rest, at, wanted, goal, how, program, inputs)


def _program(rest: Equilibrium, at: int, by: np.ndarray, tension_min: float, weights: np.ndarray | None) -> Wanted:
    members, count = rest.potential.members, rest.potential.members.gearing.size
    reach = static_influence(rest)
    tension = tension_influence(rest, reach)
    floored = (rest.tensions > 0) & ~rest.structure.grounded_tendons
    room = (rest.rest_lengths - members.floors)[members.inputs]
    w = np.ones(count) if weights is None else np.asarray(weights, float)
    if w.shape != (count,) or not (w > 0).all():
        raise EquilibriumError(f"weights have shape {w.shape}; expected one number > 0 for each of {count} inputs.")
    return Wanted(
        S=(rest.point.tangent @ reach).reshape(-1, 3, count)[at][rest.structure.free[at]],
        effect=by[rest.structure.free[at]],
        A=np.vstack([-tension[floored], members.gearing.matrix.toarray()]),
        b=np.concatenate([rest.tensions[floored] - tension_min, room]),
        weights=w,
    )
