"""Who is asked in turn for the plan of a step whose matrices are new: nothing is set up, nothing is remembered.

First an active set within all tension limits, then with limits that give way, then an interior point, whose time does
not grow with the limits that act, and last the active set without a bound on its iterations.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.qp import QP, Solution
from tensctl.synthesis.qp_daqp import QUICK
from tensctl.synthesis.qp_dense import solve_dense
from tensctl.synthesis.qp_lazy import PATIENT, solve_lazily
from tensctl.synthesis.relaxed import relax


def answer(qp: QP, horizon: int) -> tuple[Float[np.ndarray, " n"], str, float] | None:
    """Plan, status and KKT residual of the first answer that is good enough; None without any."""
    for status, found in _answers(qp, horizon):
        if (z := found.accepted) is not None:
            return z[: qp.f.size], status, found.kkt
    return None


def _answers(qp: QP, horizon: int) -> Iterator[tuple[str, Solution]]:
    """Answers in turn."""
    yield "daqp", solve_lazily(qp, QUICK)
    soft, slacks = relax(qp, horizon), qp.f.size + np.arange(horizon)
    yield "daqp relaxed", solve_lazily(soft, PATIENT, slacks)
    yield "piqp relaxed", solve_dense(soft)
    yield "daqp relaxed", solve_lazily(soft, first=slacks)
