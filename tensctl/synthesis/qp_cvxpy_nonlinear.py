"""A step of nonlinear MPC stated once more, in cvxpy, with states and stretches as variables.

    minimise  sum |(e, v)_k|_Q^2/2 + |v_k|_R^2/2 + |(e, v)_N|_P^2/2 + price give_k + curvature give_k^2/2
    e_k = e_k* + S_k X_k (v - v*),   s_k = s_k* + Y_k (v - v*),   side (s_k - limit) + give_k >= 0,   limits of v

Where actuators lag the last of e are rest lengths, which follow commands input by input.

It begins at the rollout and its derivatives X and Y and shares nothing with the condensed H, f and rows, so an error in
condensing or in bounds shows as a difference of optima. Without a price nothing gives way. Lengths are counted in
the largest change of a period and costs in that of the plan: left in metres and joules, Clarabel stops short of 1e-8.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.nonlinear_problem import Linearised
from tensctl.synthesis.qp_cvxpy import root

# Keeps the unit of cost off zero where the plan is at rest at its reference.
_LEAST = 1e-12


def reference_step(
    step: Linearised, price: tuple[float, float] | None = None, tol: float = 1e-12
) -> tuple[float, Float[np.ndarray, "N nu"]]:
    """Solve the sparse problem with Clarabel through cvxpy, to a tolerance of its residuals and gap.

    Parameters
    ----------
    step : Linearised
    price : (float, float), optional
        Of a metre by which a stage's limits of tension give way, and its curvature.
    tol : float

    Returns
    -------
    cost : float
        Infinite without a solution.
    inputs : (N, nu) m
        Deviations from the reference.
    """
    import cvxpy as cp

    (N, nu), bounds, measure, rollout = step.plan.shape, step.bounds, step.measure, step.rollout
    deviations, slopes = step.states()
    unit, effort = np.abs(bounds.change_upper).max(), np.sqrt(step.cost(step.plan) + _LEAST)
    motion, ratio, (Lq, Lp, Lr) = slopes.shape[1], unit / effort, (root(M) for M in (measure.Q, measure.P, measure.R))
    v, e, stretch = cp.Variable((N, nu)), cp.Variable(deviations.shape), cp.Variable((N, bounds.tendons.size))
    give = np.zeros(N) if price is None else cp.Variable(N, nonneg=True)
    moved = v - step.plan / unit
    away = cp.reshape(moved, (N * nu,), order="C")
    change = v - cp.vstack([np.zeros((1, nu)), v[:-1]])
    rules: list = [change >= bounds.change_lower / unit, change <= bounds.change_upper / unit, v <= bounds.upper / unit]
    held = np.isfinite(bounds.lower)
    if held.any():
        rules.append(v[held] >= bounds.lower[held] / unit)
    cost = 0
    for k in range(N):
        by_inputs, by_stretch = rollout.by_inputs[k].reshape(-1, N * nu), rollout.stretch_by_inputs[k, bounds.tendons]
        rules += [
            e[k, :motion] == deviations[k, :motion] / effort + ratio * (slopes[k] @ by_inputs) @ away,
            stretch[k] == rollout.stretches[k, bounds.tendons] / unit + by_stretch @ away,
            cp.multiply(bounds.side, stretch[k] - bounds.limit / unit) + give[k] >= 0,
        ]
        weight = Lp if k == N - 1 else Lq
        cost += cp.sum_squares(weight @ cp.hstack([e[k], ratio * v[k]])) / 2 + cp.sum_squares(ratio * Lr @ v[k]) / 2
    if rollout.inputs_by_plan is not None:
        rules.append(e[:, motion:] == deviations[:, motion:] / effort + ratio * rollout.inputs_by_plan @ moved)
    if price is not None:
        cost += ratio / effort * price[0] * cp.sum(give) + ratio**2 * price[1] * cp.sum_squares(give) / 2
    statement = cp.Problem(cp.Minimize(cost), rules)
    statement.solve(solver=cp.CLARABEL, tol_gap_abs=tol, tol_gap_rel=tol, tol_feas=tol, tol_ktratio=tol)
    if v.value is None:
        return np.inf, np.full((N, nu), np.nan)
    return effort**2 * float(np.asarray(statement.value, float)), unit * np.asarray(v.value)
