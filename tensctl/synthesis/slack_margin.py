"""Slack margins: tensions that a step predicts for the next sample, against those that the structure has there.

    T^ = T_ref + C e + D v   one period ahead, of every tendon that has a floor

The linear prediction knows neither pushes nor curvature nor that a slack tendon carries nothing. A plan that keeps a
floor in it and not on the structure is told: prediction and structure part company where a tendon that was predicted to
keep its floor has less than nine tenths of it, or less than half of what was predicted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.condensed import Condensed

# Part of the floor that a tendon may miss. With none every tendon that is held at its floor would be told: on the (3,1)
# mast that grows by a fifth gaps stay below this at 95 steps of 100, and only steps under a push are told.
_SHORT = 0.1
# Part of the predicted tension that has to be there. A gap alone is not told: with stiffnesses 5 % wrong it is above
# half of a floor of 0.1 N at every other step, while no tendon has less than 1.2 N.
_LEFT = 0.5
# Tensions below this part of the largest are rounding.
_ROUNDING = 1e-9
# A floor counts as kept by the prediction when it misses less than this part of it: the accuracy of solvers.
_KEPT = 1e-6


@dataclass(frozen=True)
class Parting:
    """What a sample says of the prediction made for it.

    Attributes
    ----------
    gap : float, N
        Predicted less measured tension of the tendon at which they part, or else of that with the least tension;
        nan without a prediction or a measurement.
    tendon : int
        Index of the tendon at which they part company, -1 where they do not.
    """

    gap: float = np.nan
    tendon: int = -1


def expected(
    problem: Condensed, way: Float[np.ndarray, "nT n"], start: np.ndarray, inputs: np.ndarray,
    margin: Float[np.ndarray, " nT"], floor: float, tendons: int,
) -> Float[np.ndarray, " nt"]:  # fmt: skip
    """Tensions after a stretch of time in which inputs ramp, (nt,) N; nan for tendons without a floor.

    Parameters
    ----------
    way : (nT, nx + 2 nu)
        Scaled tensions then from (e, v) at its beginning and v at its end.
    start : (nx + nu,)
        (e, v) at its beginning.
    inputs : (nu,) m
        v at its end.
    margin : (nT,) m
        Reference tensions within the limits of the problem's rows then, scaled.
    floor : float, N
    tendons : int
        Number of tendons.
    """
    floors = problem.side > 0
    left = (margin + way @ np.concatenate([start, inputs])) * problem.tension_scale
    tensions = np.full(tendons, np.nan)
    tensions[problem.tendons[floors]] = left[floors] + floor
    return tensions


def parting(
    predicted: Float[np.ndarray, " nt"], measured: Float[np.ndarray, " nt"], floor: float,
    noise: Float[np.ndarray, " nt"] | float = 0.0,
) -> Parting:  # fmt: skip
    """Compare predicted with measured tensions.

    Parameters
    ----------
    predicted, measured : (nt,) N
        NaN where there is none.
    floor : float, N
    noise : (nt,) N
        By how much a measurement may be off; gaps below it mean nothing.
    """
    known = np.flatnonzero(np.isfinite(predicted) & np.isfinite(measured))
    if not known.size:
        return Parting()
    told, found = predicted[known], measured[known]
    gap, floor = told - found, max(floor, 0.0)
    sure = gap > (noise[known] if isinstance(noise, np.ndarray) else noise) + _ROUNDING * np.abs(told).max()
    short = (found < (1 - _SHORT) * floor) | (found < _LEFT * told)
    parted = (told >= floor * (1 - _KEPT)) & short & sure
    if not parted.any():
        return Parting(float(gap[found.argmin()]))
    worst = int(np.where(parted, gap, -np.inf).argmax())
    return Parting(float(gap[worst]), int(known[worst]))
