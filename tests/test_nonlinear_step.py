"""A step of nonlinear MPC stated otherwise: CasADi's derivatives, a QP in cvxpy, the nonlinear problem itself."""

from dataclasses import replace

import numpy as np
import pytest
from casadi_rollout import rolled_out
from linear_support import SCENES
from support import disturbed, lively_plan, shell_scene, solved

import tensctl as tc
from tensctl.synthesis.qp_anew import answer
from tensctl.synthesis.qp_cvxpy_nonlinear import reference_step
from tensctl.synthesis.qp_lazy import solve_lazily
from tensctl.synthesis.relaxed import relax
from tensctl.synthesis.rollout import rolling

DT, HORIZON = 0.02, 5
KINDS = ["mixed pins", "free EA", "free damped", "weight", "cables, pinned damped EA", "plane"]
KINDS += ["joints, guides, weight", "guides, damped EA", "plane, joint, guide, cable"]
KINDS += ["three rods in a joint, EA, damped, weight"]


@pytest.fixture(scope="module")
def steering(mast):
    return tc.NonlinearMPC(mast[0], mast[1], horizon=HORIZON)


@pytest.fixture
def controller(steering):
    steering.reset()
    return steering


@pytest.mark.parametrize("name", KINDS)
def test_derivatives_are_those_of_casadi(name, rng):
    """Slack tendons, clamped dampers, cables: the own tangents are the algorithmic derivatives of the same steps."""
    dynamics = tc.build_dynamics(SCENES[name])
    nodes, velocities, now, _, plan = lively_plan(dynamics, rng, HORIZON)
    roll = rolling(dynamics, DT)
    ours = roll(nodes, velocities, now, plan)
    theirs = rolled_out(dynamics, DT, roll.steps, nodes, velocities, now, plan)
    assert name.startswith("plane") or (ours.stretches < 0).any()
    for part in ("nodes", "velocities", "stretches", "by_inputs", "stretch_by_inputs"):
        known = getattr(theirs, part)
        assert np.abs(getattr(ours, part) - known).max() < 1e-12 * np.abs(known).max()


@pytest.mark.parametrize("lag", [1e-3, 0.05, 2.0])
@pytest.mark.parametrize("name", ["cables, pinned damped EA", "plane, joint, guide, cable"])
def test_derivatives_behind_a_lag_are_those_of_casadi(name, lag, rng):
    """Rest lengths that are elsewhere than commands, and follow all that the plan has asked for so far."""
    dynamics = tc.build_dynamics(SCENES[name])
    nodes, velocities, now, commands, plan = lively_plan(dynamics, rng, HORIZON, lags=True)
    roll = replace(rolling(dynamics, DT), lag=lag)
    ours = roll(nodes, velocities, now, plan, commands=commands)
    theirs = rolled_out(dynamics, DT, roll.steps, nodes, velocities, now, plan, lag=lag, commands=commands)
    for part in ("nodes", "velocities", "stretches", "by_inputs", "stretch_by_inputs", "inputs", "inputs_by_plan"):
        known = getattr(theirs, part)
        assert np.abs(getattr(ours, part) - known).max() < 1e-12 * np.abs(known).max()


