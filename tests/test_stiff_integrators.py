"""Stiff damped motion: the formula's order, its Jacobian against CasADi's, and other integrators on the same motion."""

import casadi as ca
import numpy as np
import pytest
from support import (
    MIXED_PINS,
    REFERENCE,
    order_of,
    pendulum_scene,
    random_motion,
    replaced,
    shell_scene,
    solved,
    steady,
)

import tensctl as tc
from tensctl.errors import SimulationError
from tensctl.simulation.integrators.blocks import assemble, expand, linearise, places, reduce, slopes
from tensctl.simulation.integrators.factor import Envelope, factor, solve
from tensctl.simulation.integrators.rodas import RODAS5P
from tensctl.simulation.integrators.rosenbrock import Rosenbrock

SCENES = {
    "undamped": {},
    "damped": {"tendons": {"damping": 3.0}},
    "by strain": {"tendons": {"EA": 100.0, "damping": 3.0}},
    "held": {"pins": MIXED_PINS, "tendons": {"damping": 3.0, "rest_ratio": 0.5}, "drag": {"coefficient": 0.7}},
    "two stages": {"m": 2, "pins": ["P1_*_1"], "tendons": {"damping": 3.0}},
}


class TestFormula:
    def test_order_conditions(self):
        """Trees up to order 5 of the Rosenbrock form: a = alpha/Gamma, C = 1/gamma - 1/Gamma, beta = alpha + Gamma."""
        a, count = RODAS5P.a, len(RODAS5P.d)
        gammas = np.linalg.inv(np.eye(count) / RODAS5P.gamma - RODAS5P.C)
        alphas = a @ gammas
        beta, c = alphas + gammas, alphas.sum(axis=1)
        assert np.abs(c - RODAS5P.times).max() < 1e-13
        assert np.abs(gammas.sum(axis=1) - RODAS5P.d).max() < 1e-13
        one = np.ones(count)
        e, s = beta @ one, alphas @ (beta @ one)
        four = [
            (one, 1), (e, 1 / 2), (c**2, 1 / 3), (beta @ e, 1 / 6), (c**3, 1 / 4), (c * s, 1 / 8),
            (beta @ c**2, 1 / 12), (beta @ beta @ e, 1 / 24),
        ]  # fmt: skip
        five = [
            (c**4, 1 / 5), (c**2 * s, 1 / 10), (c * (alphas @ c**2), 1 / 15), (s**2, 1 / 20),
            (c * (alphas @ beta @ e), 1 / 30), (beta @ c**3, 1 / 20), (beta @ (c * s), 1 / 40),
            (beta @ beta @ c**2, 1 / 60), (beta @ beta @ beta @ e, 1 / 120),
        ]  # fmt: skip
        whole, embedded = (np.append(a[-1, :-1], last) @ gammas for last in (1.0, 0.0))
        assert max(abs(whole @ tree - wanted) for tree, wanted in four + five) < 1e-12
        assert max(abs(embedded @ tree - wanted) for tree, wanted in four) < 1e-12
        assert max(abs(embedded @ tree - wanted) for tree, wanted in five) > 1e-4


class TestLinearAlgebra:
    @pytest.mark.parametrize("shift", [0.0, 8.0], ids=["pivots from below", "pivots on the diagonal"])
    def test_factors(self, rng, shift):
        """Rows of unequal reach, with and without swaps."""
        n = 40
        left = np.maximum(0, np.arange(n) - rng.integers(0, 9, n))
        right = np.minimum(n, np.arange(n) + 1 + rng.integers(0, 9, n))
        inside = (np.arange(n) >= left[:, None]) & (np.arange(n) < right[:, None])
        A = np.where(inside, rng.standard_normal((n, n)), 0) + shift * np.eye(n)
        low = np.maximum.accumulate([np.flatnonzero(inside[:, k]).max() + 1 for k in range(n)])
        b, x = rng.standard_normal(n), np.empty(n)
        LU, reach = A.copy(), [np.empty(n, int) for _ in range(3)]
        factor(LU, Envelope(left, right, low), *reach)
        solve(LU, *reach, b, x)
        assert (reach[2] == np.arange(n)).all() == (shift > 0)
        assert np.abs(A @ x - b).max() < 1e-11 * np.abs(x).max()

    @pytest.mark.parametrize("sections", SCENES.values(), ids=SCENES)
    def test_stage_equations_are_those_of_the_exact_jacobian(self, sections, rng):
        """(s - J) u = r with CasADi's J of the whole state, against the reduced equations and their factors."""
        dynamics = tc.build_dynamics(shell_scene(**sections))
        nodes, velocities = random_motion(dynamics.potential, rng, reach=0.05, speed=0.3)
        x = ca.SX.sym("x", dynamics.f.size1_in("x"))
        still = ca.DM.zeros(dynamics.f.size1_in("u")), ca.DM.zeros(dynamics.f.size1_in("w"))
        whole = ca.Function("J", [x], [ca.jacobian(dynamics.f(x, *still), x)])
        J, s = np.asarray(whole(dynamics.pack(nodes, velocities))), 30.0
        keep, hold = dynamics.state_mask, dynamics.kernel.hold
        first, second = (np.where(keep, rng.standard_normal(keep.shape), 0) for _ in range(2))
        for side in (first, second):
            side[hold == 1, :3], side[hold == 2, :3] = side[hold == 1, 3:], -side[hold == 2, 3:]
        uq, uv = _reduced(dynamics, nodes, velocities, s, first, second)
        wanted = np.linalg.solve(s * np.eye(len(J)) - J, np.concatenate([first[keep], second[keep]]))
        found = np.concatenate([uq[keep], uv[keep]])
        assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()


