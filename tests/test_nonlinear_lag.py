"""Nonlinear MPC of actuators with lag: plans are commands, and rest lengths follow them as the structure's own do."""

from dataclasses import replace

import numpy as np
import pytest
from linear_support import SCENES
from support import disturbed, lively_plan, order_of, shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.linear.state_slopes import states_and_slopes
from tensctl.synthesis.rollout import Rolling, rolling

LAG, DT, HORIZON = 0.1, 0.02, 5
COUNTS = np.array([2, 4, 8])


def mast(lag=LAG, **scene):
    return solved(shell_scene(pins=["P1_*_1"], actuators={"lag": lag}, **scene), outputs=())


def shown(rest, size):
    """A deviation of motion, rest lengths and commands, always the same but for its size."""
    inputs, commands = 0.005 * size * np.random.default_rng(4).standard_normal((2, rest.inputs.size))
    return replace(disturbed(rest, size), inputs=rest.inputs + inputs, commands=rest.inputs + commands)


class Played:
    """A controller that asks for a plan, whatever it is shown."""

    dt = DT

    def __init__(self, plan):
        self.plan = plan

    def reset(self):
        pass

    def step(self, t, measurement):
        return self.plan[min(round(t / DT), HORIZON - 1)]


class TestRollout:
    @pytest.mark.parametrize("lag", [0.02, 0.5])
    @pytest.mark.parametrize("name", ["free", "joints"])
    def test_order_against_the_simulation(self, name, lag, rng):
        """Order 4 towards the simulation of the same commands while tendons stay taut; rest lengths to rounding."""
        scene = SCENES[name]
        scene = scene.model_copy(update={"actuators": scene.actuators.model_copy(update={"lag": lag})})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        plan = rest.inputs + np.cumsum(0.002 * rng.standard_normal((HORIZON, rest.inputs.size)), axis=0)
        run = tc.simulate(dynamics, rest, controller=Played(plan), t_end=HORIZON * DT, rate_max=1.0, tol=1e-12)
        assert run.tensions.min() > 0
        assert run.commands[-1] == pytest.approx(plan[-1], abs=1e-14)
        rolls = [Rolling(dynamics, DT, k, lag)(rest.nodes, 0 * rest.nodes, rest.inputs, plan) for k in COUNTS]
        assert order_of(1 / COUNTS, [np.abs(r.nodes - run.nodes[1:]).max() for r in rolls]) > 3.5
        assert np.abs(rolls[0].inputs - run.inputs[1:]).max() < 1e-14

    @pytest.mark.parametrize("name", ["free EA", "joints, guides, weight"])
    def test_taylor_remainders(self, name, rng):
        """Nodes, velocities, stretches and rest lengths leave remainders of second order, slack tendons among them."""
        dynamics = tc.build_dynamics(SCENES[name])
        nodes, velocities, now, asked, plan = lively_plan(dynamics, rng, HORIZON, lags=True)
        roll, way = replace(rolling(dynamics, DT), lag=LAG), rng.standard_normal(plan.shape)
        here = roll(nodes, velocities, now, plan, commands=asked)
        assert (here.stretches < 0).any()

        def remainder(value, slope):
            def of(step):
                moved = roll(nodes, velocities, now, plan + step * way, commands=asked, columns=False)
                return value(moved) - value(here) - step * slope @ way.ravel()

            return of

        steps = np.array([1e-2, 1e-3]) / 20
        assert taylor_order(remainder(lambda r: r.nodes, here.by_inputs[:, 0]), steps) > 1.9
        assert taylor_order(remainder(lambda r: r.velocities, here.by_inputs[:, 1]), steps) > 1.9
        assert taylor_order(remainder(lambda r: r.stretches, here.stretch_by_inputs), steps) > 1.9
        moved = roll(nodes, velocities, now, plan + way, commands=asked, columns=False)
        assert np.abs(moved.inputs - here.inputs - here.inputs_by_plan @ way).max() < 1e-13

    def test_linear_model_at_rest(self):
        """At an equilibrium the sensitivities are those of `linear.actuated`, with the discretisation's error."""
        dynamics, rest, linear = mast()
        problem, plan = tc.MPC(linear, horizon=HORIZON, dt=DT).problem, np.tile(rest.inputs, (HORIZON, 1))
        wanted, drive, nu = [], np.zeros((problem.A.shape[0], plan.size)), plan.shape[1]
        for k in range(HORIZON):
            drive = problem.A @ drive
            drive[:, k * nu : (k + 1) * nu] += problem.B
            wanted.append(drive[:-nu])
        wanted, errors = np.array(wanted), []
        for k in COUNTS:
            found = Rolling(dynamics, DT, k, LAG)(rest.nodes, 0 * rest.nodes, rest.inputs, plan)
            _, slopes = states_and_slopes(linear, found.nodes, found.velocities)
            ours = np.array([s @ by.reshape(s.shape[1], -1) for s, by in zip(slopes, found.by_inputs, strict=True)])
            errors.append(np.abs(ours - wanted[:, :-nu]).max())
            rest_lengths = np.array([np.kron(row, np.eye(nu)) for row in found.inputs_by_plan])
            assert np.abs(rest_lengths - wanted[:, -nu:]).max() < 1e-13
        assert order_of(1 / COUNTS, errors) > 3.8
        assert errors[-1] < 1e-4 * np.abs(wanted).max()

    def test_a_lag_that_is_not_felt_is_none(self):
        """And a small one changes the first command little: by its first power."""
        commands = []
        for lag in (0.0, 1e-13, 2e-4, 1e-4):
            dynamics, rest, _ = mast(lag)
            controller, seen = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON), disturbed(rest, 1.0)
            commands.append(controller.step(0.0, replace(seen, commands=seen.inputs)))
            assert set(controller.state()) == ({"plan", "followed"} if lag > 1e-9 else {"plan"})
        off = [np.abs(command - commands[0]).max() for command in commands[1:]]
        assert off[0] == 0.0
        assert off[1] / off[2] == pytest.approx(2.0, abs=0.1)


