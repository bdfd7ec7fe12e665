"""Gains, distances and ranks: against brute force, against more digits, and without steps where cases meet."""

import json
import subprocess
import sys

import mpmath as mp
import numpy as np
import pytest
from support import network_scene, order_of, reference_prism, shell_scene, solved

import tensctl as tc
from tensctl.analysis import KrylovRank, Reach, Study
from tensctl.analysis.krylov import krylov_matrix, krylov_rank
from tensctl.analysis.nearness import gains
from tensctl.analysis.scaling import energy_inputs, input_sizes
from tensctl.cli import main

ONE = {"tendons": ["t5_1_1"]}


def one_actuator(stiffer):
    """The pinned mast with one actuator and one tendon that is `stiffer` by a part of itself."""
    stiffness = {"*": 100.0, "t3_1_1": 100.0 * (1 + stiffer)}
    return solved(shell_scene(pins=["P1_*_1"], actuators=ONE, tendons={"stiffness": stiffness}), outputs=())[2]


class TestNearness:
    """Gains of near eigenvalues: singular values at none, single rows at large distance, and what is in between."""

    def seen(self, rng):
        return rng.standard_normal((4, 3)) + 1j * rng.standard_normal((4, 3))

    def test_equal(self, rng):
        seen = self.seen(rng)
        found = gains(np.eye(3), seen, np.zeros(3))
        assert np.allclose(np.sort(found), np.sort(np.linalg.svd(seen)[1]), rtol=1e-13)

    def test_apart(self, rng):
        seen = self.seen(rng)
        found = gains(np.eye(3), seen, np.array([0.0, 9.0, 18.0]))
        assert np.allclose(found, np.linalg.norm(seen, axis=0), rtol=1e-13)

    @pytest.mark.parametrize("step", [1e-9, 1e-5, 0.1, 1.0, 4.0])
    def test_between(self, rng, step):
        """The matrix pencil of the module's docstring, in 60 digits, eigenvectors not orthogonal."""
        vectors = rng.standard_normal((5, 3)) + 1j * rng.standard_normal((5, 3))
        vectors /= np.linalg.norm(vectors, axis=0)
        C, places = rng.standard_normal((2, 5)), step * np.array([0.0, 1.0, 2.5])
        found = gains(vectors, C @ vectors, places)
        with mp.workdps(60):
            V, x = mp.matrix(vectors), [mp.mpf(float(p)) for p in places]
            kernel = mp.matrix(3, 3)
            for j in range(3):
                for k in range(3):
                    kernel[j, k] = mp.exp(-((x[j] - x[k]) ** 2) / 2)
            seen = mp.matrix(C) * V
            G, E = seen.transpose_conj() * seen, V.transpose_conj() * V
            for j in range(3):
                for k in range(3):
                    G[j, k] *= kernel[j, k]
                    E[j, k] *= kernel[j, k]
            root = mp.cholesky(E) ** -1
            exact = [float(mp.sqrt(abs(value))) for value in mp.eighe(root * G * root.transpose_conj())[0]]
        assert np.allclose(np.sort(found), np.sort(exact), rtol=1e-9, atol=1e-15 * max(exact))

    def test_one_eigenvector_twice(self, rng):
        """A defective pair: two vectors 1e-9 apart are one, and its drive is not that of their difference."""
        v = rng.standard_normal(4)
        v /= np.linalg.norm(v)
        w = v + 1e-9 * rng.standard_normal(4)
        vectors = np.stack([v, w / np.linalg.norm(w)], axis=1)
        C = rng.standard_normal((3, 4))
        found = gains(vectors, C @ vectors, np.array([0.0, 1e-3]))
        assert np.allclose(found, np.linalg.norm(C @ v), rtol=1e-6)


