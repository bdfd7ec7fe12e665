"""Certificate of a predictive controller on a run: hard limits, and one step stated again in cvxpy."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensctl.model import Dynamics
from tensctl.simulation import Measurement, Run
from tensctl.synthesis import MPC, NonlinearMPC, OutputMPC, Reading
from tensctl.synthesis.input_limits import input_reach
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_anew import answer
from tensctl.synthesis.qp_cvxpy import reference_optimum
from tensctl.synthesis.qp_cvxpy_nonlinear import reference_step
from tensctl.synthesis.qp_solvers import SOLVERS
from tensctl.synthesis.relaxed import relax
from tensctl.synthesis.weights import Size

_ROUNDING = 1e-12
# Optima below the cost of this change of every input are rounding, and their ratio means nothing.
_MICROMETRE = 1e-6


@dataclass(frozen=True)
class Certificate:
    """What was recomputed after the run.

    Attributes
    ----------
    violations : int
        Recorded times at which a rest length was below its floor, changed by more or faster than allowed.
    below_floor : int
        Recorded times at which a taut tendon of the plant was below the tension floor.
    checked_at : float or None, s
        Time of the step that was stated again; None when every step gave way or fell back, or a
        search that began anew there was bounded.
    cost_difference : float or None
        Difference of the optima of both statements, over the optimum or the cost of a micrometre on every input.
    input_difference : float or None, m
        Largest difference of the first input.
    variables, constraints : int
        Size of the condensed problem.
    riccati_residual : float
        Of the terminal weight.
    travel : float or None
        Largest change of a rest length over the u_max that it has; None without one.
    """

    violations: int
    below_floor: int
    checked_at: float | None
    cost_difference: float | None
    input_difference: float | None
    variables: int
    constraints: int
    riccati_residual: float
    travel: float | None


def certify(mpc: MPC | NonlinearMPC, run: Run) -> Certificate:
    """Check a run's hard limits, and its busiest step."""
    dynamics = mpc.dynamics if isinstance(mpc, NonlinearMPC) else mpc.linear.dynamics
    members = dynamics.members
    low = run.rest_lengths < members.floors - _ROUNDING
    rates = np.abs(np.diff(run.rest_lengths, axis=0)) / np.diff(run.time)[:, None]
    fast = rates > mpc.rate_max * (1 + 1e-9) + _ROUNDING
    lower, upper = mpc.hard.range
    far = (run.inputs < lower - _ROUNDING) | (run.inputs > upper + _ROUNDING)
    k = _busiest(run)
    cost, inputs = (None, None) if k is None else _twice(mpc, run, k)
    variables, rows, riccati = _sizes(mpc)
    return Certificate(
        violations=int(sum(broken.any(axis=1).sum() for broken in (low, fast, far))),
        below_floor=_below(mpc, run),
        checked_at=None if k is None or cost is None else float(run.time[k]),
        cost_difference=cost,
        input_difference=inputs,
        variables=variables,
        constraints=2 * variables + rows,
        riccati_residual=riccati,
        travel=None if mpc.u_max is None else _travel(dynamics, mpc.u_max, run),
    )


def _sizes(mpc: MPC | NonlinearMPC) -> tuple[int, int, float]:
    """Variables and rows of the condensed problem, and the residual of its terminal weight."""
    if isinstance(mpc, NonlinearMPC):
        variables = mpc.horizon * mpc.dynamics.members.gearing.size
        return variables, variables + mpc.horizon * mpc.bounded, mpc.measure.riccati_residual
    return mpc.problem.H.shape[0], mpc.problem.rows.shape[0], mpc.problem.riccati_residual


def _travel(dynamics: Dynamics, u_max: Size, run: Run) -> float:
    """Largest change of an input over the range that u_max leaves it."""
    reach = input_reach(dynamics.structure, dynamics.members, u_max)
    return float((np.abs(run.inputs) / reach).max(initial=0.0))


def _below(mpc: MPC | NonlinearMPC, run: Run) -> int:
    """Recorded times below the floor, of the tendons that have one: taut at the reference, not between pins."""
    watched = run.tensions[:, mpc.floored]
    return int((watched < mpc.tension_min * (1 - 1e-9)).any(axis=1).sum())


def _busiest(run: Run) -> int | None:
    """The recorded control sample with the fastest motion whose problem had a solution within its floors."""
    sampled = np.isin(np.round(run.time, 12), np.round(run.sample_time, 12))
    hard = sampled & np.array([status in SOLVERS for status in run.status])
    speed = np.linalg.norm(run.velocities, axis=2).max(axis=1)
    return int(np.where(hard, speed, -1.0).argmax()) if hard.any() else None


def _twice(mpc: MPC | NonlinearMPC, run: Run, k: int) -> tuple[float | None, float | None]:
    """Differences of cost and first input between one step condensed and as a sparse statement in cvxpy."""
    if isinstance(mpc, NonlinearMPC):
        return _twice_rolled_out(mpc, run, k)
    t = float(run.time[k])
    shown: Any = _measurement(run, k)
    if isinstance(mpc, OutputMPC):
        mpc, shown = _as_then(mpc, run, k)
    problem, limits, qp = mpc.statement(t, shown)
    plan = mpc.solve(t, shown)
    cost, inputs = reference_optimum(problem, limits)
    ours = qp.objective(plan.ravel()) + problem.constant(limits.start, limits.wanted)
    return _apart(ours, cost, qp), float(np.abs(plan[0] - inputs[0]).max())


def _twice_rolled_out(mpc: NonlinearMPC, run: Run, k: int) -> tuple[float | None, float | None]:
    """The same of a nonlinear step that begins anew at what was measured; None when its search was bounded."""
    twin = copy(mpc)
    twin.reset()
    step = twin.linearised(float(run.time[k]), _measurement(run, k))
    qp, horizon = step.qp(), mpc.horizon
    found = answer(qp, horizon)
    if found is None or found[1].endswith("bounded"):
        return None, None
    plan, soft = found[0].reshape(horizon, -1), relax(qp, horizon)
    price = float(soft.f[-1]), float(soft.H[-1, -1])
    cost, inputs = reference_step(step, None if found[1] in SOLVERS else price)
    give = step.beyond(plan).max(axis=1, initial=0.0) * (found[1] not in SOLVERS)
    ours = step.cost(plan) + price[0] * give.sum() + 0.5 * price[1] * give @ give
    return _apart(ours, cost, qp), float(np.abs(plan[0] - inputs[0]).max())


def _apart(ours: float, cost: float, qp: QP) -> float:
    """Difference of two optima, over the larger or the cost of a micrometre on every input."""
    smallest = 0.5 * _MICROMETRE**2 * float(np.trace(qp.H))
    return float(abs(ours - cost) / max(abs(ours), abs(cost), smallest))


def _measurement(run: Run, k: int) -> Measurement:
    commands = None if run.commands is None else run.commands[k]
    return Measurement(run.nodes[k], run.velocities[k], run.lengths[k], run.tensions[k], run.inputs[k], commands)


def _as_then(mpc: OutputMPC, run: Run, k: int) -> tuple[OutputMPC, Reading]:
    """A controller that remembers what this one did before record k, and what it read there."""
    twin = copy(mpc)
    twin.reset()
    rows = np.searchsorted(np.round(run.time, 12), np.round(run.sample_time, 12))
    for sample, row in enumerate(rows.tolist()):
        reading = mpc.sensors.read(_measurement(run, row), sample)
        if row == k:
            return twin, reading
        twin.observe(float(run.time[row]), reading)
    raise AssertionError("record k is a control sample")
