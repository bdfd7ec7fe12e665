"""Error against run time of every solver, on the problems of one predictive controller.

    error = max |v_1 - v_1*| / (rate_max dt),   v_1 the first input of an answer, v_1* that of the reference

The reference is an active set at 1e-12 m without a bound on its iterations. Every answer is judged by the KKT residual
of the condensed problem, whatever form the solver has it in. Times are processor time of one solve with matrices set up
before, as a controller has them, the least of two where they are short; of cvxpy they are those of its whole statement.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tensctl.accuracy.overheard import Heard, Posed, overhear
from tensctl.accuracy.solver_result import Floors, SolverAttempt, SolverPrecision
from tensctl.scene import AccuracyStage
from tensctl.scene.given import check_kind
from tensctl.simulation import Load
from tensctl.simulation.moving import Start
from tensctl.synthesis import MPC
from tensctl.synthesis.qp import ACCEPT, Solver
from tensctl.synthesis.qp_solvers import SOLVERS, new_solver
from tensctl.threads import one_blas_thread

TOLERANCES = (1e-3, 1e-6, 1e-9)
# Of the reference, m.
_STRICT = 1e-12
# Problems of each kind, and the part of the budget that the closed loop may take, and the reference.
_MOST, _LOOP = 10, 0.2
# Solvers of problems whose floors can be kept only.
_KEEPERS = ("cvxpy", "dual")
# A solve is timed again when it takes less than this, s.
_QUICK = 0.1

# First input, KKT residual (nan when unknown, infinite without an answer).
Answer = tuple[np.ndarray | None, float]


@dataclass(frozen=True, eq=False)
class Known:
    """A problem and the first input of its optimum, m."""

    posed: Posed
    first: np.ndarray

    @property
    def reach(self) -> np.ndarray:
        """What each input may change in a period, m."""
        limits = self.posed.limits
        return 0.5 * (limits.change_upper[0] - limits.change_lower[0])


@one_blas_thread()
def solver_precision(
    mpc: MPC,
    start: Start,
    *,
    t_end: float,
    pushes: Sequence[Load] = (),
    tolerances: Sequence[float] = TOLERANCES,
    budget: float = 30.0,
) -> SolverPrecision:
    """Measure every solver on problems of a controller's own closed loop.

    Parameters
    ----------
    mpc : MPC
    start : Equilibrium, nodes, or nodes and velocities
    t_end : float, s
        How long the loop runs, if a fifth of the budget lasts.
    pushes : sequence of loads
    tolerances : sequence of float
    budget : float, s
        For all of it; solvers have equal shares, and leave problems out that do not fit.

    Raises
    ------
    SynthesisError
        A controller that is no `MPC` or `OutputMPC`.
    SceneError
        Tolerances, a budget or an end that `[accuracy]` of a scene would refuse.
    SimulationError
        A start or a load that does not fit, or a motion that cannot be followed.
    """
    check_kind(MPC, mpc=mpc)
    asked = AccuracyStage.checked(tolerances=tolerances, budget=budget, t_end=t_end)
    heard = overhear(mpc, start, t_end=asked.t_end, pushes=pushes, seconds=_LOOP * asked.budget)
    return compared(mpc, heard, tolerances=asked.tolerances, budget=(1 - _LOOP) * asked.budget)


def compared(
    mpc: MPC,
    heard: Heard,
    *,
    solvers: Sequence[str] = (*SOLVERS, "cvxpy"),
    tolerances: Sequence[float] = TOLERANCES,
    budget: float = np.inf,
    most: int = _MOST,
) -> SolverPrecision:
    """Measure solvers on problems that were heard, at most so many of each kind, within a budget, s."""
    kinds: list[tuple[Floors, tuple[Posed, ...]]] = [
        ("kept", heard.some(most, relaxed=False)), ("relaxed", heard.some(most, relaxed=True))
    ]  # fmt: skip
    kinds = [(floors, posed) for floors, posed in kinds if posed]
    loose_first = sorted(tolerances, reverse=True)
    asked: list[tuple[str, float, Floors]] = [
        (name, tol, floors)
        for floors, _ in kinds
        for name in solvers
        for tol in loose_first
        if floors == "kept" or name not in _KEEPERS
    ]
    share = budget / max(len(asked) + len(kinds) * len(tolerances), 1)
    known: dict[str, list[Known]] = {}
    kkt = 0.0
    for floors, posed in kinds:
        known[floors], worst = _references(posed, share * len(tolerances))
        kkt = max(kkt, worst)
    attempts = [_attempt(known[floors], name, tol, floors, share) for name, tol, floors in asked]
    problem = mpc.problem
    return SolverPrecision(
        tuple(attempts), mpc.dt, mpc.horizon, problem.H.shape[0], problem.rows.shape[0], heard.steps, heard.relaxed,
        heard.t_end, kkt,
    )  # fmt: skip


def _references(posed: Sequence[Posed], share: float) -> tuple[list[Known], float]:
    """Problems with their optima, as many as the share, s, allows; and the largest KKT residual among them."""
    known, worst, ready, until = [], 0.0, _asker("daqp", _STRICT), time.perf_counter() + share
    for problem in posed:
        if known and time.perf_counter() > until:
            break
        first, kkt = ready(problem)()
        if first is not None and kkt <= ACCEPT:
            known.append(Known(problem, first))
            worst = max(worst, kkt)
    return known, worst


def _attempt(known: list[Known], name: str, tol: float, floors: Floors, share: float) -> SolverAttempt:
    """One solver at one tolerance, on as many problems as its share, s, allows."""
    if not known:
        return SolverAttempt.skipped(name, tol, floors, "the reference answers none of the problems in time")
    ready, until = _asker(name, tol), time.perf_counter() + share
    seconds, kkts, errors, accepted = [], [], [], 0
    for problem in known:
        if seconds and time.perf_counter() + seconds[-1] > until:
            break
        (first, kkt), took = _timed(ready(problem.posed))
        seconds.append(took)
        accepted += first is not None and not kkt > ACCEPT
        if first is not None:
            kkts.append(kkt)
            errors.append(float((np.abs(first - problem.first) / problem.reach).max()))
    figures = (*_middle_and_worst(seconds), *_middle_and_worst(kkts), *_middle_and_worst(errors))
    return SolverAttempt(name, tol, floors, len(seconds), accepted, *figures)


def _timed(solve: Callable[[], Answer]) -> tuple[Answer, float]:
    answer, took = (None, np.inf), np.inf
    for _ in range(2):
        began = time.process_time()
        answer = solve()
        took = min(took, time.process_time() - began)
        if took > _QUICK:
            break
    return answer, took


def _asker(name: str, tol: float) -> Callable[[Posed], Callable[[], Answer]]:
    """What makes ready to solve a problem: a solver is set up once for each linear model and kind of problem."""
    if name == "cvxpy":
        return lambda posed: _stated(posed, tol)
    solvers: dict[tuple[int, bool], Solver] = {}

    def ready(posed: Posed) -> Callable[[], Answer]:
        key = id(posed.condensed), posed.relaxed
        if key not in solvers:
            solvers[key] = new_solver(name, posed.condensed, soft=posed.relaxed, tol=tol)
        inputs = posed.limits.input_upper.shape[1]

        def solve() -> Answer:
            found = solvers[key].solve(posed.qp)
            return (None if found.z is None else found.z[:inputs]), found.kkt

        return solve

    return ready


def _stated(posed: Posed, tol: float) -> Callable[[], Answer]:
    """The same for the statement in cvxpy, which is made anew for each problem."""
    from cvxpy.error import SolverError

    from tensctl.synthesis.qp_cvxpy import reference_optimum

    def solve() -> Answer:
        try:
            inputs = reference_optimum(posed.condensed, posed.limits, tol)[1]
        except SolverError:
            return None, np.inf
        return (inputs[0], np.nan) if np.isfinite(inputs).all() else (None, np.inf)

    return solve


def _middle_and_worst(values: list[float]) -> tuple[float, float]:
    return (float(np.median(values)), float(np.max(values))) if values else (np.nan, np.nan)