class TestBrokenSymmetry:
    STEPS = 10.0 ** np.arange(-10, -1.9, 0.5)

    def test_the_undriven_direction_comes_in_without_a_step(self):
        """A pair of which one actuator drives one direction: as it opens, the other one's gain grows from nothing."""
        weaker = np.array(
            [sorted(m.gain for m in tc.controllability(one_actuator(d)).modes[:2])[0] for d in self.STEPS]
        )
        growth = weaker[1:] / weaker[:-1]
        assert weaker[0] < 1e-5
        assert (growth > 0.98).all()
        assert growth.max() < 6.5  # proportional at most, 10^0.5, but for the rounding that is taken off at the start
        assert growth[-4:] == pytest.approx(1, abs=0.02)

    def test_answers_change_in_order(self):
        answers = [tc.controllability(one_actuator(d)).modes[1].verdict for d in (0.0, 1e-14, 1e-10, 1e-6, 1e-2)]
        assert answers == ["no", "no", "undecided", "yes", "yes"]

    def test_distance_over_both_is_that_of_the_gap(self):
        """While the pair is nearer than it is driven, undoing the gap undoes the mode: the distance is proportional."""
        steps = self.STEPS[2:10]
        found = [tc.controllability(one_actuator(d)).hautus[1] for d in steps]
        assert order_of(steps, found) == pytest.approx(1, abs=0.05)

    def test_all_actuated(self):
        """Where every direction of a pair is driven alike, nothing happens at all."""
        before = np.array([m.gain for m in tc.controllability(solved(shell_scene())[2]).modes[6:]])
        for step in (1e-14, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 1e-2):
            broken = shell_scene(tendons={"stiffness": {"*": 100.0, "t3_1_1": 100.0 * (1 + step)}})
            report = tc.controllability(solved(broken)[2])
            assert report.controllable_modes == tuple(range(6, 30))
            assert np.allclose([m.gain for m in report.modes[6:]], before, rtol=max(step, 1e-10))


class TestExtremes:
    def mast_of_ties(self, **tendons):
        """A rod on a pin between two ties along x and two along y."""
        nodes = {"o": [0, 0, 0], "e": [0, 0, 1], "l": [-2, 0, 1], "r": [2, 0, 1], "f": [0, 2, 1], "b": [0, -2, 1]}
        ties = {name: ["e", name] for name in "lrfb"}
        return network_scene(nodes, {"rod": ["o", "e"]}, ties, ["o", *"lrfb"], tendons=tendons)

    @pytest.mark.parametrize("ratio", [1e4, 1e8])
    def test_stiff_tendons_hide_no_soft_mode(self, ratio):
        """Three tendons a hundred million times stiffer drive some modes as much harder; the others are as before."""
        stiffness = {"*": 100.0, "t5_*": 100.0 * ratio}
        report = tc.controllability(solved(shell_scene(pins=["P1_*_1"], tendons={"stiffness": stiffness}))[2])
        assert report.uncontrollable_modes == ()
        drive = np.array([mode.gain for mode in report.modes])
        assert drive.max() > 1e-2 * ratio * drive.min()

    @pytest.mark.parametrize("ratio", [1e4, 1e8])
    def test_a_heavy_rod_is_still_driven(self, ratio):
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], rods={"mass": {"*": 1.0, "r1_1_1": ratio}}))
        report = tc.controllability(linear)
        assert report.uncontrollable_modes == ()
        assert report.modes[0].gain == pytest.approx(7.32 * (ratio / 1e2) ** -0.5, rel=0.01)
        report.verify()

    def test_through_critical_damping(self):
        """Ties along x only are damped: gains pass c = 2 sqrt(k m) smoothly."""
        make = self.mast_of_ties
        _, _, plain = solved(make())
        omega = max(np.sqrt(mode.omega2) for mode in plain.modes)
        mass = 1.0 / 3.0
        critical = omega * mass  # two dampers: (2 c) / m = 2 omega
        around = critical * (1 + np.array([-1e-3, -1e-6, -1e-9, -1e-12, 0, 1e-12, 1e-9, 1e-6, 1e-3]))
        found = []
        for c in around:
            report = tc.controllability(solved(make(damping={"*": 0.0, "l": c, "r": c}))[2])
            assert report.uncontrollable_modes == ()
            found.append(min(mode.gain for mode in report.modes))
        found = np.array(found)
        assert np.abs(np.diff(found)).max() < 0.05 * found.min()  # square root of 1e-3 on both sides
        assert np.ptp(found[2:7]) < 1e-3 * found.min()

    def test_tendons_near_slack(self):
        """Two ties 1e-8 of their length from slack drive as any others do: what counts is stiffness, not tension."""
        gentle = self.mast_of_ties(rest_length={"l": 1.6, "r": 1.6, "f": 2 * (1 - 1e-8), "b": 2 * (1 - 1e-8)})
        tight = self.mast_of_ties()
        one, other = (tc.controllability(solved(scene)[2]) for scene in (gentle, tight))
        assert one.uncontrollable_modes == ()
        assert sorted(m.gain for m in one.modes) == pytest.approx(sorted(m.gain for m in other.modes), rel=1e-7)


