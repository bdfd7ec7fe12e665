"""What a predictive controller says of each of its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# A limit of tension that is passed by less, m of its tendon's elongation, is kept: a solver that saw no solution was
# wrong. Solvers work in metres and miss limits by up to ten times as much (`qp_dual.TOL`); rounding of a metre is
# 1e-16, and would count as giving way with less. Newtons are too few for stiff tendons and too many for soft ones.
KEPT = 1e-11


@dataclass(frozen=True)
class StepRecord:
    """What happened at one control step.

    Attributes
    ----------
    time : float, s
    status : str
        Solver that answered, with " relaxed" when limits of tension gave way, or " bounded" when its work was over
        before the optimum; "fallback" when none answered; or "no measurement".
    solve_time : float, s
    kkt : float
        Recomputed KKT residual (nan without an answer).
    relaxed : float, N
        By how much the worst limit of tension had to give way; 0 when all are kept.
    margin_gap : float, N
        What the step before predicted for this sample, less what there is: of the tendon at which they part company, or
        else of the one with the least tension; nan where there is nothing to compare.
    parted : int
        Index of the tendon at which they part company (`synthesis.slack_margin`), -1 for none.
    """

    time: float
    status: str
    solve_time: float
    kkt: float
    relaxed: float
    margin_gap: float = np.nan
    parted: int = -1


def missing(beyond: Float[np.ndarray, "N nT"], stiffness: Float[np.ndarray, " nT"]) -> float:
    """Tension beyond the worst limit, N, from elongations beyond limits, m, and N/m; 0 where all are kept."""
    return float((np.where(beyond > KEPT, beyond, 0.0) * stiffness).max(initial=0.0))


def told(status: str, relaxed: float) -> tuple[str, float]:
    """Status and relaxation as a record tells them: a solver whose limits give way by nothing keeps them."""
    return (status, relaxed) if relaxed > 0 else (status.removesuffix(" relaxed"), 0.0)
