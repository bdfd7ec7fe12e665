"""Inputs over time are what they say: loads that push, swing and follow tables, schedules, rate limits and lag."""

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc
from tensctl.simulation import momenta
from tensctl.simulation.schedule import limited


@pytest.fixture(scope="module")
def mast():
    return solved(shell_scene(pins=["P1_*_1"]))


@pytest.fixture(scope="module")
def free():
    return tc.build_dynamics(shell_scene()), tc.find_equilibrium(shell_scene())


class TestLoads:
    """The momentum of a free structure is the integral of what acts on it."""

    @pytest.mark.parametrize("method", ["splitting6", "splitting4", "dopri5"])
    def test_wave(self, free, method):
        dynamics, rest = free
        force, f, phase = np.array([3.0, -2.0, 1.0]), 1.7, 0.4
        wave = tc.Wave("P4_1_1", force, frequency=f, phase=phase, start=0.1, stop=0.9)
        run = tc.simulate(dynamics, rest, timepts=[0.0, 0.05, 0.5, 1.3], pushes=[wave], method=method)
        omega = 2 * np.pi * f

        def impulse(t):
            return (np.cos(omega * 0.1 + phase) - np.cos(omega * min(t, 0.9) + phase)) / omega * (t > 0.1)

        wanted = np.array([impulse(t) * force for t in run.time])
        assert np.abs(momenta(dynamics, run)[0] - wanted).max() < 1e-9

    @pytest.mark.parametrize("method", ["splitting6", "dopri5"])
    def test_history(self, free, method):
        dynamics, rest = free
        times, factors = [0.2, 0.5, 0.9], [0.0, 2.0, -1.0]
        history = tc.History("P4_*", times, np.outer(factors, [1.0, 0.0, 2.0]).tolist())
        run = tc.simulate(dynamics, rest, timepts=[0.0, 0.35, 0.5, 0.9, 1.1], pushes=[history], method=method)
        # 3 nodes; trapezoids: 0 to 0.35 s, 0.5, 0.9, and -1 held for 0.2 s after the last time
        wanted = 3 * np.outer(np.array([0, 0.075, 0.3, 0.5, 0.3]), [1.0, 0.0, 2.0])
        assert np.abs(momenta(dynamics, run)[0] - wanted).max() < 1e-10

    def test_pushes_that_come_and_go(self, free):
        """Each of the sets that act at once counts for as long as it acts, and again when it comes back."""
        dynamics, rest = free
        a, b = np.array([3.0, 0.0, 1.0]), np.array([0.0, -2.0, 0.0])
        times = [(a, 0.1, 0.4), (b, 0.3, 0.6), (a, 0.7, 0.8)]
        pushes = [tc.Push(f"P4_{k + 1}_1", force.tolist(), *span) for k, (force, *span) in enumerate(times)]
        run = tc.simulate(dynamics, rest, timepts=np.linspace(0, 1, 21), pushes=pushes)
        wanted = sum(force * (np.clip(run.time, on, off) - on)[:, None] for force, on, off in times)
        assert np.abs(momenta(dynamics, run)[0] - wanted).max() < 1e-10

    def test_scene_asks_for_them(self, tmp_path):
        scene = shell_scene(
            equilibrium={},
            simulation={
                "t_end": 0.5,
                "wave": [{"node": "P4_1_1", "force": [1, 0, 0], "frequency": 2.0}],
                "history": [{"node": "P4_2_1", "force": [0, 1, 0], "times": [0, 0.5], "factors": [0, 1]}],
            },
        )
        run = tc.run(scene, tmp_path / "out").run
        assert run is not None
        linear, _ = momenta(tc.build_dynamics(scene), run)
        assert linear[-1] == pytest.approx([0.0, 0.25, 0.0], abs=1e-9)
        assert np.abs(linear[:, 0]).max() > 0.1

    @pytest.mark.parametrize(
        ("times", "forces", "sentence"),
        [
            ([0.0, 0.0], [[1, 0, 0]] * 2, "must be finite and ascending"),
            ([0.0, 1.0], [[1, 0, 0]], r"have shape \(1, 3\); finite \(2, 3\) is expected"),
            ([], [], "must be finite and ascending"),
        ],
    )
    def test_bad_histories(self, times, forces, sentence):
        with pytest.raises(tc.SimulationError, match=sentence):
            tc.History("P4_1_1", times, forces)

    def test_bad_waves(self):
        with pytest.raises(tc.SceneError, match="frequency is 0; expected a finite number > 0"):
            tc.Wave("P4_1_1", [1, 0, 0], frequency=0)


