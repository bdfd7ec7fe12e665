"""From any start to the optimum's last digit: Newton steps on the dual function, each a set of active bounds.

At the optimum of 1/2 sum a (tau - g)^2 each group's tension is tau = clip(g - (B'y)/a) with B = A_t G, so y alone says
which bounds are active, and y maximises the concave, piecewise quadratic dual function of `program`. The equations of
one active set (`active_set`) give the maximum of one piece:

- the full step to it, and the set that its y says, until the set repeats (primal-dual active sets: Hintermueller, Ito
  and Kunisch 2003, doi 10.1137/S1052623401383558);
- where full steps run in a circle, the best point on the way to each piece's maximum, from the start again: a step that
  always rises.

Where the dual function rises without end, the direction y is a proof that no tensions fit. Answers are compared by
balance, bounds and multipliers together: a feasible point alone may be far from the optimum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tensctl.statics.prestress.active_set import solve_set
from tensctl.statics.prestress.optimum import across
from tensctl.statics.prestress.program import Balanced, Program

# From eight digits one or two do; without a start the set settles in ten or goes in circles.
_FULL_STEPS = 10
# Each ends on a higher one of finitely many pieces; from nothing 76 were the most for 104 tendons.
_RISING_STEPS = 400
# Where a tension touches its bound without being pressed, rounding says which side it is on and the set need not
# repeat; both sets are then the optimum to this part of the largest tension.
_ROUNDING = 1e-13
# A set whose equations contradict each other repeats too, with multipliers that run away; nodes that settled to 1e-12
# do so by less than this part of the largest tension.
_CONSISTENT = 1e-9


@dataclass(frozen=True, eq=False)
class Polished:
    """The best answer seen.

    Attributes
    ----------
    found : Balanced
    misfit : float
        `misfit` of it.
    settled : bool
        Whether the multipliers say the very set that they were solved for, or the misfit is rounding.
    ray : (free,), optional
        Multipliers along which the dual function rises without end; to be proven by `contradiction`.
    """

    found: Balanced
    misfit: float
    settled: bool
    ray: Float[np.ndarray, " free"] | None = None


def misfit(program: Program, weights: np.ndarray, target: np.ndarray, found: Balanced) -> float:
    """How far an answer is from the conditions of the optimum, over its largest tension or load.

    The largest of: force out of balance, tension out of bounds, and tension that is not what the multipliers say. The
    distance of the tensions from the optimum is linear in it, while it would be the root of the goal's distance.
    """
    weight, wanted = program.quadratic(weights, target)
    low, high = program.bounds
    tau = (program.tie.T @ found.tensions) / np.bincount(program.groups, minlength=weight.size)
    size = max(np.abs(tau).max(initial=0.0), np.abs(program.load).max(initial=0.0)) or 1.0
    left = program.tied @ tau + program.matrix.rods @ found.rod_forces + program.load
    out = np.maximum(low - tau, tau - high)
    off = tau - np.clip(wanted - (program.tied.T @ found.multipliers) / weight, low, high)
    worst = max(np.abs(left).max(initial=0.0), out.max(initial=0.0), np.abs(off).max(initial=0.0))
    return float(worst) / size if np.isfinite(worst) else np.inf


def polish(program: Program, weights: np.ndarray, target: np.ndarray, rough: Balanced) -> Polished:
    """The optimum to rounding, started from the multipliers of a rough answer, which may be zero."""
    rods = program.matrix.rods
    weight, wanted = program.quadratic(weights, target)
    y = start = across(rods, rough.multipliers)
    best = Polished(rough, misfit(program, weights, target, rough), settled=False)
    for _ in range(_FULL_STEPS):
        piece = _piece(program, weights, target, y, y)
        best = _better(best, piece)
        if best.settled:
            return _with_least_multipliers(program, weights, target, best)
        y = piece.found.multipliers
    y = start
    for _ in range(_RISING_STEPS):
        piece = _piece(program, weights, target, y, y)
        best = _better(best, piece)
        if best.settled:
            return _with_least_multipliers(program, weights, target, best)
        towards = across(rods, piece.found.multipliers - y)
        step = highest(program, weight, wanted, y, towards)
        if step == np.inf:
            return replace(best, ray=towards)
        if not step > 0:
            break
        y = y + step * towards
    return best


def _piece(program: Program, weights: np.ndarray, target: np.ndarray, y: np.ndarray, near: np.ndarray) -> Polished:
    weight, wanted = program.quadratic(weights, target)
    fixed = active(program, weight, wanted, y)
    tau, c, top = solve_set(program, weight, wanted, fixed, near)
    found = Balanced(program.tie @ tau, c, top)
    same = np.array_equal(active(program, weight, wanted, top), fixed, equal_nan=True)
    value = misfit(program, weights, target, found)
    return Polished(found, value, same and value <= _CONSISTENT)


def _with_least_multipliers(program: Program, weights: np.ndarray, target: np.ndarray, best: Polished) -> Polished:
    """The same set with the least y that fits: the distance to the dual bound has y times what is out of balance."""
    y = best.found.multipliers
    least = _piece(program, weights, target, y, np.zeros_like(y))
    return least if least.settled and least.misfit <= max(best.misfit, _ROUNDING) else best


def _better(one: Polished, other: Polished) -> Polished:
    best = other if other.misfit < one.misfit else one
    return replace(best, settled=other.settled or best.misfit <= _ROUNDING)


def active(program: Program, weight: np.ndarray, wanted: np.ndarray, y: np.ndarray) -> Float[np.ndarray, " groups"]:
    """The bound where the multipliers press a tension against it, NaN elsewhere."""
    low, high = program.bounds
    free = wanted - (program.tied.T @ y) / weight
    return np.where(free <= low, low, np.where(free >= high, high, np.nan))


def highest(program: Program, weight: np.ndarray, wanted: np.ndarray, y: np.ndarray, towards: np.ndarray) -> float:
    """Where the dual function is largest on the way y + s towards, s >= 0; infinity where it rises without end.

    Its slope w.d + sum (B'd) clip(g - B'(y + s d)/a) falls with s and is linear between the points where a tension
    meets a bound, so the zero lies between two neighbours of them.
    """
    low, high = program.bounds
    free, rate = wanted - (program.tied.T @ y) / weight, -(program.tied.T @ towards) / weight
    work = float(program.load @ towards)

    def slope(s: float) -> float:
        return work - float((weight * rate) @ np.clip(free + s * rate, low, high))

    with np.errstate(divide="ignore", invalid="ignore"):
        meets = np.concatenate([(low - free) / rate, (high - free) / rate])
    meets = np.unique(meets[np.isfinite(meets) & (meets > 0)])
    if slope(0.0) <= 0:
        return 0.0
    before, after = 0, meets.size
    while before < after:
        middle = (before + after) // 2
        before, after = (middle + 1, after) if slope(meets[middle]) > 0 else (before, middle)
    start = float(meets[before - 1]) if before else 0.0
    end = float(meets[before]) if before < meets.size else 2 * start + 1.0
    first, last = slope(start), slope(end)
    if before == meets.size and first - last <= 1e-12 * abs(first):
        return np.inf
    return start + (end - start) * first / (first - last)