class TestStatedInCvxpy:
    """The answer of a step is the optimum of the problem stated with states, about a plan that CasADi rolled out."""

    def agrees(self, controller, seen, relaxed):
        step = controller.linearised(0.0, seen)
        plan = step.plan + controller.reference.inputs_at(0.0)
        roll, shown = controller._roll, (seen.nodes, seen.velocities, seen.inputs, plan)
        known = rolled_out(controller.dynamics, DT, roll.steps, *shown, lag=roll.lag, commands=seen.commands)
        (z, status, kkt), qp = answer(step.qp(), HORIZON), step.qp()
        soft, found = relax(qp, HORIZON), z.reshape(HORIZON, -1)
        price = (soft.f[-1], soft.H[-1, -1]) if relaxed else None
        cost, inputs = reference_step(replace(step, rollout=known), price)
        give = step.beyond(found).max(axis=1) * relaxed
        ours = step.cost(found) + soft.f[-1] * give.sum() + soft.H[-1, -1] / 2 * give @ give
        assert status.endswith("relaxed") == relaxed
        assert kkt < 1e-9
        assert abs(ours - cost) < 1e-8 * cost
        assert np.abs(found - inputs).max() < 1e-8
        assert qp.violation(z) < 1e-9 or relaxed
        return qp, z, give

    @pytest.mark.parametrize(("size", "least"), [(0.05, 0), (1.0, 10), (2.0, 30)])
    def test_floors_kept(self, mast, controller, size, least):
        qp, z, _ = self.agrees(controller, disturbed(mast[1], size), relaxed=False)
        gaps = np.minimum(qp.values(z) - qp.lower, qp.upper - qp.values(z))
        assert (gaps < 1e-9).sum() >= least

    @pytest.mark.parametrize("size", [4.0, 6.0])
    def test_floors_that_give_way(self, mast, controller, size):
        _, _, give = self.agrees(controller, disturbed(mast[1], size), relaxed=True)
        assert give.max() > 1e-2

    def test_every_tendon_slack(self, mast, controller):
        dynamics, rest, _ = mast
        u = -0.35 * dynamics.members.rest_lengths[dynamics.members.inputs]
        seen = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, 0 * rest.tensions, u)
        step = controller.linearised(0.0, seen)
        assert (step.rollout.stretches[0, step.bounds.tendons] < 0).all()
        _, _, give = self.agrees(controller, seen, relaxed=True)
        assert give.max() > 0.1

    def test_joints_and_guides(self):
        dynamics, rest, _ = solved(SCENES["joints, guides, weight"], outputs=())
        controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON)
        self.agrees(controller, disturbed(rest, 0.5), relaxed=False)

    @pytest.mark.parametrize(("size", "relaxed"), [(0.5, False), (4.0, True)])
    def test_actuators_with_lag(self, size, relaxed):
        """Rest lengths are states beside the motion, weighed through tensions and at the end."""
        dynamics, rest, _ = solved(shell_scene(pins=["P1_*_1"], actuators={"lag": 0.1}), outputs=())
        weights = tc.Weights(outputs={"tensions": 0.5})
        controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, weights=weights)
        shift = 0.01 * np.random.default_rng(3).standard_normal((2, rest.inputs.size))
        seen = replace(disturbed(rest, size), inputs=rest.inputs + shift[0], commands=rest.inputs + shift[1])
        self.agrees(controller, seen, relaxed=relaxed)

    def test_stall_limits(self):
        scene = shell_scene(pins=["P1_*_1"], actuators={"force_max": 13.5})
        dynamics, rest, _ = solved(scene, outputs=())
        controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON)
        qp, z, _ = self.agrees(controller, disturbed(rest, 1.0), relaxed=False)
        stalling = np.flatnonzero(np.tile(controller._limited[1] < 0, HORIZON))
        assert (qp.A[stalling] @ z - qp.lower[z.size + stalling] < 1e-9).any()


def test_iterations_end_where_the_nonlinear_problem_is_stationary(mast, controller):
    """Lagrangian of the problem itself, each term by a roll-out without derivatives: no way leads down."""
    dynamics, rest, _ = mast
    seen, many = disturbed(rest, 2.0), tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, iterations=12)
    many.step(0.0, seen)
    plan, ahead = many.state()["plan"], np.tile(rest.inputs, (HORIZON, 1))
    step = controller.linearised(0.0, seen, plan)
    qp = step.qp()
    y = solve_lazily(qp).y
    pushed = y[qp.f.size : qp.f.size + step.bounds.tendons.size * HORIZON].reshape(HORIZON, -1) * step.bounds.side
    rest_of_y = y.copy()
    rest_of_y[qp.f.size : qp.f.size + pushed.size] = 0.0
    measure = step.measure

    def lagrangian(plan):
        rollout = controller._roll(seen.nodes, seen.velocities, seen.inputs, plan, columns=False)
        v, total = plan - ahead, 0.0
        for k, at in enumerate(zip(rollout.nodes, rollout.velocities, v, strict=True)):
            there = np.append(measure.linear.state_of(*at[:2]), at[2])
            weight = measure.P if k == HORIZON - 1 else measure.Q
            total += 0.5 * there @ weight @ there + 0.5 * at[2] @ measure.R @ at[2]
        total += (pushed * rollout.stretches[:, step.bounds.tendons]).sum()
        return total + rest_of_y @ qp.values(v.ravel())

    h, slopes = 1e-5, []
    for way in np.eye(plan.size):
        way = h * way.reshape(plan.shape)
        slopes.append((lagrangian(plan + way) - lagrangian(plan - way)) / (2 * h))
    terms = np.abs(qp.H @ (plan - ahead).ravel() + qp.f).max()
    assert (pushed != 0).sum() >= 3
    assert np.abs(slopes).max() < 1e-8 * terms
