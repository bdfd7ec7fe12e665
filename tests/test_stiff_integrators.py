"""Stiff damped motion: order on smooth motion and through switches, and other integrators on the same motion."""

import itertools

import numpy as np
import pytest
from support import MIXED_PINS, REFERENCE, order_of, pendulum_scene, replaced, shell_scene, solved

import tensctl as tc
from tensctl.errors import SimulationError
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.rodas import RODAS5P
from tensctl.simulation.integrators.rosenbrock import Rosenbrock

SCENES = {
    "damped": {"tendons": {"damping": 3.0}},
    "held": {"pins": MIXED_PINS, "tendons": {"damping": 3.0, "rest_ratio": 0.5}, "drag": {"coefficient": 0.7}},
}


def equal_steps(dynamics, start, steps, drive, t_end=0.5):
    """The state after equal steps: each call is as long as its first step, and no error is too large."""
    q, v = dynamics.rod_coordinates(start[0]), dynamics.rod_coordinates(start[1])
    plant = Rosenbrock(dynamics, 1e20, 1.0)
    for t0, t1 in itertools.pairwise(np.linspace(0, t_end, steps + 1)):
        plant.step = 2 * (t1 - t0)
        plant.march(q, v, np.array([t0, t1]), drive, *np.empty((2, 2, *q.shape)))
    assert plant.evaluations == len(RODAS5P.d) * steps
    return np.hstack([q, v])


def taut_motion(**sections):
    """A tight damped shell, in motion."""
    dynamics, rest, _ = solved(shell_scene(tendons={"rest_ratio": 0.5, "damping": 2.0}, **sections))
    kick = 0.3 * np.random.default_rng(5).standard_normal(rest.potential.manifold.size)
    return dynamics, (rest.nodes, (rest.point.tangent @ kick).reshape(-1, 3))


class TestOrder:
    @pytest.mark.parametrize("changing", [False, True], ids=["steady", "changing"])
    def test_equal_steps(self, changing):
        """Order 5 on a smooth damped motion, rest lengths and loads at rest or ramping, lagging and swinging."""
        dynamics, start = taut_motion(pins=["P1_1_1"], drag={"coefficient": 0.1})
        rest, forces = dynamics.members.rest_lengths, dynamics.members.forces
        drive, share = Drive.constant(rest, forces), np.linspace(-1, 1, rest.size)
        if changing:
            drive = drive._replace(
                rate=0.2 * rest * share, lag=0.1 * rest * share[::-1], tau=0.3, force_rate=np.full_like(forces, 2.0),
                wave_node=np.array([1, 5]), wave_force=np.array([[3.0, 0, 1.0], [0, 2.0, 0]]),
                wave_omega=np.array([7.0, 9.0]), wave_phase=np.array([0.3, 1.0]), ramped=True, swept=True,
            )  # fmt: skip
        exact, counts = equal_steps(dynamics, start, 800, drive), np.array([30, 45, 65, 100])
        errors = [np.abs(equal_steps(dynamics, start, n, drive) - exact).max() for n in counts]
        assert 4.6 < order_of(0.5 / counts, errors) < 5.6

    def test_states_between_steps(self):
        """Recorded places between steps have at least the order of a step of the embedded formula."""
        dynamics, (nodes, velocities) = taut_motion()
        drive = Drive.constant(dynamics.members.rest_lengths, dynamics.members.forces)
        errors, lengths = [], np.array([0.05, 0.035, 0.025])
        for h in lengths:
            exact = equal_steps(dynamics, (nodes, velocities), 40, drive, 0.4 * h)
            q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
            out = np.zeros((2, 3, *q.shape))
            Rosenbrock(dynamics, 1e20, 1.0, step=2 * h).march(q, v, np.array([0.0, 0.4 * h, h]), drive, *out)
            errors.append(np.abs(np.hstack([out[0, 1], out[1, 1]]) - exact).max())
        assert order_of(lengths, errors) > 4.5

    @pytest.mark.parametrize(
        ("tendons", "t_end"),
        [({"damping": 2.0}, 0.5), ({"stiffness": 1e6, "damping": 5e4}, 0.1)],
        ids=["soft", "stiff"],
    )
    def test_error_follows_the_tolerance_through_switches(self, tendons, t_end):
        """Each switch is located and stepped on, so none leaves an error that a smaller tolerance does not see."""
        dynamics = tc.build_dynamics(shell_scene(tendons=tendons))

        def end(tol):
            nodes = dynamics.structure.nodes
            return tc.simulate(dynamics, nodes, timepts=[0.0, t_end], method="rosenbrock", tol=tol)

        exact, tols = end(1e-10), 10.0 ** -np.arange(4, 8)
        runs = [end(tol) for tol in tols]
        errors = np.array([np.abs(run.nodes[-1] - exact.nodes[-1]).max() for run in runs])
        assert all(run.switches == exact.switches > 20 for run in runs)
        assert (errors < tols).all()
        assert 0.75 < order_of(tols, errors) < 1.25

    def test_records_do_not_change_the_motion(self):
        dynamics, start = taut_motion()
        sparse = tc.simulate(dynamics, start, timepts=[0.0, 0.5], method="rosenbrock", tol=1e-8)
        dense = tc.simulate(dynamics, start, timepts=np.linspace(0, 0.5, 60), method="rosenbrock", tol=1e-8)
        exact = tc.simulate(dynamics, start, timepts=dense.time, method="dopri5", tol=1e-12)
        assert (sparse.nodes[-1] == dense.nodes[-1]).all()
        assert np.abs(dense.nodes - exact.nodes).max() < 1e-7


