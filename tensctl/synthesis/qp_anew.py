"""Who is asked in turn for the plan of a step whose matrices are new: nothing is set up, nothing is remembered.

First a dual active set within all tension limits, then the primal one, with limits that give way, from the last plan on
and with bounded work, then an interior point, and last the dual one without a bound on its iterations. What a search
had when its work was over is the answer only where nobody finds a better one, or nobody else is asked, since there are
too many variables for the time of a step.

Where an optimum gives way it is asked whether it has to: by one more search from there, at a price that only the
impossible is worth, and where that leaves it open by the dual active set with time enough.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.qp import QP, Solution
from tensctl.synthesis.qp_daqp import QUICK
from tensctl.synthesis.qp_dense import solve_dense
from tensctl.synthesis.qp_lazy import solve_lazily
from tensctl.synthesis.qp_primal import PrimalSolver, bounds
from tensctl.synthesis.relaxed import DEAR, Relaxed

# Work of a primal search over that which the linear controller allows, whose steps have less time. With 1 it ended
# before the optimum in 37 of 156 steps at the edge of what floors allow and with 10 in 3, for some 5 ms more; first
# commands were off by up to all that a period allows.
PATIENCE = 10.0
# Up to so many variables an interior point follows a search whose work was over: it takes 0.3 s at most.
FEW = 500
# Iterations in a round of the dual active set that tells whether floors have to give way; 750 were seen.
ENOUGH = 2000


def answer(qp: QP, horizon: int) -> tuple[Float[np.ndarray, " n"], str, float] | None:
    """Plan, status and KKT residual of the first answer that can be used; None without any."""
    within = solve_lazily(qp, QUICK)
    if within.usable is not None:
        return within.usable, "daqp", within.kkt
    relaxed, work = Relaxed.of(qp.H, qp.A, horizon), PATIENCE * bounds(qp.f.size, horizon)[0]
    searching = PrimalSolver(qp.H, qp.A, horizon, soft=True, work=work)
    unfinished = None
    for name, found in _giving_way(relaxed.problem(qp), horizon, searching):
        if (z := found.usable) is None:
            continue
        plan, slacks = np.split(z, [qp.f.size])
        if found.status == "bounded":
            unfinished = plan, f"{name} bounded", found.kkt
            if qp.f.size > FEW:
                break
            continue
        if slacks.any():
            dear = relaxed.problem(qp, DEAR)
            for keeper, kept in _keeping(qp, dear, plan, searching, known=within.status == "infeasible"):
                if kept.status == "solved" and kept.accepted is not None:
                    return kept.accepted, keeper, kept.kkt
        return plan, f"{name} relaxed", found.kkt
    return unfinished


def _giving_way(soft: QP, horizon: int, searching: PrimalSolver) -> Iterator[tuple[str, Solution]]:
    """Answers in turn."""
    yield "primal", searching.solve(soft)
    yield "piqp", solve_dense(soft)
    yield "daqp", solve_lazily(soft, first=soft.f.size - horizon + np.arange(horizon))


def _keeping(
    qp: QP, dear: QP, plan: Float[np.ndarray, " n"], searching: PrimalSolver, *, known: bool
) -> Iterator[tuple[str, Solution]]:
    """Answers in turn that keep all limits, from a plan that does not; where it is known there is none, one tries."""
    yield "primal", searching.keep(qp, dear, plan)
    if not known:
        yield "daqp", solve_lazily(qp, ENOUGH)
