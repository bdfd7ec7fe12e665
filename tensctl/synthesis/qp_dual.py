"""The dual active set as a solver: first asked, for steps where no limit acts or up to some hundred do.

Where the minimum without limits breaks none it is the answer. An iteration takes 10 us for the (3,1) shell with 20
stages where DAQP, which knows nothing of rates, takes 110. Where there is room for all limits, those that nearly depend
on each other are searched on orthogonal factors from where their products have lost their digits.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla

from tensctl.synthesis import dual, orthogonal
from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.qp import QP, Solution, judged

# Most limits that may act: so many, or this part of the variables where that is more. At (8,4), 3040 variables, 300
# take 0.14 s, 650 take 0.9 s and 1100 take 3 s.
_ROOM, _PART = 250, 0.1
# Where there is not room for all it gives up at once when so many are broken, or that part of the variables.
_BROKEN = 110
# Multiplications where there is room for all: half of it was too little for 2 of 80 problems with 240 variables. And
# elsewhere, up to so many variables, beyond by their square: 7 ms, and floors at 0.9 of the edge are kept with 480.
WORK = 2e8
_SOME_WORK, _VARIABLES = 4e7, 480
# Largest violation, m, as of `synthesis.qp_daqp`.
TOL = 1e-10


def all_may_act(variables: int) -> bool:
    """Whether there is room for all limits, and orthogonal factors for those that nearly depend on each other."""
    return variables <= _ROOM


def usual_room(variables: int) -> int:
    """Most limits that may act before a search gives up, where the caller asks for no more."""
    return min(variables, max(_ROOM, int(_PART * variables)))


def usual_work(variables: int) -> float:
    """Multiplications after which it does."""
    return WORK if all_may_act(variables) else _SOME_WORK * max(1.0, variables / _VARIABLES) ** 2


def most_broken(variables: int) -> int:
    """Limits that the minimum without limits may break where there is not room for all."""
    return max(_BROKEN, int(_PART * variables))


class DualSolver:
    """The factor of H, and what forces on limits move.

    Parameters
    ----------
    problem : Condensed
    room : int, optional
        Most limits that may act before it gives up; by default 250, or a tenth of the variables.
    tol : float, m
        Largest violation.
    """

    name = "dual"

    def __init__(self, problem: Condensed, room: int | None = None, tol: float = TOL) -> None:
        n, self._inputs = problem.H.shape[0], problem.H.shape[0] // problem.horizon
        self._room, self._tol = usual_room(n) if room is None else min(room, n), tol  # no more can act at once
        self._work = usual_work(n) if room is None else np.inf
        self._broken = most_broken(n) if room is None else self._room
        self._half = np.asfortranarray(np.linalg.cholesky(problem.H))
        rows = problem.rows
        # Rates first, then tensions; rates are the last n rows.
        self._order = np.roll(np.arange(rows.shape[0]), n)
        reduced = sla.solve_triangular(self._half, rows[self._order].T, lower=True)
        self._moves = np.ascontiguousarray(reduced.T @ reduced)
        self._rows = np.ascontiguousarray(reduced.T) if self._room >= n else None
        still = np.zeros(rows.shape[0])
        room_for = np.ones(rows.shape[0] + n)
        limits = (-room_for, room_for, self._inputs)  # no step should wait for a kernel
        dual.search(self._moves, still, *limits, 1, tol, -np.inf, 0.0)
        if self._rows is not None:
            orthogonal.search(self._rows, still, orthogonal.Limits(*limits), np.zeros(room_for.size), tol, 0.0)

    def solve(self, qp: QP) -> Solution:
        """Solve with new f and bounds."""
        values = qp.unlimited(self._half)
        free = values[: qp.f.size]
        broken = np.count_nonzero((values < qp.lower) | (values > qp.upper))
        if not broken:
            idle = np.zeros(values.size)
            return Solution(free, idle, "solved", qp.residual(free, idle, values))
        if broken > self._broken and self._rows is None:
            return judged(qp, None, None, "failed")
        n, order = qp.f.size, qp.f.size + self._order
        where = np.concatenate([order, np.arange(n)])
        rates, limits = values[order], (qp.lower[where], qp.upper[where], self._inputs)
        few = -np.inf if self._rows is None else dual.FEW_DIGITS
        ended, forces = dual.search(self._moves, rates, *limits, self._room, self._tol, few, self._work)
        if self._rows is not None and ended in (dual.DOUBTFUL, dual.INFEASIBLE):
            free, held = values[order], orthogonal.Limits(*limits)
            ended, rates = orthogonal.search(self._rows, free, held, forces, self._tol, self._work)
        if ended != dual.SOLVED:
            return judged(qp, None, None, "infeasible" if ended == dual.INFEASIBLE else "failed")
        inputs = rates[:n].reshape(-1, self._inputs).cumsum(axis=0).ravel()
        multipliers = np.empty(forces.size)
        multipliers[where] = -forces
        return judged(qp, inputs, multipliers, "solved")
