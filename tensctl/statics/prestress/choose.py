"""Choosing tensions: solve, polish, and judge by balance, bounds and multipliers, never by a solver's word.

A program is refused only with a proof, which is recomputed from its own numbers. Where neither tensions nor a proof are
found, that is what the error says.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.prestress.infeasible import explain
from tensctl.statics.prestress.optimum import contradiction, least_squares_gap, load_left_over
from tensctl.statics.prestress.polish import Polished, polish
from tensctl.statics.prestress.program import (
    Balanced,
    LPSolver,
    Program,
    QPSolver,
    least_squares,
    least_violation,
)
from tensctl.statics.prestress.vertex import SOLVERS, Vertex, largest_vertex

# Over the largest tension or load. Polished answers are at 1e-15; nodes that are settled balance to 1e-12 at best.
ACCEPTABLE = 1e-9
# Asked in this order until an answer settles.
QP_SOLVERS: tuple[QPSolver, ...] = ("CLARABEL", "OSQP", "SCS")


def choose_nearest(
    program: Program, weights: Float[np.ndarray, " tendons"], target: Float[np.ndarray, " tendons"]
) -> Balanced:
    """Least weighted squares of T - target within the program's bounds, to rounding.

    Raises
    ------
    EquilibriumError
        When no tensions fit: what was asked, what is possible, what to try.
    """
    if (program.bounds[0] > program.bounds[1]).any():
        raise EquilibriumError(explain(program))
    best: Polished | None = None
    for rough in _starts(program, weights, target):
        polished = polish(program, weights, target, rough)
        best = polished if best is None or polished.misfit < best.misfit else best
        if best.settled and _acceptable(program, weights, target, best.found):
            return best.found
        if polished.ray is not None and contradiction(program, polished.ray) > ACCEPTABLE:
            raise EquilibriumError(explain(program))
    if best is not None and _acceptable(program, weights, target, best.found):
        return best.found
    raise EquilibriumError(explain(program) if excluded(program) else _undecided(best))


def choose_largest(program: Program) -> Balanced:
    """Largest smallest tension under the program's upper bounds.

    Raises
    ------
    EquilibriumError
        Without upper bounds, or when the largest smallest tension is below the program's floor.
    """
    acting = program.matrix.acting_tendons
    if not np.isfinite(program.upper[acting]).all():
        raise EquilibriumError(
            'the goal "largest minimum" without tension_max has no end: a self-stress can be scaled up for ever; '
            "give tension_max, N."
        )
    vertex = largest_vertex(program)
    floor = program.lower[acting].max(initial=-np.inf)
    enough = floor - ACCEPTABLE * abs(floor)
    if vertex is not None and vertex.misfit <= ACCEPTABLE and vertex.reached >= enough:
        return vertex.found
    if (vertex is not None and vertex.bound < enough) or excluded(program):
        raise EquilibriumError(explain(program))
    raise EquilibriumError(_undecided(vertex))


def excluded(program: Program, solvers: tuple[LPSolver, ...] = SOLVERS) -> bool:
    """Whether multipliers prove that no tensions fit: the loads' own, or those of the least violation of the bounds."""
    if contradiction(program, load_left_over(program)) > ACCEPTABLE:
        return True
    found = (least_violation(program, solver) for solver in solvers)
    return any(y is not None and contradiction(program, y) > ACCEPTABLE for y in found)


def _starts(program: Program, weights: np.ndarray, target: np.ndarray) -> Iterator[Balanced]:
    """What each solver finds, the one with the most digits first; after it no multipliers at all, which needs none."""
    nothing = Balanced(np.zeros(weights.size), np.zeros(program.matrix.rods.shape[1]), np.zeros(program.load.size))
    for solver in QP_SOLVERS:
        rough = least_squares(program, weights, target, solver)
        if rough is not None:
            yield rough
        if solver == QP_SOLVERS[0]:
            yield nothing


def _acceptable(program: Program, weights: np.ndarray, target: np.ndarray, found: Balanced) -> bool:
    size = max(np.abs(found.tensions).max(initial=0.0), np.abs(program.load).max(initial=0.0)) or 1.0
    left = program.matrix.tendons @ found.tensions + program.matrix.rods @ found.rod_forces + program.load
    out = np.maximum(program.lower - found.tensions, found.tensions - program.upper)
    gap = least_squares_gap(program, weights, target, found.tensions, found.multipliers)
    return bool(max(np.abs(left).max(initial=0.0), out.max(initial=0.0)) <= ACCEPTABLE * size and gap <= ACCEPTABLE)


def _undecided(best: Polished | Vertex | None) -> str:
    nearest = "none came near" if best is None else f"the best misses by {best.misfit:.1e} of its largest tension"
    return (
        f"whether tensions fit these bounds is not decided: no solver found any ({nearest}, at most "
        f"{ACCEPTABLE:.0e} is expected), and none proved that there are none; "
        "relax the bounds a little, or settle the nodes first."
    )