class TestMotion:
    @pytest.mark.parametrize("sections", [SCENES["damped"], SCENES["held"]], ids=["free", "held"])
    def test_agrees_with_dopri5(self, sections):
        """On a motion with slack tendons and dampers at their clamp."""
        dynamics = tc.build_dynamics(shell_scene(**sections))
        nodes = dynamics.structure.nodes
        runs = [tc.simulate(dynamics, nodes, t_end=0.5, method=m, tol=1e-10) for m in ("rosenbrock", "dopri5")]
        assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-8
        assert runs[0].rod_drift < 1e-14

    def test_tendons_to_the_ground(self):
        """A node without a rod stays where it is."""
        dynamics = tc.build_dynamics(pendulum_scene(tendons={"rest_length": 1.5, "damping": 2.0}, gravity={"g": 9.8}))
        nodes = dynamics.structure.nodes
        runs = [tc.simulate(dynamics, nodes, t_end=0.5, method=m, tol=1e-10) for m in ("rosenbrock", "dopri5")]
        assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-8

    def test_stiff_motion(self):
        """k = 1e6 N/m and c = 5e4 N s/m: far fewer steps than an explicit method, at the same place."""
        dynamics, rest, _ = solved(shell_scene(tendons={"stiffness": 1e6, "damping": 5e4}))
        kick = 0.1 * np.random.default_rng(1).standard_normal(rest.potential.manifold.size)
        start = (rest.nodes, (rest.point.tangent @ kick).reshape(-1, 3))
        times = [0.0, 0.005, 0.01]
        coarse, fine = (tc.simulate(dynamics, start, timepts=times, method="rosenbrock", tol=t) for t in (1e-5, 1e-9))
        explicit = tc.simulate(dynamics, start, timepts=times, method="dopri5", tol=1e-8)
        assert np.abs(fine.nodes - explicit.nodes).max() < 1e-8
        assert np.abs(coarse.nodes - explicit.nodes).max() < 1e-5
        assert coarse.evaluations < explicit.evaluations / 20

    @pytest.mark.parametrize(
        ("sections", "t_end"),
        [
            ({"tendons": {"stiffness": 1e9, "damping": 4e7}, "pins": ["P1_*_1"]}, 0.002),
            ({"tendons": {"damping": {"ratio": 1e3}}, "pins": ["P1_*_1"]}, 1.0),
            ({"tendons": {"stiffness": 1e6, "damping": 5e4}, "rods": {"mass": {"r1_*": 1e-4, "r2_*": 1e4}}}, 0.2),
        ],
        ids=["k = 1e9 N/m", "a thousand times critical", "masses 1e8 apart"],
    )
    def test_extremes(self, sections, t_end):
        """Two tolerances agree as the looser of them allows."""
        dynamics = tc.build_dynamics(shell_scene(**sections))
        nodes = dynamics.structure.nodes
        runs = [tc.simulate(dynamics, nodes, timepts=[0, t_end], method="rosenbrock", tol=t) for t in (1e-5, 1e-7)]
        assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-5
        assert runs[0].rod_drift < 1e-14

    def test_extremes_at_once(self):
        """k = 1e9 N/m, a thousand times critical damping, masses 1e8 apart: light rods swing at 1e6 rad/s.

        After a start of 1e-15 s they do so thousands of times; errors add up, and the run tells how far.
        """
        scene = shell_scene(
            rods={"mass": {"r1_*": 1e-4, "r2_*": 1e4}}, tendons={"stiffness": 1e9, "damping": {"ratio": 1e3}}
        )
        dynamics = tc.build_dynamics(scene)
        times = [0.0, 0.001, 0.01, 0.03]
        finer, fine = (
            tc.simulate(dynamics, dynamics.structure.nodes, timepts=times[:count], method="rosenbrock", tol=tol)
            for tol, count in ((1e-8, 3), (1e-6, 4))
        )
        off = np.abs(fine.nodes[:3] - finer.nodes).max(axis=(1, 2))
        assert off[1] < 1e-6
        assert off[2] < 1e-4
        assert fine.rod_drift < 1e-14
        assert fine.evaluations < 2e6
        assert off[2] < fine.local_errors < 1e-2
        warned = tc.inspect_run(dynamics, fine).warnings
        assert any("add up to" in sentence for sentence in warned)

    @pytest.mark.parametrize("method", ["rosenbrock", "dopri5"])
    def test_errors_of_steps_bound_the_error(self, method):
        """On a damped motion, whose neighbours do not part; dopri5 meets switches unawares."""
        dynamics = tc.build_dynamics(shell_scene(tendons={"damping": 20.0}, pins=["P1_*_1"]))
        coarse, run, fine = (
            tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0, 1.0], method=method, tol=tol)
            for tol in (1e-4, 1e-6, 1e-11)
        )
        assert np.abs(run.nodes - fine.nodes).max() < 2 * run.local_errors
        assert 10 * run.local_errors < coarse.local_errors < 1e3 * run.local_errors

    def test_two_stages_by_another_code(self):
        """Pinned base, gravity, dampers that may push, strings that go slack: DOP853 of an independent right side."""
        with np.load(REFERENCE / "twostage_pinned.npz", allow_pickle=False) as data:
            nodes, rods, strings, held = data["N"].T, data["Cb"], data["Cs"], data["fixed"].T.any(axis=1)
            rest, k, mass, c, g = data["L0"], data["K"], data["mbar"], data["damper"], data["g"]
            first, times, wanted = data["Nd"].T, data["t"], data["y_dop853"]
        ends = [np.column_stack([(C < 0).argmax(axis=1), (C > 0).argmax(axis=1)]) for C in (rods, strings)]
        structure = tc.network(nodes, *ends, pins=np.flatnonzero(held).tolist())

        def table(labels, values):
            return dict(zip(labels, values.tolist(), strict=True))

        labels = structure.tendon_labels
        scene = tc.Scene(
            structure=structure, rods={"mass": table(structure.rod_labels, mass)}, gravity={"g": g.tolist()},
            tendons={"stiffness": table(labels, k), "rest_length": table(labels, rest), "damping": table(labels, c)},
        )  # fmt: skip
        dynamics = replaced(tc.build_dynamics(scene), clamped=False)
        for method in ("rosenbrock", "dopri5"):
            run = tc.simulate(dynamics, (nodes, first), timepts=times, method=method, tol=1e-10)
            assert (run.lengths <= run.rest_lengths).any()
            assert np.abs(run.nodes.reshape(len(times), -1) - wanted[:, :36]).max() < 1.4e-8

    def test_refuses_what_it_cannot_move(self):
        nodes = {"o": [0, 0, 0], "a": [1, 0, 0], "b": [1, 1, 0]}
        recipe = {
            "kind": "network", "nodes": nodes, "rods": {"r": ["o", "a"], "s": ["a", "b"]}, "tendons": {"t": ["o", "b"]},
        }  # fmt: skip
        dynamics = tc.build_dynamics(tc.Scene(structure=recipe))
        with pytest.raises(SimulationError, match="use dopri5"):
            tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.1, method="rosenbrock")