def test_a_shape_that_nothing_holds_is_judged():
    """A mast so flat that its overlap is 300 of its heights: every frequency is zero, and each mode has its reason."""
    linear = solved(shell_scene(
        pins=["P1_*_1"], radius=1e-3, height=1e-3, rods={"mass": 1e3}, tendons={"stiffness": 1e5}
    ))[2]  # fmt: skip
    assert all(mode.omega2 == 0 for mode in linear.modes)
    report = tc.controllability(linear)
    assert report.uncontrollable_modes == tuple(range(len(linear.modes)))
    assert all("not stretched" in mode.reason for mode in report.modes)


class TestHautus:
    def test_is_the_smallest_singular_value(self, mast):
        _, _, linear = mast
        report, B = tc.controllability(linear), energy_inputs(linear)
        for k in (2, 5, 11):
            lam = 1j * np.sqrt(linear.modes[k].omega2)
            values = np.linalg.svd(np.hstack([linear.A - lam * np.eye(42), B]), compute_uv=False)
            assert report.hautus[k] == pytest.approx(values[-1], rel=1e-12)

    @pytest.mark.parametrize("damping", [0.0, 5.0])
    def test_is_at_most_the_distance_over_B_alone(self, damping):
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], tendons={"damping": damping}))
        report = tc.controllability(linear)
        in_energy = np.array([mode.distance for mode in report.modes]) / 10.0  # sqrt(k) of every tendon
        assert (report.hautus <= in_energy * (1 + 1e-9)).all()
        assert (report.hautus > 0.01 * in_energy).all()

    def test_a_report_verifies_itself(self, free):
        report = tc.controllability(free[2])
        report.verify()
        wrong = [mode.__class__(**{**mode.__dict__, "verdict": "yes"}) for mode in report.modes]
        with pytest.raises(tc.LinearizationError, match="mode 0 is said to be controllable: yes"):
            report.__class__(tuple(wrong), "controllable", linear=free[2]).verify()


class TestReach:
    def test_of_the_free_shell(self, free):
        reach = Reach(free[2])
        assert (reach.rank, reach.freedoms, reach.inputs, reach.undecided) == (23, 24, 24, 0)
        tensions = free[1].tensions / np.linalg.norm(free[1].tensions)
        assert abs(reach.idle[:, 0] @ tensions) == pytest.approx(1, abs=1e-12)
        reach.verify()

    def test_of_the_pinned_prism(self):
        """Acceleration reaches 5 of 6; the mode at 2.19 Hz moves, all but a millionth, where no tendon pushes."""
        _, rest, linear = solved(reference_prism(pins=["a", "b", "c"]))
        reach = Reach(linear)
        assert (reach.rank, reach.freedoms) == (5, 6)
        assert linear.modes[0].frequency == pytest.approx(2.188, abs=1e-3)
        assert 0.999 < reach.shares[0] < 1
        assert tc.controllability(linear).uncontrollable_modes == ()
        # What is missing lengthens no tendon that has an actuator.
        lengthened = linear.stretch @ reach.missing
        assert np.abs(lengthened[rest.potential.members.inputs]).max() < 1e-12 * np.abs(linear.stretch).max()
        assert "only inertia and prestress reach it" in str(reach)

    def test_what_is_missing_cannot_be_held(self, mast):
        """Static influence has no part of it, in the metric of the stiffness."""
        from tensctl.analysis import static_influence

        _, rest, linear = mast
        held = linear.shapes.T @ (
            rest.potential.manifold.mass(rest.potential.members.mass)[:, None] * static_influence(rest)
        )
        omega2 = np.array([mode.omega2 for mode in linear.modes])
        reach = Reach(linear)
        assert np.abs(reach.missing.T @ (omega2[:, None] * held)).max() < 1e-11 * np.abs(omega2[:, None] * held).max()
        values = np.linalg.svd(held, compute_uv=False)
        assert (values > 1e-9 * values[0]).sum() == reach.rank

    def test_sizes_bound_every_column(self, free, mast):
        for _, _, linear in (free, mast):
            assert (np.linalg.norm(linear.B, axis=0) <= input_sizes(linear) * (1 + 1e-12)).all()


