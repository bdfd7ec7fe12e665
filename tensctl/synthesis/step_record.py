"""What a predictive controller says of each of its steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# A shortfall below this, N, is none: a solver that saw no solution was wrong, and the floors are kept after all.
KEPT = 1e-9


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


def told(status: str, relaxed: float) -> tuple[str, float]:
    """Status and relaxation as a record tells them: a floor that gives way by rounding is kept."""
    return (status.removesuffix(" relaxed"), 0.0) if relaxed <= KEPT else (status, relaxed)