class TestSchedule:
    def test_straight_lines_between_times(self, mast):
        dynamics, rest, _ = mast
        plan = tc.Schedule("t5_*", [0.0, 0.4, 1.0], [0.0, 0.06, -0.02])
        run = tc.simulate(dynamics, rest, t_end=1.5, schedule=[plan])
        chosen = [label.startswith("t5_") for label in run.input_labels]
        wanted = np.interp(run.time, plan.times, plan.change)
        assert np.abs(run.inputs[:, chosen] - wanted[:, None]).max() < 1e-15
        assert (run.inputs[:, np.logical_not(chosen)] == 0).all()

    def test_rate_limit_moves_the_corners(self, mast):
        """The limited path has no greater speed than allowed, and joins the wanted one where it can."""
        dynamics, rest, _ = mast
        plan = tc.Schedule("t5_1_1", [0.0, 0.1, 2.0], [0.0, 0.05, 0.02])
        run = tc.simulate(dynamics, rest, timepts=np.linspace(0, 2, 401), schedule=[plan], rate_max=0.1)
        u = run.inputs[:, list(run.input_labels).index("t5_1_1")]
        wanted = np.interp(run.time, plan.times, plan.change)
        # 0.1 m/s until 0.1 t = 0.05 - 0.03/1.9 (t - 0.1)
        meet = (0.05 + 0.003 / 1.9) / (0.1 + 0.03 / 1.9)
        assert np.abs(u - np.where(run.time < meet, 0.1 * run.time, wanted)).max() < 1e-14

    def test_limited_paths_by_brute_force(self):
        """Against small explicit steps of du/dt = clip(wanted - u)."""
        rng = np.random.default_rng(3)
        for _ in range(20):
            times = np.cumsum(rng.uniform(0.1, 1.0, 6))
            change, limit = rng.uniform(-1, 1, 6), rng.uniform(0.3, 3.0)
            corners, values = limited(times, change, 0.2, limit)
            assert (np.diff(corners) > 0).all()
            assert np.abs(np.diff(values) / np.diff(corners)).max() < limit * (1 + 1e-9)
            t, u, h = 0.0, 0.2, 1e-4
            line = np.concatenate([[0.0], times]), np.concatenate([[0.2], change])
            while t < times[-1] + 1:
                assert abs(np.interp(t, corners, values) - u) < 20 * limit * h
                t += h
                u += np.clip(np.interp(t, *line) - u, -limit * h, limit * h)

    def test_refusals(self, mast):
        dynamics, rest, _ = mast

        def refused(sentence, *schedule, **given):
            with pytest.raises(tc.SimulationError, match=sentence):
                tc.simulate(dynamics, rest, t_end=0.1, schedule=schedule, **given)

        refused("t2_1_1 has no acting actuator", tc.Schedule("t2_1_1", [0.0], [0.0]))
        refused("t5_1_1 has two schedules", tc.Schedule("t5_*", [0, 1], [0, 0]), tc.Schedule("t5_1_1", [0, 1], [0, 0]))
        refused("begin with that, or give a rate_max", tc.Schedule("t5_1_1", [0, 1], [0.1, 0]))

        class Still:
            dt = 0.1

            def reset(self):
                pass

            def step(self, t, measurement):
                return measurement.inputs

        refused("a schedule or a controller, not both", tc.Schedule("t5_1_1", [0, 1], [0, 0]), controller=Still())
        with pytest.raises(tc.SimulationError, match="2 times and changes of shape"):
            tc.Schedule("t5_1_1", [0, 1], [0.0])


