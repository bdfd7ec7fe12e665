"""One motor, several tendons: u is what motors ask for, from the linear model to the closed loop."""

import numpy as np
import pytest
from linear_support import STEPS, Neighbour, directions
from support import shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.analysis import move

GANGS = {
    "top": {"t6_*": 1.0, "t6_1_1": 0.5},
    "tilt": {"t5_1_1": 1.0, "t5_2_1": -0.7},
}


def ganged(gangs=GANGS, **given):
    actuators = {"gangs": gangs} | given.pop("actuators", {})
    return shell_scene(pins=["P1_*_1"], actuators=actuators, **given)


@pytest.fixture(scope="module")
def case():
    return solved(ganged())


@pytest.fixture(scope="module")
def single():
    return solved(shell_scene(pins=["P1_*_1"]))


def motors(members):
    """The gear matrix, written out from the table of gangs and labels alone."""
    gearing = members.gearing
    matrix = np.zeros((members.inputs.size, gearing.size))
    matrix[np.arange(members.inputs.size), gearing.motor] = gearing.ratio
    return matrix


class TestStructure:
    def test_labels_and_ratios(self, case):
        dynamics = case[0]
        labels, members = dynamics.input_labels, dynamics.members
        assert len(labels) == 21 - 3 - 2 + 2
        assert "top" in labels
        assert "t6_1_1" not in labels
        found = {dynamics.structure.tendon_labels[t]: (labels[m], r) for t, m, r in zip(
            members.inputs, members.gearing.motor, members.gearing.ratio, strict=True)}  # fmt: skip
        assert found["t6_1_1"] == ("top", 0.5)
        assert found["t6_3_1"] == ("top", 1.0)
        assert found["t5_2_1"] == ("tilt", -0.7)
        assert found["t5_3_1"] == ("t5_3_1", 1.0)

    def test_there_and_back(self, case, rng):
        members = case[0].members
        u = 0.01 * rng.standard_normal(members.gearing.size)
        assert np.abs(members.inputs_of(members.shortened(u)) - u).max() < 1e-15
        assert (members.rest_lengths - members.shortened(u))[members.inputs] == pytest.approx(motors(members) @ u)

    def test_bounds_are_the_floors(self, case):
        """At each bound the first tendon stands on its floor, and none below it."""
        members = case[0].members
        for bounds in members.input_bounds:
            for motor in np.flatnonzero(np.isfinite(bounds)):
                u = np.where(np.arange(bounds.size) == motor, bounds[motor], 0.0)
                assert abs((members.shortened(u) - members.floors)[members.inputs].min()) < 1e-12

    def test_without_gangs_nothing_changes(self, single):
        gearing = single[0].members.gearing
        assert gearing.plain
        assert single[0].input_labels == tuple(single[0].structure.tendon_labels[t] for t in single[0].members.inputs)

    @pytest.mark.parametrize(
        ("gangs", "words"),
        [
            ({"t6_1_1": {"t6_2_1": 1.0}}, "has the label of a tendon"),
            ({"a": {"t6_*": 1.0}, "b": {"t6_1_1": 1.0}}, "tendon t6_1_1 is in two gangs"),
            ({"a": {"t6_*": 0.0}}, "a ratio is 0"),
            ({"a": {"t6_*": -1.0}}, "every ratio is negative"),
            ({"a": {"t9_*": 1.0}}, 'actuators.gangs.a: "t9_\\*" names nothing'),
        ],
    )
    def test_refusals(self, gangs, words):
        with pytest.raises(tc.StructureError, match=words):
            tc.build_dynamics(ganged(gangs))

    def test_scene_round_trip(self, tmp_path):
        scene = ganged()
        (tmp_path / "scene.toml").write_text(scene.to_toml())
        assert tc.load_scene(tmp_path / "scene.toml") == scene


class TestLinear:
    def test_columns_add_up(self, case, single):
        G = motors(case[0].members)
        for name in ("B", "D"):
            wanted = getattr(single[2], name) @ G
            assert np.abs(getattr(case[2], name) - wanted).max() < 1e-12 * np.abs(wanted).max()
        assert (case[2].A == single[2].A).all()
        assert case[2].inputs == tuple(f"u_{label}" for label in case[0].input_labels)
        assert case[2].to_statespace().input_labels == list(case[2].inputs)

    def test_taylor(self, case, rng):
        """A and B against the nonlinear model, whose u are the motors' too."""
        near, linear = Neighbour(case), case[2]
        x, u = directions(linear, rng)

        def left(h):
            return near.rate(h * x, h * u) - h * (linear.A @ x + linear.B @ u)

        assert 1.9 < taylor_order(left, STEPS) < 2.2

    def test_static_reach(self, case, single):
        from tensctl.statics import static_influence, tension_influence

        G = motors(case[0].members)
        assert static_influence(case[1]) == pytest.approx(static_influence(single[1]) @ G, abs=1e-12)
        assert tension_influence(case[1]) == pytest.approx(tension_influence(single[1]) @ G, abs=1e-10)

    def test_a_node_is_moved_by_motors(self, case):
        """What moves a node with the least change names gangs, and the structure does get there."""
        found = move(case[1], "P4_1_1", (0.0, 0.0, 0.002))
        assert {label for label, _ in found.tendons} <= set(case[0].input_labels)
        assert found.settled.inputs == pytest.approx(found.inputs, abs=1e-14)

    def test_a_gang_of_one_is_its_tendon(self, single):
        linear = solved(ganged({"one": {"t6_1_1": 2.0}}))[2]
        k = linear.dynamics.input_labels.index("one")
        wanted = single[2].B.copy()
        wanted[:, k] *= 2
        assert np.abs(linear.B - wanted).max() < 1e-14 * np.abs(wanted).max()

    def test_symmetric_gangs_reach_symmetric_modes_only(self):
        """One motor for each kind of tendon keeps the symmetry, so no repeated mode is driven."""
        gangs = {f"g{k}": {f"t{k}_*": 1.0} for k in (1, 2, 3, 4, 5, 6, 7, 8)}
        found = tc.controllability(solved(ganged(gangs))[2])
        assert all((mode.verdict == "yes") == (mode.multiplicity == 1) for mode in found.modes)

    def test_harmonics_refuse_gangs_that_break_the_symmetry(self):
        scene = ganged()
        with pytest.raises(tc.LinearizationError, match="motors are not carried onto motors"):
            tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))