def test_auto_takes_rosenbrock_steps_where_dampers_are_stiff():
    """A hundred times the damping, and the reason names the ratio of both bounds."""
    for damping, method in ((20.0, "dopri5"), (2000.0, "rosenbrock")):
        dynamics = tc.build_dynamics(
            tc.Scene(structure=tc.shell(3, 1, pins=["P1_*_1"]), tendons={"damping": damping, "stiffness": 100.0})
        )
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.05, tol=1e-6)
        assert run.method == method
    assert dynamics.fastest_decay / dynamics.fastest_rate == pytest.approx(20 * dynamics.fastest_rate, rel=0.05)
    assert "stiff" in run.why


def test_auto_takes_cvodes_where_dampers_are_stiff_on_joints():
    """CVODES and dopri5, another statement of the physics, at one place."""
    dynamics = tc.build_dynamics(
        tc.Scene(structure={"kind": "shell", "n": 3, "m": 2, "class": 2}, tendons={"stiffness": 1e6, "damping": 5e4})
    )
    auto, explicit = (
        tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0, 0.002], method=method, tol=1e-8)
        for method in ("auto", "dopri5")
    )
    assert auto.method == "cvodes"
    assert "stiff" in auto.why
    assert np.abs(auto.nodes - explicit.nodes).max() < 1e-9
