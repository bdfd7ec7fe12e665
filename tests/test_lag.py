"""Designs for actuators with lag: rest lengths are states, commands are inputs, and the loop that is designed runs."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as sla
from support import shell_scene

import tensctl as tc
from tensctl.linear import sample_ramped
from tensctl.synthesis.lagging import commands_along, followed

LAG, PINS = 0.2, ["P1_*_1"]
PUSH = tc.Push("P4_1_1", (1.0, 0.0, 0.0), 0.1, 0.3)


def at_rest(lag=LAG, **scene):
    actuators = {"lag": lag} | scene.pop("actuators", {})
    asked = shell_scene(**{"pins": PINS} | scene, actuators=actuators)
    dynamics, rest = tc.build_dynamics(asked), tc.find_equilibrium(asked)
    return dynamics, rest, tc.linearize(dynamics, rest)


@pytest.fixture(scope="module")
def mast():
    return at_rest()


def predictive(mast, model, **asked):
    dynamics, rest, linear = mast
    if model == "linear":
        return tc.MPC(linear, horizon=5, **asked)
    return tc.NonlinearMPC(dynamics, rest, horizon=5, **asked)


def eyes(dynamics):
    return tc.sensors(dynamics.structure, lengths=1e-4, tensions=0.01)


class TestTheModel:
    def test_it_is_the_mechanics_behind_a_first_order_lag(self, mast):
        """Transfer functions: commands reach outputs as rest lengths do, times 1/(1 + tau s)."""
        linear = mast[2].flexible
        driven = linear.actuated
        for s in (0.3j, 4.0j, 1.0 + 20.0j):
            plain, behind = (
                m.C @ np.linalg.solve(s * np.eye(len(m.A)) - m.A, m.B) + m.D for m in (linear, driven)
            )  # fmt: skip
            assert np.abs(behind - plain / (1 + LAG * s)).max() <= 1e-12 * np.abs(plain).max()

    def test_a_scene_without_lag_keeps_its_model(self):
        linear = at_rest(lag=0.0)[2]
        assert linear.actuated is linear
        assert at_rest(lag=1e-13)[2].actuated.lag == 0.0  # less than a billionth of a radian of the fastest mode

    def test_commands_move_the_structure_as_the_model_says(self, mast):
        """Taylor: what the linear model misses of a ramped command falls with its square."""
        dynamics, rest, linear = mast
        driven, dt = linear.flexible.actuated, 0.2
        s = sample_ramped(driven.A, driven.B, dt)
        way = np.random.default_rng(3).standard_normal(len(driven.inputs))
        missed = []
        for size in (2e-4, 1e-4, 5e-5):
            plan = [
                tc.Schedule(label.removeprefix("u_"), [0.0, dt], [0.0, size * u])
                for label, u in zip(linear.inputs, way, strict=True)
            ]
            run = tc.simulate(dynamics, rest, timepts=[0.0, dt], schedule=plan, tol=1e-13)
            x = driven.seen(run.nodes[-1], run.velocities[-1], run.inputs[-1])
            missed.append(np.linalg.norm(x - s.G1 @ (size * way)))
        orders = np.log2(np.divide(missed[:-1], missed[1:]))
        assert np.abs(orders - 2).max() < 0.1

    def test_states_are_labelled_for_python_control(self, mast):
        system = mast[2].actuated.to_statespace()
        assert system.state_labels[-1] == f"now_{mast[2].inputs[-1]}"
        assert system.ninputs == len(mast[2].inputs)


class TestStateFeedback:
    def test_cost_to_go_is_the_physical_cost_of_the_loop(self, mast):
        """x'Px is the integral of x'Qx + 2 x'Nu + u'Ru + (c - u)'R(c - u) along the closed loop, by quadrature."""
        linear = mast[2]
        flexible = linear.flexible
        cost = tc.weights(linear, energy=0.1, tensions=2.0)
        design = tc.lqr(linear, cost=cost)
        nx = len(flexible.A)
        x0 = np.random.default_rng(5).standard_normal(len(design.A))
        loop = design.A - design.B @ design.K
        grid, step = np.linspace(0.0, 20.0, 40001, retstep=True)
        over, path = sla.expm(step * loop), np.empty((grid.size, x0.size))
        path[0] = x0
        for k in range(grid.size - 1):
            path[k + 1] = over @ path[k]
        x, u, c = path[:, :nx], path[:, nx:], -path @ design.K.T
        rate = np.einsum("ti,ij,tj->t", path, cost.matrix, path) + np.einsum("ti,ij,tj->t", c - u, cost.R, c - u)
        assert x.shape[1] + u.shape[1] == x0.size
        simpson = step / 3 * (rate[0] + rate[-1] + 4 * rate[1:-1:2].sum() + 2 * rate[2:-1:2].sum())
        assert simpson == pytest.approx(x0 @ design.P @ x0, rel=1e-8)

    def test_a_vanishing_lag_leaves_the_gain_without(self):
        """First order in the lag."""
        plain = tc.lqr(at_rest(lag=0.0)[2]).K
        off = [np.abs(tc.lqr(at_rest(lag=lag)[2]).K[:, : plain.shape[1]] - plain).max() for lag in (2e-4, 1e-4)]
        assert off[0] / off[1] == pytest.approx(2.0, abs=0.05)

    @pytest.mark.parametrize("dt", [None, 0.02])
    def test_harmonics_give_the_same(self, mast, dt):
        dynamics, rest, linear = mast
        dense, ours = tc.lqr(linear, dt=dt), tc.harmonic_lqr(tc.harmonics(dynamics, rest), dt=dt)
        K, P = ours.dense(linear)
        ours.verify()
        assert np.abs(K - dense.K).max() <= 1e-12 * np.abs(dense.K).max()
        assert np.abs(P - dense.P).max() <= 1e-12 * np.abs(dense.P).max()
        assert ours.expected_cost() == pytest.approx(dense.expected_cost(), rel=1e-12)

    def test_gains_that_do_not_know_of_the_lag_let_the_loop_swing_up(self, mast):
        """So the tests of loops can fail: the same weights without the lag leave an unstable loop with it."""
        driven, blind = mast[2].flexible.actuated, tc.lqr(at_rest(lag=0.0)[2])
        K = np.hstack([blind.K, np.zeros((len(blind.K), len(blind.K)))])
        assert np.real(np.linalg.eigvals(driven.A - driven.B @ K)).max() > 0.1