class TestStudy:
    def test_prints_its_numbers(self, free):
        text = str(Study.of(free[2]))
        assert "24 of 30 modes are controllable" in text
        assert "static reach: rank 23 of 24 flexible freedoms, 24 inputs" in text
        assert "control.ctrb: rank" in text
        assert "30 of 30 modes are observable" in text

    def test_verifies(self, mast):
        Study.of(mast[2]).verify()

    def test_krylov_is_for_small_models(self):
        found = krylov_rank(solved(shell_scene(4, 2))[2])
        assert found is None

    def test_the_krylov_matrix_is_that_of_python_control(self, free, mast):
        """Bit by bit: the rank that is printed is the one that `control.ctrb` leads to."""
        import control

        for _, _, linear in (free, mast):
            A, B = linear.flexible.A, linear.flexible.B
            assert np.array_equal(krylov_matrix(A, B), control.ctrb(A, B))
        A, B = 1e200 * np.eye(3, k=1), np.ones((3, 1))
        with np.errstate(over="ignore", invalid="ignore"):
            assert np.array_equal(krylov_matrix(A, B), control.ctrb(A, B), equal_nan=True)

    def test_words_about_the_krylov_rank(self):
        assert "few enough for double precision" in str(KrylovRank(12, 12, 3.0))
        assert "rounding" in str(KrylovRank(22, 48, 30.0))
        assert "no number (overflow)" in str(KrylovRank(None, 360, 400.0))

    def test_from_the_command_line(self, tmp_path, capsys):
        scene = shell_scene(pins=["P1_*_1"], simulation={"t_end": 100.0})
        (tmp_path / "mast.toml").write_text(scene.to_toml(), encoding="utf-8")
        assert main(["controllability", str(tmp_path / "mast.toml"), "-o", str(tmp_path / "out" / "c.json")]) == 0
        assert "21 of 21 modes are controllable" in capsys.readouterr().out
        found = json.loads((tmp_path / "out" / "c.json").read_text(encoding="utf-8"))
        assert found["reach"]["rank"] == 20
        assert [mode["answer"] for mode in found["modes"]] == ["yes"] * 21
        assert all(mode["distance_over_A_and_B"] > 1 for mode in found["modes"])

    def test_nothing_of_it_is_loaded_when_it_is_not_asked(self, tmp_path):
        code = (
            "import sys, tensctl as tc; scene = tc.Scene(structure=dict(kind='prism', n=3), linearize={}); "
            f"tc.run(scene, {str(tmp_path / 'out')!r}); "
            "print([m for m in sys.modules if m.startswith('tensctl.analysis') or m in ('control', 'cvxpy', 'daqp')])"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"

    def test_python_control_is_not_loaded_for_its_rank(self):
        code = (
            "import sys, tensctl as tc; from tensctl.pipeline.run import study; "
            "assert study(tc.Scene(structure=dict(kind='prism', n=3))).krylov.rank > 0; "
            "print([m for m in ('control', 'scipy.signal') if m in sys.modules])"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        assert done.stdout.strip() == "[]"

    def test_in_the_report(self, tmp_path):
        scene = shell_scene(controllability={}, linearize={}, report={})
        tc.run(scene, tmp_path / "out")
        page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
        for words in (
            "Driven is not held",
            "rank 23 of 24",
            "control.ctrb: rank",
            "What the outputs see",
            "over A and B",
        ):
            assert words in page
