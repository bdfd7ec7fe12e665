"""Who is asked in turn for the plan of a step whose matrices are new: nothing is set up, nothing is remembered.

First a dual active set within all tension limits, then the primal one, with limits that give way, from the last plan on
and with bounded work, then an interior point, and last the dual one without a bound on its iterations.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.qp import QP, Solution
from tensctl.synthesis.qp_daqp import QUICK
from tensctl.synthesis.qp_dense import solve_dense
from tensctl.synthesis.qp_lazy import solve_lazily
from tensctl.synthesis.qp_primal import PrimalSolver
from tensctl.synthesis.relaxed import Relaxed


def answer(qp: QP, horizon: int) -> tuple[Float[np.ndarray, " n"], str, float] | None:
    """Plan, status and KKT residual of the first answer that can be used; None without any."""
    for status, found in _answers(qp, horizon):
        if (z := found.usable) is not None:
            bounded = found.status == "bounded"
            return z[: qp.f.size], status.replace("relaxed", "bounded") if bounded else status, found.kkt
    return None


def _answers(qp: QP, horizon: int) -> Iterator[tuple[str, Solution]]:
    """Answers in turn."""
    yield "daqp", solve_lazily(qp, QUICK)
    soft, slacks = Relaxed.of(qp.H, qp.A, horizon).problem(qp), qp.f.size + np.arange(horizon)
    yield "primal relaxed", PrimalSolver(qp.H, qp.A, horizon, soft=True).solve(soft)
    yield "piqp relaxed", solve_dense(soft)
    yield "daqp relaxed", solve_lazily(soft, first=slacks)