class TestLag:
    @pytest.mark.parametrize("method", ["splitting6", "dopri5"])
    def test_rest_lengths_follow_a_ramp_with_first_order_lag(self, method):
        """u' = (c - u)/tau for c = r t: u = r (t - tau (1 - exp(-t/tau)))."""
        scene = shell_scene(pins=["P1_*_1"], actuators={"lag": 0.15})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        plan = tc.Schedule("t5_1_1", [0.0, 2.0], [0.0, 0.1])
        run = tc.simulate(dynamics, rest, t_end=2.0, schedule=[plan], method=method)
        u = run.inputs[:, list(run.input_labels).index("t5_1_1")]
        t = run.time
        assert np.abs(u - 0.05 * (t - 0.15 * (1 - np.exp(-t / 0.15)))).max() < 1e-15

    def test_a_lagged_motion_is_that_of_its_rest_lengths(self):
        """The same rest lengths without lag, given as a fine table, move the structure the same way."""
        lagged = shell_scene(pins=["P1_*_1"], actuators={"lag": 0.1})
        plain = shell_scene(pins=["P1_*_1"])
        rest, plan = tc.find_equilibrium(plain), tc.Schedule("t5_*", [0.0, 0.5], [0.0, 0.05])
        run = tc.simulate(tc.build_dynamics(lagged), rest, t_end=1.0, schedule=[plan])
        grid = np.linspace(0, 1, 801)
        u = run.inputs[:, list(run.input_labels).index("t5_1_1")]
        fine = tc.simulate(tc.build_dynamics(lagged), rest, timepts=grid, schedule=[plan])
        u = fine.inputs[:, list(fine.input_labels).index("t5_1_1")]
        table = tc.Schedule("t5_*", grid, u)
        other = tc.simulate(tc.build_dynamics(plain), rest, timepts=run.time, schedule=[table])
        assert np.abs(other.nodes - run.nodes).max() < 2e-7
        assert np.abs(run.nodes - rest.nodes).max() > 1e-2

    def test_a_controller_sees_the_rest_lengths_as_they_are(self):
        scene = shell_scene(pins=["P1_*_1"], actuators={"lag": 0.2, "rate_max": 0.4})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        seen = []

        class Step:
            dt = 0.1

            def reset(self):
                seen.clear()

            def step(self, t, measurement):
                seen.append(measurement.inputs[0])
                return np.full(21, 0.1)

        run = tc.simulate(dynamics, rest, controller=Step(), t_end=1.0)
        assert seen == pytest.approx(run.inputs[:, 0].tolist(), abs=0)
        # the command needs 0.25 s at 0.4 m/s, the lag then closes the rest of the gap
        assert np.abs(np.diff(run.inputs[:, 0])).max() < 0.4 * 0.1
        late = run.inputs[-3:, 0]
        assert (0.1 - late[1:]) / (0.1 - late[:-1]) == pytest.approx(np.exp(-0.1 / 0.2), rel=1e-9)


class TestInitialMotion:
    def test_velocity_and_spin(self, tmp_path):
        scene = shell_scene(
            equilibrium={},
            simulation={"t_end": 0.2, "velocity": [1, 2, 3], "spin": [0.5, 0, -0.3], "start": "equilibrium"},
        )
        results = tc.run(scene, tmp_path / "out")
        run = results.run
        assert run is not None
        linear, _ = momenta(tc.build_dynamics(scene), run)
        assert linear[0] == pytest.approx(6 * np.array([1, 2, 3]))
        assert run.nodes[0] == pytest.approx(results.equilibrium.nodes)
        middle = run.nodes[0].mean(axis=0)
        assert run.velocities[0] == pytest.approx(
            np.array([1, 2, 3]) + np.cross([0.5, 0, -0.3], run.nodes[0] - middle), abs=1e-9
        )

    def test_where_a_run_starts(self, tmp_path):
        """Nothing disturbs it: from the initial nodes; a push: from the equilibrium; as asked otherwise."""
        push = [{"node": "P4_1_1", "force": [1, 0, 0], "from": 0, "to": 0.1}]
        for given, rests in (({}, False), ({"push": push}, True), ({"push": push, "start": "nodes"}, False)):
            results = tc.run(shell_scene(equilibrium={}, simulation={"t_end": 0.1} | given), tmp_path / "out")
            assert results.run is not None
            wanted = results.equilibrium.nodes if rests else results.structure.nodes
            assert np.abs(results.run.nodes[0] - wanted).max() < 1e-14