class TestStep:
    @pytest.mark.parametrize("delay", [0.0, 0.013])
    def test_first_command_is_the_linear_controllers(self, delay):
        """The difference to `tc.MPC` is of second order in motion, rest lengths and commands."""
        dynamics, rest, linear = mast()
        ours, known = (
            make(horizon=HORIZON, dt=DT, delay=delay)
            for make in (
                lambda **asked: tc.NonlinearMPC(dynamics, rest, **asked),
                lambda **asked: tc.MPC(linear, **asked),
            )
        )
        sizes, differences = np.array([0.3, 0.1, 0.03]), []
        for size in sizes:
            for controller in (ours, known):
                controller.reset()
                controller.step(0.0, shown(rest, 0.5 * size))
            differences.append(np.abs(ours.step(DT, shown(rest, size)) - known.step(DT, shown(rest, size))).max())
        assert order_of(sizes, differences) > 1.8
        assert differences[0] < 0.05 * np.abs(known.step(DT, shown(rest, 0.3)) - rest.inputs).max()

    def test_a_measurement_without_commands(self):
        dynamics, rest, _ = mast()
        controller = tc.NonlinearMPC(dynamics, rest, horizon=2)
        with pytest.raises(tc.SynthesisError, match=r"lag by 0\.1 s, so a measurement needs commands"):
            controller.step(0.0, disturbed(rest, 0.1))


def test_a_design_that_knows_the_lag_keeps_to_its_path():
    """Where one that does not swings about it."""
    off, target = {}, {"height_scale": 1.1, "duration": 1.5}
    for lag in (0.0, 0.2):
        dynamics, rest, _ = mast(lag, target=target, mpc={})
        path = tc.plan_shape(shell_scene(pins=["P1_*_1"], target=target, mpc={}), start=rest)
        controller = tc.NonlinearMPC(dynamics, path, horizon=HORIZON)
        plant = mast(0.2)[0]
        run = tc.simulate(plant, rest, controller=controller, t_end=1.5, rate_max=0.5)
        off[lag] = max(np.abs(n - path.nodes_at(t)).max() for t, n in zip(run.time, run.nodes, strict=True))
    assert off[0.2] < 0.1 * off[0.0]