class TestLoops:
    @pytest.mark.parametrize(
        "design",
        [
            lambda d, e, m: tc.lqr(m),
            lambda d, e, m: tc.lqr(m, dt=0.02),
            lambda d, e, m: tc.harmonic_lqr(tc.harmonics(d, e), dt=0.02),
            lambda d, e, m: tc.lqg(m, eyes(d), dt=0.02),
            lambda d, e, m: tc.harmonic_lqg(tc.harmonics(d, e), eyes(d), dt=0.02),
            lambda d, e, m: tc.MPC(m, horizon=10),
            lambda d, e, m: tc.MPC(m, horizon=10, delay=0.013),
            lambda d, e, m: tc.OutputMPC(m, eyes(d), horizon=10),
            lambda d, e, m: tc.NonlinearMPC(d, e, horizon=10),
            lambda d, e, m: tc.NonlinearMPC(d, e, horizon=10, delay=0.013),
        ],
    )
    def test_a_push_is_calmed(self, mast, design):
        dynamics, rest, linear = mast
        run = tc.simulate(dynamics, rest, controller=design(dynamics, rest, linear), t_end=6.0, pushes=[PUSH])
        off = run.distance_to(rest.nodes)
        assert 0.02 < off.max() < 0.03
        assert off[-1] < 2e-4

    def test_lqg_separates_and_is_what_the_nonlinear_loop_does(self, mast):
        dynamics, _, linear = mast
        design = tc.lqg(linear, eyes(dynamics), dt=0.02)
        design.verify()
        assert design.separation is not None
        assert design.separation < 1e-8
        regulator = tc.lqr(linear, dt=0.02)
        assert design.slowest == pytest.approx(regulator.slowest, rel=1e-8)

    def test_a_path_is_followed_as_without_lag(self):
        """Commands lead the rest lengths that the path needs: u + tau du/dt."""
        worst = {}
        for lag in (0.0, LAG):
            scene = shell_scene(pins=PINS, actuators={"lag": lag}, target={"height_scale": 1.1, "duration": 2.0})
            dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
            path = tc.plan_shape(scene, start=rest)
            linear = tc.linearize(dynamics, path.target)
            for make in (
                lambda p, d, m: tc.MPC(m, horizon=10, path=p),
                lambda p, d, m: tc.scheduled_lqr(p, d, lambda one: tc.lqr(one, dt=0.02)),
            ):
                run = tc.simulate(dynamics, rest, controller=make(path, dynamics, linear), t_end=2.5, rate_max=0.5)
                off = [np.abs(n - path.nodes_at(t)).max() for t, n in zip(run.time, run.nodes, strict=True)]
                worst.setdefault(lag, []).append(max(off))
        assert np.divide(worst[LAG], worst[0.0]).max() < 1.1

    def test_hard_limits_hold_for_commands_and_rest_lengths(self):
        dynamics, rest, linear = at_rest(actuators={"floor": 0.6})
        mpc = tc.MPC(linear, horizon=10, rate_max=0.1)
        hit = tc.Push("P4_1_1", (12.0, 0.0, 0.0), 0.1, 0.3)
        run = tc.simulate(dynamics, rest, controller=mpc, t_end=2.0, pushes=[hit], rate_max=0.1)
        assert run.commands is not None
        upper = dynamics.members.input_bounds[1]
        assert (run.commands <= upper).all()
        assert (run.inputs <= upper).all()
        speed = np.abs(np.diff(run.commands, axis=0)).max() / mpc.dt
        assert 0.099 < speed <= 0.1 * (1 + 1e-9)

    @pytest.mark.parametrize("model", ["linear", "nonlinear"])
    def test_inputs_that_are_not_measured_follow_the_commands(self, mast, model):
        """The controller carries the lag along: rest lengths that are never told change nothing of a run."""
        dynamics, rest, _ = mast

        class Blind:
            def __init__(self):
                self.mpc = predictive(mast, model, delay=0.007)
                self.dt, self.delay = self.mpc.dt, self.mpc.delay

            def reset(self):
                self.mpc.reset()

            def step(self, t, shown):
                return self.mpc.step(t, replace(shown, inputs=np.full_like(shown.inputs, np.nan)))

        told, untold = (
            tc.simulate(dynamics, rest, controller=controller, t_end=1.0, pushes=[PUSH])
            for controller in (predictive(mast, model, delay=0.007), Blind())
        )
        assert np.abs(told.nodes - untold.nodes).max() < 1e-12
        assert np.ptp(told.inputs, axis=0).max() > 1e-3

    @pytest.mark.parametrize("model", ["linear", "nonlinear"])
    def test_a_stored_run_goes_on_to_the_last_bit(self, mast, tmp_path, model):
        dynamics, rest, _ = mast
        whole = tc.simulate(dynamics, rest, controller=predictive(mast, model), t_end=0.6, pushes=[PUSH])

        class Tired:
            def __init__(self, mpc):
                self.mpc, self.dt, self.tired = mpc, mpc.dt, True
                self.reset, self.state, self.restore = mpc.reset, mpc.state, mpc.restore

            def step(self, t, measurement):
                if t > 0.4 and self.tired:
                    raise KeyboardInterrupt
                return self.mpc.step(t, measurement)

        mpc, file = Tired(predictive(mast, model)), tmp_path / "run.nc"
        with pytest.raises(KeyboardInterrupt):
            tc.simulate(dynamics, rest, controller=mpc, t_end=0.6, pushes=[PUSH], store=file, chunk=10)
        mpc.tired = False
        tc.resume(dynamics, file, controller=mpc)
        again = tc.Run.load(file)
        assert np.array_equal(again.nodes, whole.nodes)
        assert np.array_equal(again.commands, whole.commands)


