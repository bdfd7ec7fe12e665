"""The vertex of the largest smallest tension: a solver's answer, then its active set's equations exactly.

At the optimum of "maximise t" some tensions equal t and some their upper bounds. Those equal to t are tied into one
group, those at bounds are fixed, and the rest are as near to the solver's as balance allows: the equations of one
active set (`active_set`). Multipliers do no work with the rest. Whatever is found counts by what it proves itself: the
smallest tension it reaches in balance, and the bound of its multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from tensctl.statics.prestress.active_set import solve_set
from tensctl.statics.prestress.optimum import across, largest_minimum_bound
from tensctl.statics.prestress.program import Balanced, LPSolver, Program, largest_minimum

SOLVERS: tuple[LPSolver, ...] = ("HIGHS", "SCIPY", "CLARABEL")
# How near to a bound a tension must be to count as being there, over the largest: tried from the solvers' tolerance
# downwards and upwards, because no single one suits all; each answer is judged.
_NEAR = (1e-7, 1e-9, 1e-5)
# Balance, bounds and distance to the dual bound where no other solver is asked.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Vertex:
    """Tensions with the largest smallest one, N.

    Attributes
    ----------
    found : Balanced
    reached, bound : float, N
        Smallest tension, and what multipliers say that no tensions can exceed.
    misfit : float
        Largest of force out of balance, tension above its bound, and distance to the dual bound, over the largest
        tension or load.
    """

    found: Balanced
    reached: float
    bound: float
    misfit: float


def largest_vertex(program: Program, cap: float = np.inf) -> Vertex | None:
    """The best of what the solvers find, the first that is the optimum to rounding; None when none finds anything."""
    best: Vertex | None = None
    for solver in SOLVERS:
        rough = largest_minimum(program, solver, cap)
        if rough is None:
            continue
        tries = [rough[1], *(_exact(program, rough[0], rough[1], near) for near in _NEAR)]
        bound, multipliers = min(
            ((largest_minimum_bound(program, one.multipliers, cap), k) for k, one in enumerate(tries)),
        )
        for one in tries:
            vertex = _judged(program, replace(one, multipliers=tries[multipliers].multipliers), bound)
            best = vertex if best is None or vertex.misfit < best.misfit else best
        if best is not None and best.misfit <= _ROUNDING:
            break
    return best


def _exact(program: Program, t: float, rough: Balanced, near: float) -> Balanced:
    tau = (program.tie.T @ rough.tensions) / np.bincount(program.groups, minlength=program.tie.shape[1])
    high, size = program.bounds[1], near * max(np.abs(tau).max(initial=0.0), abs(t))
    least, full = program.acting & (tau - t <= size), high - tau <= size
    merged = np.where(least & ~full, tau.size, np.arange(tau.size))
    names, groups = np.unique(merged[program.groups], return_inverse=True)
    tied = Program(program.matrix, program.loads, program.lower, program.upper, groups)
    wanted = np.append(tau, t)[names]
    fixed = np.where(np.append(full, False)[names], np.append(high, np.nan)[names], np.nan)
    values, c, _ = solve_set(tied, np.ones(names.size), wanted, fixed, np.zeros(program.load.size))
    loose = np.flatnonzero(~least & ~full)
    idle = sp.csr_array(sp.hstack([program.matrix.rods, program.tied[:, loose]]))
    return Balanced(tied.tie @ values, c, across(idle, rough.multipliers))


def _judged(program: Program, found: Balanced, bound: float) -> Vertex:
    reached = float(found.tensions[program.matrix.acting_tendons].min(initial=np.inf))
    size = max(np.abs(found.tensions).max(initial=0.0), np.abs(program.load).max(initial=0.0)) or 1.0
    left = program.matrix.tendons @ found.tensions + program.matrix.rods @ found.rod_forces + program.load
    out = (found.tensions - program.upper).max(initial=0.0)
    worst = max(np.abs(left).max(initial=0.0), out, abs(bound - reached)) / size
    return Vertex(found, reached, bound, float(worst) if np.isfinite(worst) else np.inf)
