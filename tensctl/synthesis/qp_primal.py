"""The primal active set as a solver: for steps where hundreds of limits act, and bounded in its work.

It begins where the last plan would go on. All that it passes keeps the hard limits, and costs no more than that plan:
where its work is over before the optimum, the command is still one to use, and its KKT residual says how far it is.
Limits of tension have slacks at the price of `synthesis.relaxed`; slacks at zero are limits that are kept.

Where it is far from the optimum the last plan was no place to begin: with floors of 20 N at a shell that rests with 4 N
a search would take 10 000 steps, most of them of no length at first, and is allowed a hundred. It then begins again,
with constant rates, and the plan that costs less is the answer.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from tensctl.synthesis import primal
from tensctl.synthesis.bordered import Form
from tensctl.synthesis.constant_rates import PARTS, ConstantRates
from tensctl.synthesis.qp import QP, Solution, judged
from tensctl.synthesis.relaxed import Relaxed, curvature

# Multiplications of one search, 3 to 5 ms, up to so many variables; beyond, more by their square, as a step takes.
# With more the worst step of `benchmarks/mpc_in_time.py` takes over 10 ms.
_WORK, _VARIABLES = 2e7, 480
# Wrong multipliers over the largest slope.
TOL = 1e-11
# An answer with a larger KKT residual is no optimum.
FINE = 1e-9
# A bounded answer with a larger one is far from its optimum; after pushes to 20 N they have 6e-5 and less.
FAR = 0.1
# Part of the work for the search from constant rates: it makes their multipliers known and goes down a little.
ONCE_MORE = 0.1
# Part of the work for the search that tells whether floors have to give way.
KEEPING = 0.5
# Most entries of the basis of a bounded search, or half the variables: the inverse then takes 1.3 MB, 18 MB at (8,4).
_ROOM = 400
# What passes a hard limit by more than this, m, has lost its way among pivots that are nearly nothing.
ASTRAY = 1e-8


def bounds(variables: int, stages: int) -> tuple[float, int]:
    """Multiplications of a search, and most entries of its basis, where the caller asks for no more."""
    return _WORK * max(1.0, variables / _VARIABLES) ** 2, min(2 * (variables + stages), max(_ROOM, variables // 2))


class PrimalSolver:
    """Matrices in rates; a search makes what it needs.

    Parameters
    ----------
    H : (n, n)
        Of inputs, stage by stage.
    rows : (r, n)
        Tensions stage by stage, then rates.
    stages : int
    soft : bool
        Whether it is asked problems with slacks; without them it says when none are needed.
    work : float, optional
        Multiplications after which it ends where it is; by default 20 million, beyond 480 variables as their square.
    tol : float
        Largest wrong multiplier, over the largest slope.
    """

    name = "primal"

    def __init__(
        self,
        H: Float[np.ndarray, "n n"],
        rows: Float[np.ndarray, "r n"],
        stages: int,
        *,
        soft: bool,
        work: float | None = None,
        tol: float = TOL,
    ) -> None:
        n, tensions = H.shape[0], rows.shape[0] - H.shape[0]
        self._stages, self._tol = stages, tol
        self._work, self._room = bounds(n, stages)
        if work is not None:
            self._room = 2 * (n + stages) if work > self._work else self._room
            self._work = work
        self._relaxed = None if soft else Relaxed.of(H, rows, stages)
        by_rate = np.ascontiguousarray(self._summed(rows[:tensions].T))
        G = self._summed(self._summed(H).T)
        self._form = Form(
            np.ascontiguousarray(0.5 * (G + G.T)), np.ascontiguousarray(by_rate.T), by_rate, curvature(H), stages,
        )  # fmt: skip
        wide, floors = np.ones(n), -np.ones(tensions)
        self._roughly = []
        if soft and work is None:
            self._roughly = [(ConstantRates(self._form, parts), share) for parts, share in PARTS if parts <= stages]
        rest = primal.Step(0 * wide, 0.0, -wide, wide, floors, -wide, wide)
        primal.search(self._form, rest, 0 * wide, 1, tol, 0.0)  # no control step should wait for the kernel

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        n = self._form.G.shape[0]
        step = self._step(qp if self._relaxed is None else self._relaxed.problem(qp))
        guess = np.zeros(n) if qp.guess is None else qp.guess
        found = self._searched(qp, step, guess, self._work)
        if found.status != "bounded" or found.kkt <= FAR or qp.start is None or not self._roughly:
            return found
        now = qp.start[-(n // self._stages) :]
        for rough, share in self._roughly:
            guess = rough.plan(step, now, guess, share * self._work)
        other = self._searched(qp, step, guess, ONCE_MORE * self._work)
        return min((found, other), key=lambda one: np.inf if one.z is None else qp.objective(one.z))

    def keep(self, hard: QP, dear: QP, guess: Float[np.ndarray, " n"]) -> Solution:
        """Solve a problem without slacks by one search of its relaxation, at a price that no cost is worth."""
        return self._searched(hard, self._step(dear), guess, KEEPING * self._work)

    def _step(self, soft: QP) -> primal.Step:
        n, r = self._form.by_rate.shape
        size = n + self._stages
        return primal.Step(
            g=self._summed(soft.f[:n]), price=float(soft.f[n]), lower=soft.lower[size + r :],
            upper=soft.upper[size + r :], floor=soft.lower[size : size + r], low=soft.lower[:n], high=soft.upper[:n],
        )  # fmt: skip

    def _searched(self, qp: QP, step: primal.Step, guess: Float[np.ndarray, " n"], work: float) -> Solution:
        """The answer of one search."""
        n, r = self._form.by_rate.shape
        ended, x, push, multipliers = primal.search(self._form, step, guess.copy(), self._room, self._tol, work)
        astray = max((step.lower - x[:n]).max(), (x[:n] - step.upper).max()) > ASTRAY
        if ended == primal.STUCK or astray:
            return judged(qp, None, None, "failed")
        inputs = x[:n].reshape(self._stages, -1).cumsum(axis=0).ravel()
        at_lower, at_upper = x[:n] == step.lower, x[:n] == step.upper
        held = np.clip(-push[:n], np.where(at_lower, -np.inf, 0.0), np.where(at_upper, np.inf, 0.0))
        tension, inner = np.minimum(multipliers[:r], 0.0), multipliers[r:]
        slacks = np.minimum(-push[n:], 0.0)
        if qp.f.size > n:
            z, y = np.append(inputs, x[n:]), np.concatenate([inner, slacks, tension, held])
        elif x[n:].any():
            return judged(qp, None, None, "infeasible" if ended == primal.SOLVED else "failed")
        else:
            z, y = inputs, np.concatenate([inner, tension, held])
        found = judged(qp, z, y, "solved")
        return found if found.kkt <= FINE else replace(found, status="bounded")

    def _summed(self, slopes: Float[np.ndarray, "n *k"]) -> Float[np.ndarray, "n *k"]:
        """Slopes by rates from those by inputs: a rate moves its input in all later stages."""
        staged = slopes.reshape(self._stages, -1, *slopes.shape[1:])
        return staged[::-1].cumsum(axis=0)[::-1].reshape(slopes.shape)