def _reduced(dynamics, nodes, velocities, s, first, second):
    """u_q and u_v by blocks and factors."""
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    at, envelope = places(dynamics)
    rods, n = len(q), envelope.left.size
    place, speed, force = np.zeros((3, dynamics.kernel.anchor.size))
    found, A = slopes(rods, len(dynamics.structure.tendons)), np.zeros((n, n))
    rest, load = dynamics.members.rest_lengths, dynamics.members.forces.ravel()
    linearise(dynamics.kernel, q, v, rest, load, place, speed, force, found)
    assemble(dynamics.kernel, at, found, s, A)
    b, x, along, uq, uv, reach = (
        np.zeros(n),
        np.zeros(n),
        np.zeros(rods),
        *np.zeros((2, rods, 6)),
        np.zeros((3, n), int),
    )
    reduce(dynamics.kernel, at, found, s, first, second, *np.zeros((2, rods, 6)), place, speed, force, along, b)
    factor(A, envelope, *reach)
    solve(A, *reach, b, x)
    expand(dynamics.kernel, at, found, s, first, x, along, uq, uv)
    return uq, uv


def fixed_steps(dynamics, start, steps, drive, t_end=0.5):
    q, v = dynamics.rod_coordinates(start[0]), dynamics.rod_coordinates(start[1])
    plant = Rosenbrock(dynamics, 1e-6, 1.0, fixed=t_end / steps)
    plant.march(q, v, np.array([0.0, t_end]), drive, *np.empty((2, 2, *q.shape)))
    assert plant.evaluations == len(RODAS5P.d) * steps
    return np.hstack([q, v])


def taut_motion(**sections):
    """A tight damped shell, in motion."""
    dynamics, rest, _ = solved(shell_scene(tendons={"rest_ratio": 0.5, "damping": 2.0}, **sections))
    kick = 0.3 * np.random.default_rng(5).standard_normal(rest.potential.manifold.size)
    return dynamics, (rest.nodes, (rest.point.tangent @ kick).reshape(-1, 3))


class TestOrder:
    @pytest.mark.parametrize("changing", [False, True], ids=["steady", "changing"])
    def test_fixed_steps(self, changing):
        """Order 5 on a smooth damped motion, rest lengths and loads at rest or ramping, lagging and swinging."""
        dynamics, start = taut_motion(pins=["P1_1_1"], drag={"coefficient": 0.1})
        rest, forces = dynamics.members.rest_lengths, dynamics.members.forces
        drive, share = steady(rest, forces), np.linspace(-1, 1, rest.size)
        if changing:
            drive = drive._replace(
                rate=0.2 * rest * share, lag=0.1 * rest * share[::-1], tau=0.3, force_rate=np.full_like(forces, 2.0),
                wave_node=np.array([1, 5]), wave_force=np.array([[3.0, 0, 1.0], [0, 2.0, 0]]),
                wave_omega=np.array([7.0, 9.0]), wave_phase=np.array([0.3, 1.0]), ramped=True, swept=True,
            )  # fmt: skip
        exact, counts = fixed_steps(dynamics, start, 800, drive), np.array([30, 45, 65, 100])
        errors = [np.abs(fixed_steps(dynamics, start, n, drive) - exact).max() for n in counts]
        assert 4.6 < order_of(0.5 / counts, errors) < 5.6

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

    def test_extreme_ratios(self):
        """k = 1e9 N/m, a thousand times critical damping, masses 1e8 apart."""
        light = {"r1_*": 1e-4, "r2_*": 1e4}
        scene = shell_scene(rods={"mass": light}, tendons={"stiffness": 1e9, "damping": {"ratio": 1e3}})
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.1, method="rosenbrock", tol=1e-6)
        assert np.isfinite(run.nodes).all()
        assert run.rod_drift < 1e-14

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