class TestWhatIsSaid:
    def test_commands_are_recorded_where_rest_lengths_lag(self, mast, tmp_path):
        """And rest lengths are what the lag makes of them."""
        dynamics, rest, linear = mast
        run = tc.simulate(dynamics, rest, controller=tc.lqr(linear, dt=0.02), t_end=1.0, pushes=[PUSH])
        c, u = run.commands, run.inputs
        for k in range(len(c) - 1):
            after = followed(LAG, u[k], [(run.time[k + 1] - run.time[k], c[k], c[k + 1])])
            assert np.abs(after - u[k + 1]).max() < 1e-14
        assert np.array_equal(tc.Run.load(run.save(tmp_path / "run.nc")).commands, c)
        plain, start, _ = at_rest(lag=0.0)
        assert tc.simulate(plain, start, t_end=0.1).commands is None

    def test_followed_is_the_solution_of_its_equation(self):
        """tau u' = c - u with c on a line, by finely held steps."""
        u0, c0, c1, t = np.array([0.3]), np.array([0.1]), np.array([-0.5]), 0.7
        n = 200_000
        u, h = u0.copy(), t / n
        for k in range(n):
            c = c0 + (k + 0.5) / n * (c1 - c0)
            u = c + np.exp(-h / LAG) * (u - c)
        assert np.abs(followed(LAG, u0, [(t, c0, c1)]) - u).max() < 1e-10

    def test_commands_of_a_path_bring_rest_lengths_along_it(self):
        """Second order in the period."""

        class Swing:
            def inputs_at(self, t):
                return np.sin(3.0 * np.atleast_1d(t))[:, None]

        off = []
        for dt in (0.04, 0.02, 0.01):
            times = np.linspace(0.0, 2.0, round(2.0 / dt) + 1)
            c = commands_along(Swing(), times, LAG, dt)
            u = Swing().inputs_at(0.0)[0]
            for k in range(len(times) - 1):
                u = followed(LAG, u, [(dt, c[k], c[k + 1])])
            off.append(abs(u - Swing().inputs_at(times[-1])[0]).max())
        assert np.abs(np.log2(np.divide(off[:-1], off[1:])) - 2).max() < 0.2

    def test_a_measurement_without_commands(self, mast):
        _, rest, linear = mast

        class Bare:
            nodes, velocities = rest.nodes, np.zeros_like(rest.nodes)
            inputs = rest.inputs

        with pytest.raises(tc.SynthesisError, match=r"lag by 0\.2 s, so a measurement needs commands"):
            tc.lqr(linear, dt=0.02).step(0.0, Bare())