class TestEquilibrium:
    def test_inputs_move_tendons_by_their_ratios(self, case):
        u = np.zeros(case[0].members.gearing.size)
        u[case[0].input_labels.index("top")] = 0.02
        moved = tc.find_equilibrium(ganged(), inputs=u)
        change = dict(zip(moved.structure.tendon_labels, case[1].rest_lengths - moved.rest_lengths, strict=True))
        assert [change[f"t6_{i}_1"] for i in (1, 2, 3)] == pytest.approx([0.01, 0.02, 0.02])
        assert moved.inputs == pytest.approx(u, abs=1e-15)


class TestMotion:
    def kept(self, run, members):
        """Rest lengths are what the recorded inputs say, at every time."""
        shortening = (members.rest_lengths - run.rest_lengths)[:, members.inputs]
        return np.abs(shortening - run.inputs @ motors(members).T).max()

    def test_schedule_by_the_gangs_name(self, case):
        dynamics, rest, _ = case
        plan = [tc.Schedule("top", [0.0, 0.5], [0.0, 0.1])]
        run = tc.simulate(dynamics, rest, schedule=plan, timepts=np.linspace(0, 1, 21), rate_max=0.15)
        k = dynamics.input_labels.index("top")
        assert run.inputs[-1, k] == pytest.approx(0.1)
        assert self.kept(run, dynamics.members) < 1e-14
        speed = np.abs(np.diff(run.rest_lengths, axis=0)).max() / 0.05
        assert speed <= 0.15 * (1 + 1e-9)
        with pytest.raises(tc.SimulationError, match="no acting actuator of its own"):
            tc.simulate(dynamics, rest, schedule=[tc.Schedule("t6_1_1", [0.0], [0.0])], t_end=0.1)

    def test_lqr_brings_it_back(self, case, rng):
        dynamics, rest, linear = case
        controller = tc.lqr(linear)
        controller.verify()
        manifold = rest.potential.manifold
        start = manifold.retract(rest.nodes, 0.02 * rng.standard_normal(manifold.size))
        run = tc.simulate(dynamics, start, controller=controller, t_end=4.0)
        assert self.kept(run, dynamics.members) < 1e-13
        off = np.linalg.norm(run.nodes - rest.nodes, axis=(1, 2))
        assert off[-1] < 0.05 * off[0]

    def test_a_motor_stops_at_its_first_floor(self, case):
        """Asked for too much, gangs keep their ratios while the first tendon stands on its floor."""
        dynamics, rest, _ = case

        class Greedy:
            dt = 0.1

            def reset(self):
                pass

            def step(self, t, measurement):
                u = np.zeros(dynamics.members.gearing.size)
                u[dynamics.input_labels.index("tilt")] = -100.0
                return u

        run = tc.simulate(dynamics, rest, controller=Greedy(), t_end=0.3, tol=1e-6)
        members = dynamics.members
        assert self.kept(run, members) < 1e-12
        left = run.rest_lengths[-1] - members.floors
        assert abs(left[dynamics.structure.tendon_labels.index("t5_2_1")]) < 1e-12
        assert (left >= -1e-12).all()

    def test_mpc_keeps_its_limits_and_agrees_with_cvxpy(self, tmp_path):
        push = {"node": "P4_1_1", "force": [3.0, 0.0, 0.0], "from": 0.1, "to": 0.2}
        found = tc.run(
            ganged(
                mpc={"horizon": 8, "dt": 0.04, "rate_max": 0.2},
                simulation={"t_end": 0.6, "controller": "mpc", "push": [push]},
            ),
            tmp_path / "out",
        )
        assert self.kept(found.run, found.dynamics.members) < 1e-12
        assert found.certificate.violations == 0
        assert found.certificate.cost_difference < 1e-6
        assert np.abs(np.diff(found.run.inputs, axis=0)).max() > 1e-5, "it acted"

    def test_a_shape_path_of_motors(self):
        """One motor for each kind of tendon raises the mast; every planned rest length follows from them."""
        gangs = {f"g{k}": {f"t{k}_*": 1.0} for k in range(1, 9)}
        scene = ganged(gangs, target={"height_scale": 1.05})
        path = tc.plan_shape(scene, tension_min=0.1)
        members = tc.build_dynamics(scene).members
        for rest in path.equilibria:
            assert np.abs(members.shortened(rest.inputs) - rest.rest_lengths).max() < 1e-13
        heights = [rest.nodes[:, 2].max() for rest in path.equilibria]
        assert heights[-1] > heights[0]

    def test_resuming_asks_for_the_same_gears(self, case, tmp_path):
        dynamics = case[0]
        other = tc.build_dynamics(ganged({**GANGS, "tilt": {"t5_1_1": 1.0, "t5_2_1": -0.6}}))
        from tensctl.simulation.store import fingerprints

        assert fingerprints(dynamics) != fingerprints(other)
