"""The convex programs of prestress: tensions between bounds, in balance, tied by groups.

    A_t T + A_r c + w = 0,   lower <= T <= upper,   T = G tau   (equal within a group)

and one of two goals, each with its dual, so that any multiplier y with A_r'y = 0 bounds the optimum from outside:

    minimise   1/2 sum a (T - g)^2     dual   sum over groups min_tau (1/2 sum a (tau - g)^2 + (A_t'y) tau) + y.w
    maximise   t, all T >= t, T <= u   dual   (sum v u - y.w) / sum z,   z = max(0, G'A_t'y), v = max(0, -G'A_t'y)
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int

from tensctl.statics.prestress.matrix import EquilibriumMatrix

if TYPE_CHECKING:
    import cvxpy as cp

QPSolver = Literal["CLARABEL", "OSQP", "SCS"]
LPSolver = Literal["HIGHS", "CLARABEL", "SCIPY"]

_TIGHT = 1e-10


@dataclass(frozen=True, eq=False)
class Balanced:
    """What a solver found, in N: tensions, rod compressions, and nodal multipliers of the balance."""

    tensions: Float[np.ndarray, " tendons"]
    rod_forces: Float[np.ndarray, " rods"]
    multipliers: Float[np.ndarray, " free"]


@dataclass(frozen=True, eq=False)
class Program:
    """Bounds and ties of the tensions that must balance the loads.

    Attributes
    ----------
    matrix : EquilibriumMatrix
    loads : (N, 3) N
    lower, upper : (nt,) N
    groups : (nt,) int
        Tendons with the same number carry the same tension.
    """

    matrix: EquilibriumMatrix
    loads: Float[np.ndarray, "nodes 3"]
    lower: Float[np.ndarray, " tendons"]
    upper: Float[np.ndarray, " tendons"]
    groups: Int[np.ndarray, " tendons"]

    @cached_property
    def load(self) -> Float[np.ndarray, " free"]:
        """Loads on the free node components, N."""
        return self.loads.ravel()[self.matrix.free]

    @cached_property
    def tie(self) -> sp.csr_array:
        """G, (nt, groups): one where a tendon belongs to a group."""
        count = self.groups.size
        entries = (np.ones(count), (np.arange(count), self.groups))
        return sp.csr_array(sp.coo_array(entries, shape=(count, int(self.groups.max(initial=-1)) + 1)))

    @cached_property
    def tied(self) -> sp.csr_array:
        """A_t G, (free, groups)."""
        return sp.csr_array(self.matrix.tendons @ self.tie)

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the groups' tensions, N."""
        low, high = np.full(self.tie.shape[1], -np.inf), np.full(self.tie.shape[1], np.inf)
        np.maximum.at(low, self.groups, self.lower)
        np.minimum.at(high, self.groups, self.upper)
        return low, high

    @cached_property
    def acting(self) -> Bool[np.ndarray, " groups"]:
        """Groups with a tendon that has a free end."""
        return np.asarray(self.tie.T @ self.matrix.acting_tendons.astype(float) > 0)

    def quadratic(self, weights: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Weight and target of each group: sum a (tau - g)^2 is A (tau - gbar)^2 and a constant."""
        weight = self.tie.T @ weights
        return weight, (self.tie.T @ (weights * target)) / weight


def least_squares(program: Program, weights: np.ndarray, target: np.ndarray, solver: QPSolver) -> Balanced | None:
    """Minimise 1/2 sum a (T - g)^2; None when the solver has nothing to show.

    Accurate to about 1e-8 of the largest tension with Clarabel and 1e-4 with the others; `polish` takes it to rounding.
    """
    import cvxpy as cp

    weight, wanted = program.quadratic(weights, target)
    root, size = np.sqrt(weight / weight.max(initial=1e-300)), _scale(program, target)
    tau, c = cp.Variable(weight.size), cp.Variable(program.matrix.rods.shape[1])
    goal = cp.Minimize(cp.sum_squares(cp.multiply(root, tau - wanted / size)) / 2)
    balance, limits = _constraints(program, tau, c, size)
    problem = cp.Problem(goal, [balance, *limits])
    settings = {"tol_gap_abs": _TIGHT, "tol_gap_rel": _TIGHT, "tol_feas": _TIGHT} if solver == "CLARABEL" else {}
    if not _solve(problem, solver, **settings) or tau.value is None:
        return None
    y = np.asarray(balance.dual_value) * (size * weight.max(initial=0.0))
    return Balanced(size * (program.tie @ tau.value), size * _values(c), y)


def largest_minimum(program: Program, solver: LPSolver, cap: float = np.inf) -> tuple[float, Balanced] | None:
    """Maximise the smallest tension of all tendons with free ends, up to a cap; lower bounds are not asked for.

    Returns
    -------
    float
        The largest smallest tension as the solver says, N; below zero where tendons would have to push.
    Balanced
        Tensions that reach it, to the solver's tolerance; a vertex of the set of all that do, where the solver goes
        from vertex to vertex.
    """
    import cvxpy as cp

    size = _scale(program, np.array([cap if np.isfinite(cap) else 0.0]))
    tau, c, t = cp.Variable(program.tie.shape[1]), cp.Variable(program.matrix.rods.shape[1]), cp.Variable()
    balance, _ = _constraints(program, tau, c, size)
    acting = np.flatnonzero(program.acting)
    high = program.bounds[1]
    below = np.flatnonzero(np.isfinite(high))
    limits: list[cp.Constraint] = [balance, tau[acting] >= t]
    limits += [tau[below] <= high[below] / size] if below.size else []
    limits += [t <= cap / size] if np.isfinite(cap) else []
    problem = cp.Problem(cp.Maximize(t), limits)
    if not _solve(problem, solver) or tau.value is None or t.value is None:
        return None
    rest = np.where(program.matrix.acting_tendons, program.tie @ tau.value, float(t.value))
    found = Balanced(size * rest, size * _values(c), np.asarray(balance.dual_value))
    return size * float(t.value), found


def least_violation(program: Program, solver: LPSolver) -> np.ndarray | None:
    """Multipliers of: move all bounds outwards by the same least amount so that tensions fit; None without an answer.

    Where that amount is above zero they prove that none fit, which `contradiction` recomputes.
    """
    import cvxpy as cp

    size = _scale(program, np.zeros(0))
    tau, c, out = cp.Variable(program.tie.shape[1]), cp.Variable(program.matrix.rods.shape[1]), cp.Variable()
    balance, limits = _constraints(program, tau, c, size, out)
    problem = cp.Problem(cp.Minimize(out), [balance, *limits, out >= -1.0])
    return np.asarray(balance.dual_value) if _solve(problem, solver) and tau.value is not None else None


def _scale(program: Program, target: np.ndarray) -> float:
    """A force of the problem's own size, so that the solver works with numbers near one."""
    finite = [x[np.isfinite(x)] for x in (target, program.lower, program.upper, program.load)]
    for values in (np.concatenate(finite[:2]), *finite[2:]):
        if np.abs(values).max(initial=0.0) > 0:
            return float(np.abs(values).max())
    return 1.0


def _constraints(program: Program, tau: cp.Variable, c: cp.Variable, size: float, out: cp.Variable | float = 0.0):
    """Balance, and bounds where there are any, moved outwards by `out`; in units of `size`."""
    low, high = program.bounds
    force = program.tied @ tau + program.load / size
    if c.size:
        force = force + program.matrix.rods @ c
    limits = []
    for bound, sign in ((low, 1.0), (high, -1.0)):
        k = np.flatnonzero(np.isfinite(bound))
        if k.size:
            limits.append(sign * tau[k] >= sign * bound[k] / size - out)
    return force == 0, limits


def _values(variable: cp.Variable) -> np.ndarray:
    return np.zeros(0) if variable.value is None else np.asarray(variable.value)


def _solve(problem: cp.Problem, solver: str, **settings: float) -> bool:
    """Run a solver; its status word only says whether there are numbers to look at."""
    import cvxpy as cp

    with warnings.catch_warnings():
        # "May be inaccurate", or overflow in an answer that ran away: every result is judged by its own residuals.
        warnings.simplefilter("ignore", UserWarning)
        warnings.simplefilter("ignore", RuntimeWarning)
        try:
            problem.solve(solver=solver, **settings)
        except cp.SolverError:
            return False
    return problem.status in ("optimal", "optimal_inaccurate", "user_limit")
