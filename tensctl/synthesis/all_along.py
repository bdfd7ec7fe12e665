"""Planned shapes for limits that hold all along the way: where a way between two lacks some, both keep that much more.

    limits of shape k   <-   what it has + _MORE * what the ways beside it lack

Shapes are planned apart from each other, each by the least change of rest lengths, and a spline through them cuts
corners where a limit begins to act; inertia adds to tensions and rest lengths. A plan is therefore looked over
(`synthesis.way`) and made again from itself, until no way lacks anything: first as if it were infinitely slow, then
with inertia, for which time is the better remedy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.statics import Equilibrium
from tensctl.synthesis.legs import Leg
from tensctl.synthesis.pace import ABOVE, refuse_faster, room_factor, too_quick
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.shape import ShapeProblem
from tensctl.synthesis.shape_limits import Asked, ShapeLimits
from tensctl.synthesis.way import Lack, lacking

# Plans after the first before it is given up. The examples take two at most, floors that act all the way four.
_ROUNDS = 12
# A plan that lacks so many times more than the best is no way out: more tension at a shape bends the way, and inertia
# of a bent way takes more again. Floors of 9 N from a start with 3 pass through seven times as much, and are kept.
_WORSE = 10.0
# Longer durations that are tried before a path is refused as too quick, each a few seconds for a mast, and the largest
# factor from what inertia takes that is tried first: larger ones are of floors that act all the way.
_LONGER, _SURE = 6, 4.0
# Values of features that differ by less, m, are the same: where a leg begins, every plan meets them to rounding.
_SAME = 1e-9


def plan_all_along(legs: tuple[Leg, ...], start: Equilibrium, asked: Asked, rate_max: float | None) -> ShapePath:
    """The path through the legs that keeps what is asked at its shapes and between them.

    Raises
    ------
    SynthesisError
        A shape out of reach, a leg too short for the rate limit, m/s, or a way that lacks more than the shapes beside
        it can keep.
    """
    whole = _limits_of(legs, start, asked.limits(start))
    plan = _Plan((start,), whole)
    plan = plan.followed_by(legs, asked, plan.limits)
    _in_time(plan.path(legs), rate_max, asked)
    cannot = "and the planned shapes beside cannot keep as much more"
    plan, lack = _mended(plan, legs, asked, whole, moving=False)
    if lack:
        raise SynthesisError(f"{lack.said()}, {cannot}; {asked.remedy(start)}.")
    slow = lack.path
    _, lack = _mended(plan, legs, asked, whole, moving=True)
    if lack:
        allow = _time_that_does(plan, lack, asked, whole, rate_max)
        in_words = f"{lack.said()} as it moves, {cannot}; allow {allow or 'more time'}."
        raise SynthesisError(too_quick(slow, asked.tension_min, allow) or in_words)
    return _in_time(lack.path, rate_max, asked)


def _time_that_does(
    slow: _Plan, lack: Lack, asked: Asked, whole: tuple[ShapeLimits, ...], rate_max: float | None
) -> str | None:
    """Durations with which a plan can be mended as it moves, in words, found by trying; None where none was found.

    What inertia takes of a plan that is not mended says too much where a floor acts all the way, and too little where
    it acts at a place that is not looked at for that.
    """
    given = legs = lack.path.legs
    factor = ABOVE * room_factor(slow.path(given), given[lack.leg], asked.tension_min)
    for trial in range(_LONGER):
        legs = _longer(legs, lack.leg, factor if trial == 0 and ABOVE < factor <= _SURE else 2.0)
        lack = _mended(slow, legs, asked, whole, moving=True)[1]
        if not lack and (rate_max is None or lack.path.fastest <= rate_max):
            changed = [leg for leg, before in zip(legs, given, strict=True) if leg.duration > before.duration]
            return " and ".join(f"{leg.duration:g} s or more" + f" in {leg.key}" * (len(legs) > 1) for leg in changed)
    return None


def _longer(legs: tuple[Leg, ...], k: int, factor: float) -> tuple[Leg, ...]:
    """Legs of which one takes so many times as long, to three digits."""
    duration = float(f"{factor * legs[k].duration:.3g}")
    later = duration - legs[k].duration
    after = (replace(leg, start=leg.start + later) for leg in legs[k + 1 :])
    return (*legs[:k], replace(legs[k], duration=duration), *after)


def _limits_of(legs: tuple[Leg, ...], start: Equilibrium, whole: ShapeLimits) -> tuple[ShapeLimits, ...]:
    """Limits of every shape; floors that the start does not keep grow along a first leg that changes nothing else."""
    first, missing = legs[0], np.maximum(whole.tension_min - start.tensions, 0.0)
    limits = [whole] * (1 + sum(leg.steps for leg in legs))
    if np.abs(first.levers * (first.ends - first.begins(start.nodes))).max() < _SAME and first.round_about is None:
        for k in range(1, first.steps):
            floors = whole.tension_min - (1 - k / first.steps) * missing
            limits[k] = ShapeLimits(floors, *whole.parts[1:])
    return tuple(limits)


def _mended(
    plan: _Plan, legs: tuple[Leg, ...], asked: Asked, whole: tuple[ShapeLimits, ...], *, moving: bool
) -> tuple[_Plan, Lack]:
    """The plan that lacks nothing between its shapes, or the least of those tried, and what that is."""
    lack = lacking(plan.path(legs), whole, moving=moving)
    best = plan, lack
    for _ in range(_ROUNDS):
        if not lack or lack.worst > _WORSE * best[1].worst:
            break
        try:
            plan = plan.followed_by(legs, asked, lack.asked_more(plan.limits))
        except SynthesisError:
            break
        lack = lacking(plan.path(legs), whole, moving=moving)
        best = min(best, (plan, lack), key=lambda tried: tried[1].worst)
    return best


def _in_time(path: ShapePath, rate_max: float | None, asked: Asked) -> ShapePath:
    """The path, where its rest lengths keep the rate limit."""
    if rate_max is not None:
        refuse_faster(path, rate_max, asked.tension_min)
    return path


@dataclass(frozen=True, eq=False)
class _Plan:
    """Planned equilibria, first to last, and what each has to keep."""

    equilibria: tuple[Equilibrium, ...]
    limits: tuple[ShapeLimits, ...]

    def path(self, legs: tuple[Leg, ...]) -> ShapePath:
        ways, first = [], 0
        for leg in legs:
            ways.append(leg.said(leg.begins(self.equilibria[first].nodes)))
            first += leg.steps
        return ShapePath(self.equilibria, legs, f"{', then '.join(ways)}; least rest-length change")

    def followed_by(self, legs: tuple[Leg, ...], asked: Asked, limits: tuple[ShapeLimits, ...]) -> _Plan:
        """The plan with these limits; shapes for which nothing has changed are kept, the others sought from them."""
        found = [self.equilibria[0]]
        for leg in legs:
            first = len(found) - 1
            begins, same = leg.begins(found[-1].nodes), False
            if first < len(self.equilibria) - 1:
                before = leg.begins(self.equilibria[first].nodes)
                same = bool(np.abs(leg.levers * (begins - before)).max() < _SAME)
                begins = before if same else begins
            for k in range(first + 1, first + 1 + leg.steps):
                planned = self.equilibria[k] if k < len(self.equilibria) else None
                if planned is None or not same or limits[k] is not self.limits[k]:
                    problem = ShapeProblem(leg.features, asked, limits[k])
                    planned = _sought(leg, problem, begins, (k - first) / leg.steps, found[-1], planned)
                found.append(planned)
        return _Plan(tuple(found), limits)


def _sought(
    leg: Leg, problem: ShapeProblem, begins: np.ndarray, share: float, before: Equilibrium, near: Equilibrium | None
) -> Equilibrium:
    """The shape at a share of a leg; where there is none, how far the way leads."""
    try:
        return problem.solve(before if near is None else near, leg.values(begins, share))
    except SynthesisError as error:
        done, where = share - 1 / leg.steps, "" if leg.key == "target" else f"{leg.key}: "
        raise SynthesisError(f"{where}{error} The way leads {100 * done:.0f} % there.") from None
