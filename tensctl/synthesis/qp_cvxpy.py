"""The MPC problem stated once more, in cvxpy, with states as variables: the check on the condensed form.

Nothing is shared with the condensed matrices but A, B, Q, R, P and the tension map, so an error in condensing, scaling
or bounds shows as a difference of optima.
"""

from __future__ import annotations

import numpy as np

from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.limits import Limits


def reference_optimum(problem: Condensed, limits: Limits, tol: float = 1e-12) -> tuple[float, np.ndarray]:
    """Solve the sparse problem with Clarabel through cvxpy, to a tolerance of its residuals and gap.

    Returns
    -------
    cost : float
        Optimum of the condensed objective plus the constant that condensing drops; infinite without a solution.
    inputs : (N, nu) m
    """
    import cvxpy as cp

    n, nu = problem.B.shape
    N, (Lq, Lp, Lr) = problem.horizon, (root(M) for M in (problem.Q, problem.P, problem.R))
    s, v = cp.Variable((N + 1, n)), cp.Variable((N, nu))
    before = [limits.start[n - nu :], *(v[k] for k in range(N - 1))]
    rules: list = [s[0] == limits.start]
    cost = 0
    for k in range(N):
        weight = Lp if k == N - 1 else Lq
        cost += cp.sum_squares(weight @ s[k + 1]) / 2 + cp.sum_squares(Lr @ v[k]) / 2
        rules += [
            s[k + 1] == problem.A @ s[k] + problem.B @ v[k],
            problem.tension @ s[k + 1] + limits.tension_margin[k] >= 0,
            v[k] - before[k] >= limits.change_lower[k],
            v[k] - before[k] <= limits.change_upper[k],
        ]
    if problem.following is not None and limits.wanted is not None:
        for k, (pull, r) in enumerate(zip(problem.following.pulls(N), limits.wanted, strict=True)):
            cost += (pull @ r) @ s[k + 1] + (problem.following.inputs @ r) @ v[k]
    rules.append(v <= limits.input_upper)
    held = np.isfinite(limits.input_lower)
    if held.any():
        rules.append(v[held] >= limits.input_lower[held])
    statement = cp.Problem(cp.Minimize(cost), rules)
    statement.solve(solver=cp.CLARABEL, tol_gap_abs=tol, tol_gap_rel=tol, tol_feas=tol, tol_ktratio=tol)
    if v.value is None:
        return np.inf, np.full((N, nu), np.nan)
    return float(np.asarray(statement.value, float)), np.asarray(v.value)


def root(M: np.ndarray) -> np.ndarray:
    """W with W'W = M, for sums of squares; what rounding made negative counts as zero."""
    values, vectors = np.linalg.eigh(M)
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
