"""What a model holds and what was left out, with the operations that each term costs or would have cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.elements import Hold, Potential, tendon_tension
from tensctl.model.constraints import Constraints
from tensctl.structure import Structure


@dataclass(frozen=True)
class Term:
    """One term of the model.

    Attributes
    ----------
    name : str
    included : bool
    why : str
    operations : int or None
        Floating-point operations of one right-hand side that the term costs, or would have cost.
    """

    name: str
    included: bool
    why: str
    operations: int | None


def explain(potential: Potential, damping: np.ndarray, drag: float, constraints: Constraints) -> tuple[Term, ...]:
    """List each term of a scene's model, in or out, and why."""
    structure, members = potential.structure, potential.members
    hold = potential.manifold.hold
    tendons, nodes = len(structure.tendons), len(structure.nodes)
    elastic = tendon_tension(members.law, damped=False).n_instructions()
    damper = tendon_tension(members.law, damped=True).n_instructions() - elastic
    damped = int((damping > 0).sum())
    held = int(np.isin(hold, (Hold.TAIL, Hold.HEAD)).sum())
    grounded = structure.tendon_labels, structure.grounded_tendons
    idle = [label for label, out in zip(*grounded, strict=True) if out]
    loaded = bool(members.forces.any())
    return (
        Term("tendons", True, f"{_tendons(structure)}, law {members.law}, slack when short", tendons * elastic),
        _term("dampers", damped, f"{damped} tendons are damped", "no damping is asked for", damper * tendons),
        _term("drag", drag > 0, f"{drag:g} N s/m on each rod end", "no drag is asked for", 6 * nodes),
        _term("weight and loads", loaded, "constant nodal forces", "no gravity, no loads", 3 * nodes),
        _term(
            "disturbance input w",
            members.pushed.size,
            f"{members.pushed.size} nodes are pushed",
            "no push is asked for",
            3 * max(1, int(members.pushed.size)),
        ),
        _term("rods turning about a pin", held, f"{held} rods", "no rod has exactly one end pinned", 30 * max(held, 1)),
        Term(
            "third dimension",
            not structure.planar,
            "all nodes are in a plane and stay there" if structure.planar else "nodes move in space",
            None,
        ),
        Term("mass matrix", False, "accelerations are explicit in rod-end coordinates", None),
        _term(
            "multipliers",
            constraints.first.size,
            f"{constraints.first.size} rows tie rod ends to each other or to the ground",
            "no joint, no guide, and rod lengths hold by themselves",
            _factor_operations(constraints),
        ),
        _term(
            "actuator lag",
            members.lag > 0,
            f"rest lengths follow commands with {members.lag:g} s, exactly, as a state of controllers only",
            "no lag is asked for",
            4 * int(members.inputs.size),
        ),
        Term(
            "inputs",
            True,
            f"{members.inputs.size} of {tendons} tendons"
            + ("" if members.gearing.plain else f" by {members.gearing.size} motors")
            + (f"; between two pinned nodes, so no input: {', '.join(idle)}" if idle else "")
            + _unactuated(potential),
            None,
        ),
    )


def _term(name: str, included: bool | int | np.integer, why: str, why_not: str, operations: int) -> Term:
    return Term(name, bool(included), why if included else why_not, operations)


def _factor_operations(constraints: Constraints) -> int:
    """Operations of one factor within its profile and one solve; those of a single joint when there is none."""
    lengths = np.diff(constraints.place) if constraints.first.size else np.array([1, 2, 3])
    return int((lengths**2 + 4 * lengths).sum())


def _tendons(structure: Structure) -> str:
    tendons, cables = len(structure.tendons), sum(1 for via in structure.vias if via)
    pieces = len(structure.segments) - tendons + cables
    return f"{tendons} tendons" + (f", {cables} of them cables with {pieces} segments" if cables else "")


def _unactuated(potential: Potential) -> str:
    out = int((~potential.members.actuated).sum())
    return f"; {out} tendons have no actuator" if out else ""


def as_table(terms: tuple[Term, ...]) -> str:
    """The terms as aligned plain text."""
    rows = [("term", "in", "operations", "why")]
    rows += [(t.name, "yes" if t.included else "no", str(t.operations or ""), t.why) for t in terms]
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    return "\n".join("  ".join([*(row[k].ljust(widths[k]) for k in range(3)), row[3]]).rstrip() for row in rows)
