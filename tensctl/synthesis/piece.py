"""One linear model of a predictive controller: its condensed problem, and the solvers that answer it.

The first solver is asked, its answer judged by its recomputed KKT residual, then the next one, in the order of
`synthesis.qp_solvers`: the hard problem first, the one whose limits of tension give way after it. Where an optimum
gives way, one more search from there, at a price that only the impossible is worth, tells whether it has to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, cast

import numpy as np
from jaxtyping import Float

from tensctl.linear import LinearModel
from tensctl.linear.propagate import Stretch, stretch
from tensctl.synthesis.condensed import Condensed, stiffness_spread
from tensctl.synthesis.limits import Limits
from tensctl.synthesis.qp import QP, Solution, Solver
from tensctl.synthesis.qp_solvers import new_solver, order_of, quick_ones
from tensctl.synthesis.relaxed import DEAR, Relaxed

if TYPE_CHECKING:
    from tensctl.synthesis.qp_primal import PrimalSolver


@dataclass(frozen=True, eq=False)
class Piece:
    """A linear model, its problem and the name of the solver that is asked first.

    Attributes
    ----------
    linear : LinearModel
    problem : Condensed
    delay : float, s
        From a sample until the command computed at it begins to act.
    first : str
    """

    linear: LinearModel
    problem: Condensed
    delay: float
    first: str

    def __post_init__(self) -> None:
        for name, soft in quick_ones(self.first):
            self.solver(name, soft=soft)  # what takes long is done before the first step
            if soft:
                _ = self.relaxed

    def __reduce__(self) -> tuple:
        return Piece, (self.linear, self.problem, self.delay, self.first)  # a copy sets up its own solvers

    @cached_property
    def until_it_acts(self) -> Stretch:
        """The model from a sample until the command computed at it begins to act."""
        return stretch(self.linear, self.delay)

    @cached_property
    def tension_next(self) -> Float[np.ndarray, "nT n"]:
        """Scaled tensions at the next sample from (e, v) when a command begins to act, and v at the sample."""
        way = stretch(self.linear, self.problem.sampled.dt - self.delay)
        from_state, from_inputs = np.hsplit(self.problem.tension, [len(way.F)])
        return np.hstack([from_state @ way.F, from_state @ way.G0, from_state @ way.G1 + from_inputs])

    def answer(self, limits: Limits) -> tuple[Float[np.ndarray, "N nu"], str, float] | None:
        """Plan, status and KKT residual; nothing when no answer can be used."""
        hard = limits.assemble(self.problem)
        asked, infeasible = {False: hard}, False
        for name, soft in order_of(self.first, hard.f.size, self.spread):
            if infeasible and not soft:
                continue
            if soft not in asked:
                asked[soft] = self.relaxed.problem(hard)
            solution = self.ask(name, asked[soft], soft=soft)
            if (z := solution.usable) is not None:
                plan = z[: hard.f.size].reshape(self.problem.horizon, -1)
                if solution.status == "bounded":
                    return plan, f"{name} bounded", solution.kkt
                if not soft:
                    return plan, name, solution.kkt
                if limits.shortfall(self.problem, plan) > 0 and (kept := self._kept(hard, plan)) is not None:
                    return kept
                return plan, f"{name} relaxed", solution.kkt
            infeasible = infeasible or solution.status == "infeasible"
        return None

    def _kept(self, hard: QP, plan: Float[np.ndarray, "N nu"]) -> tuple[Float[np.ndarray, "N nu"], str, float] | None:
        """The answer that keeps all limits, searched from one that gives way; nothing where there is none."""
        searching = cast("PrimalSolver", self.solver("primal", soft=True))
        found = searching.keep(hard, self.relaxed.problem(hard, DEAR), plan.ravel())
        if found.status != "solved" or found.z is None:
            return None
        return found.z.reshape(plan.shape), "primal", found.kkt

    @cached_property
    def spread(self) -> float:
        """The stiffest over the softest tendon."""
        return stiffness_spread(self.linear)

    @cached_property
    def relaxed(self) -> Relaxed:
        """Matrices of the problem whose limits of tension give way."""
        return Relaxed.of(self.problem.H, self.problem.rows, self.problem.horizon)

    def ask(self, name: str, qp: QP, *, soft: bool) -> Solution:
        """One solver's answer."""
        return self.solver(name, soft=soft).solve(qp)

    def solver(self, name: str, *, soft: bool) -> Solver:
        """The solver set up for the problem at rest, never for one met on the way: answers must not know the past."""
        if (name, soft) not in self._solvers:
            self._solvers[name, soft] = new_solver(name, self.problem, soft=soft)
        return self._solvers[name, soft]

    @cached_property
    def _solvers(self) -> dict[tuple[str, bool], Solver]:
        return {}
