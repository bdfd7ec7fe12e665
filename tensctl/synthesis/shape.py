"""Rest lengths for a new shape: least change of u along equilibria whose tensions stay within their limits.

    minimise |u|^2   subject to   h(p(u)) = wanted (each feature),   tension_min <= T(u) <= tension_max,
                                  lower <= u <= upper,   d(p(u)) >= clearance (each pair of rods, where asked for)

p(u) is the equilibrium itself, so every iterate balances. Sequential quadratic programming with the exact static
influence dp/du = J Phi diag(1/omega^2) Phi'G; the curvature of the Lagrangian is learned from step to step (BFGS), so
that constraints converge as Newton does and the minimum nearly so. A step is taken when it lowers the misfit of the
constraints, or |u|^2/2 by more than what the misfit that it adds costs at the multipliers; else it is cut, with the
same aim.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tensctl.analysis import static_influence
from tensctl.errors import EquilibriumError, SynthesisError
from tensctl.statics import Equilibrium, settle
from tensctl.synthesis.blocked import block_of, block_said, few
from tensctl.synthesis.input_limits import input_reach
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.rod_room import at_clearance, missing, near_pairs, rows
from tensctl.synthesis.shape_limits import Asked, ShapeLimits
from tensctl.synthesis.target import Feature, levers
from tensctl.synthesis.tension_room import room, room_slope
from tensctl.threads import one_blas_thread

_STEPS = 200
# Features, in metres, are met to this part of the structure's size; the least change of u to this part of its largest.
_MET = 1e-12
_CHANGE = 1e-6
# A change below this part of the size is none: back at rest the largest change of u is zero.
_NO_CHANGE = 1e-3
# Misfits smaller than this part of the size may grow a little from step to step.
_NEAR = 1e-6
# Misfits smaller than this part of the size are none to somebody who is told of a search that did not end.
_FOUND = 1e-5
# What a metre of misfit costs, over the sum of all multipliers: more than 1, so that no misfit pays.
_DEARER = 1.2
# A step along which the curvature falls below this part of what was learned unlearns all: there least change is none.
_DAMPED = 0.2
# Curvatures farther apart than this are forgotten: what was learned far away holds no longer.
_SPREAD = 1e6
# A search ends when so many tries have lowered neither the misfit nor the cost by these parts of themselves. Until its
# shape has been met only the least misfit counts: along a saddle, shapes that are out of reach get cheaper for hundreds
# of tries and no nearer. Searches that found least change after 40 to 184 tries had met their shape within 60, and
# lowered one or the other by more all the way.
_IDLE = 20
_LOWER = 1e-2
_CHEAPER = 1e-6


@dataclass(frozen=True, eq=False)
class ShapeProblem:
    """Shape planning from one equilibrium.

    Attributes
    ----------
    features : tuple of Feature
    asked : Asked
        The limits in the words of whoever asks.
    limits : ShapeLimits
        What the shape keeps; as asked, or tighter.
    """

    features: tuple[Feature, ...]
    asked: Asked
    limits: ShapeLimits

    @one_blas_thread()
    def solve(self, start: Equilibrium, wanted: np.ndarray) -> Equilibrium:
        """The equilibrium with the wanted values of the features, (k,), and the least rest-length change.

        Raises
        ------
        SynthesisError
            When the rest lengths cannot make the shape within these limits.
        """
        if not start.inputs.size:
            raise SynthesisError("no tendon has an actuator that moves anything, so no other shape can be made.")
        now, limit, curvature = start, self._reach(start), np.eye(start.inputs.size)
        influence, pairs = static_influence(now), near_pairs(now, self.limits.clearance)
        aim, prices = self._next(now, wanted, influence, pairs, curvature)
        tries = _Tries(now, self._misfit(now, wanted))
        for _ in range(_STEPS):
            if not tries.lead_on:
                break
            step = aim - now.inputs
            step *= min(1.0, limit / max(np.abs(step).max(initial=0.0), 1e-300))
            following = _settled(now, now.inputs + step, influence @ step)
            if following is None or self._worse(following, now, wanted, _DEARER * np.abs(prices).sum()):
                limit = 0.25 * np.abs(step).max()
                tries.add(now, tries.misfits[-1])
                continue
            limit = min(2 * limit, self._reach(now))
            before = self._linearised(now, influence, pairs)[1]
            now, influence = following, static_influence(following)
            tries.add(now, self._misfit(now, wanted))
            met = np.abs(self._error(now, wanted)).max() <= _MET * _size(now)
            if met and np.abs(step).max() <= _CHANGE * max(np.abs(now.inputs).max(), _NO_CHANGE * _size(now)):
                return now
            after = self._linearised(now, influence, pairs)[1]
            curvature = _learned(curvature, step, step + prices @ (after - before))
            pairs = near_pairs(now, self.limits.clearance)
            aim, prices = self._next(now, wanted, influence, pairs, curvature)
        raise SynthesisError(self._not_found(wanted, tries))

    def _not_found(self, wanted: np.ndarray, tries: _Tries) -> str:
        """What a search that ended without its shape came to."""
        asked, nearest = self.asked, tries.nearest
        if self._misfit(nearest, wanted) <= _FOUND * _size(nearest):
            (sought,) = self._told_apart(wanted)
            return (
                f"rest lengths for {sought} with {asked.said(nearest)} were found, but in {tries.count} tries not "
                "those of least change; name more of the shape (twist, tip, tilt, nodes), or ask for less."
            )
        had, sought = self._told_apart(self._values(nearest), wanted)
        return (
            f"no rest lengths were found for {sought} with {asked.said(nearest)}; the nearest has {had}, where "
            f"{self.at_limit(nearest)}; {asked.remedy(nearest)}."
        )

    def at_limit(self, now: Equilibrium) -> str:
        """What is at its limit, in words: tensions, rest lengths, distances of rods."""
        members, limits = now.potential.members, self.limits
        low = now.tensions <= limits.tension_min * (1 + 1e-6) + 1e-9 * now.tensions.max(initial=0.0)
        strong = now.tensions >= limits.tension_max * (1 - 1e-6)
        short = now.rest_lengths <= members.floors * (1 + 1e-6)
        kinds = ((low, "tension_min"), (strong, "force_max"), (short, "the least rest length"))
        labels = np.array(now.structure.tendon_labels)
        said = [f"{few(labels[found])} at {limit}" for found, limit in kinds if found.any()]
        if self.asked.u_max is not None:
            used = np.abs(now.inputs) >= input_reach(now.structure, members, self.asked.u_max) * (1 - 1e-6)
            said += [f"{few(np.array(members.gearing.labels)[used])} at u_max"] * bool(used.any())
        if limits.clearance.size and (pairs := at_clearance(now, limits.clearance)):
            said.append(pairs)
        return " and ".join(said) or "no tendon is at a limit yet"

    def _values(self, now: Equilibrium) -> np.ndarray:
        return np.array([feature.of(now.nodes) for feature in self.features])

    def _error(self, now: Equilibrium, wanted: np.ndarray) -> np.ndarray:
        """What every feature has too much, m."""
        return levers(self.features) * (self._values(now) - wanted)

    def _told_apart(self, *shapes: np.ndarray) -> list[str]:
        """Features and values of some shapes in words, "height 1.2 m", with as many digits as tell them apart."""
        named = [feature.name.split(", ") for feature in self.features]
        said = []
        for digits in range(4, 10):
            said = [
                ", ".join(f"{name} {v:.{digits}g} {unit}" for (name, unit), v in zip(named, values, strict=True))
                for values in np.round(shapes, 9) + 0.0  # rounding shows neither 1e-16 nor minus zero
            ]
            if len(set(said)) == len(said):
                break
        return said

    def _reach(self, start: Equilibrium) -> float:
        """Largest change of one rest length in one iteration, m: a tenth of the mean."""
        return 0.1 * float(start.rest_lengths.mean())

    def _worse(self, following: Equilibrium, now: Equilibrium, wanted: np.ndarray, price: float) -> bool:
        """Whether a step is none to take: it raises the misfit, and by more than the change that it saves is worth."""
        before, after = self._misfit(now, wanted), self._misfit(following, wanted)
        saved = (now.inputs @ now.inputs - following.inputs @ following.inputs) / 2
        return bool(after > max(before, _NEAR * _size(now)) and price * (after - before) > saved)

    def _misfit(self, now: Equilibrium, wanted: np.ndarray) -> float:
        """Errors of the features plus the worst missing room of a tension and of rods, m: what a step may not raise."""
        limits = self.limits
        lacking = -room(now, limits.tension_min, limits.tension_max).min(initial=0.0)
        if limits.clearance.size:
            lacking += missing(now, limits.clearance)
        return float(np.abs(self._error(now, wanted)).sum() + lacking)

    def _linearised(self, now: Equilibrium, reach: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Features, rooms of tensions and of some pairs of rods: values beyond what is wanted, and gradients by u."""
        limits = self.limits
        slopes = np.stack([feature.lever * feature.slope(now.nodes).ravel() for feature in self.features])
        left = room(now, limits.tension_min, limits.tension_max)
        slope = room_slope(now, reach, limits.tension_min, limits.tension_max)
        apart, opening = rows(now, reach, pairs) if pairs.size else (np.zeros(0), np.zeros((0, now.inputs.size)))
        values = np.concatenate([left, apart - limits.clearance[pairs]])
        return values, np.vstack([slopes @ (now.point.tangent @ reach), slope, opening])

    def _next(
        self, now: Equilibrium, wanted: np.ndarray, reach: np.ndarray, pairs: np.ndarray, curvature: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Inputs of least |u| by the quadratic model, or else those nearest to now, and the prices of its rows."""
        left, A = self._linearised(now, reach, pairs)
        u, error = now.inputs, self._error(now, wanted)
        passed = A @ u - np.concatenate([error, left])
        qp = QP(
            H=curvature, f=u - curvature @ u, A=A,
            lower=np.concatenate([self.limits.lower, passed]),
            upper=np.concatenate([self.limits.upper, passed[: error.size], np.full(left.size, np.inf)]),
        )  # fmt: skip
        solution = DaqpSolver(qp).solve(qp)
        if solution.z is None:  # where curvatures are far apart that is said of problems with a solution, too
            qp = replace(qp, H=np.eye(u.size), f=-u)
            solution = DaqpSolver(qp).solve(qp)
        if solution.z is None or solution.y is None:
            had, sought = self._told_apart(self._values(now), wanted)
            stand = block_said(now, self.asked, block_of(qp, u), error.size, pairs, reach)
            raise SynthesisError(
                f"no small rest-length change leads from {had} towards {sought} with {self.asked.said(now)}: {stand}; "
                f"{self.asked.remedy(now)}."
            )
        return solution.z, solution.y[u.size :]


class _Tries:
    """What the tries of a search came to: misfits, m, costs, m^2, and the equilibrium nearest to what is wanted."""

    def __init__(self, start: Equilibrium, misfit: float) -> None:
        self.nearest, self.misfits, self.costs = start, [misfit], [start.inputs @ start.inputs]
        self._least = [misfit]

    def add(self, now: Equilibrium, misfit: float) -> None:
        """Where a try leaves the search, whether its step was taken or not."""
        self.misfits.append(misfit)
        self.costs.append(now.inputs @ now.inputs)
        if misfit < self._least[-1]:
            self.nearest = now
        self._least.append(min(misfit, self._least[-1]))

    @property
    def count(self) -> int:
        """How many there were."""
        return len(self.misfits) - 1

    @property
    def lead_on(self) -> bool:
        """Whether the last of them have changed anything that counts, or what is wanted is met."""
        if len(self.misfits) <= _IDLE or self.misfits[-1] <= _NEAR * _size(self.nearest):
            return True
        if self._least[-1] > _FOUND * _size(self.nearest):
            return bool(self._least[-1] < (1 - _LOWER) * self._least[-1 - _IDLE])
        lower = self.misfits[-1] < (1 - _LOWER) * self.misfits[-1 - _IDLE]
        return bool(lower or self.costs[-1] < (1 - _CHEAPER) * self.costs[-1 - _IDLE])


def _learned(curvature: np.ndarray, step: np.ndarray, change: np.ndarray) -> np.ndarray:
    """The curvature of the Lagrangian after a step and the change of its gradient: BFGS, anew where it bends down."""
    bent = curvature @ step
    size = step @ bent
    if not step @ change > _DAMPED * size:
        return np.eye(step.size)
    learned = curvature - np.outer(bent, bent) / size + np.outer(change, change) / (step @ change)
    spread = np.linalg.eigvalsh(learned)
    return learned if spread[0] * _SPREAD > spread[-1] else np.eye(step.size)


def _size(now: Equilibrium) -> float:
    """Largest extent along an axis, m."""
    return float(np.ptp(now.nodes, axis=0).max())


def _settled(now: Equilibrium, inputs: np.ndarray, guess: np.ndarray) -> Equilibrium | None:
    """The stable equilibrium that follows from a change of inputs, sought from a step of the chart; None without."""
    try:
        found = settle(now.potential, start=now.potential.manifold.retract(now.nodes, guess), inputs=inputs)
    except EquilibriumError:
        return None
    return found if found.stable else None
