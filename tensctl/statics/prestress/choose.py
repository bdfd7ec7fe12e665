"""Choosing tensions: solve, polish, and judge by balance and bounds, never by the solver's word."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.prestress.infeasible import explain
from tensctl.statics.prestress.polish import polish
from tensctl.statics.prestress.program import Balanced, Program, largest_minimum, least_squares

# Solvers stop at about 1e-8 of the largest tension where the active set does not settle; after polishing 1e-15.
ACCEPTABLE = 1e-9


def choose_nearest(
    program: Program, weights: Float[np.ndarray, " tendons"], target: Float[np.ndarray, " tendons"]
) -> Balanced:
    """Least weighted squares of T - target within the program's bounds, to rounding.

    Raises
    ------
    EquilibriumError
        When no tensions fit: what was asked, what is possible, what to try.
    """
    rough = least_squares(program, weights, target)
    if rough is None:
        raise EquilibriumError(explain(program))
    found = polish(program, weights, target, rough)
    size = max(np.abs(found.tensions).max(initial=0.0), np.abs(program.load).max(initial=0.0)) or 1.0
    left = np.abs(program.matrix.tendons @ found.tensions + program.matrix.rods @ found.rod_forces + program.load)
    out = np.maximum(program.lower - found.tensions, found.tensions - program.upper)
    if max(left.max(initial=0.0), out.max(initial=0.0)) > ACCEPTABLE * size:
        raise EquilibriumError(explain(program))
    return found


def choose_largest(program: Program) -> Balanced:
    """Largest smallest tension under the program's upper bounds.

    Raises
    ------
    EquilibriumError
        Without upper bounds, or when the largest smallest tension is below the program's floor.
    """
    if not np.isfinite(program.upper[program.matrix.acting_tendons]).all():
        raise EquilibriumError(
            'the goal "largest minimum" without tension_max has no end: a self-stress can be scaled up for ever; '
            "give tension_max, N."
        )
    found = largest_minimum(program)
    floor = program.lower[program.matrix.acting_tendons].max(initial=-np.inf)
    if found is None or found[0] < floor - ACCEPTABLE * abs(floor):
        raise EquilibriumError(explain(program))
    return found[1]
