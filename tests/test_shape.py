"""Planned shapes are equilibria of the wanted height with the least change of rest lengths, at an allowed pace."""

import numpy as np
import pytest
from support import order_of, prism_scene, replaced, shell_scene

import tensctl as tc
from tensctl.synthesis import shape, shell_height

SCENE = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.2, "start": 0.5, "duration": 3.0})
FLOORS = {"no floor acts": 0.1, "floors act": 3.0}


@pytest.fixture(scope="module", params=FLOORS)
def planned(request):
    """Path and tension floor."""
    return tc.plan_shape(SCENE, tension_min=FLOORS[request.param]), FLOORS[request.param]


def loose(equilibrium):
    return ~equilibrium.structure.grounded_tendons


def mean_height(equilibrium):
    """Mean z of the top ring's P4 less mean z of the base ring's P1."""
    z = dict(zip(equilibrium.structure.node_labels, equilibrium.nodes[:, 2], strict=True))
    return np.mean([z[f"P4_{i}_1"] for i in (1, 2, 3)]) - np.mean([z[f"P1_{i}_1"] for i in (1, 2, 3)])


def test_height_is_the_mean_axial_distance(mast):
    _, rest, _ = mast
    assert shell_height(rest.structure).of(rest.nodes) == pytest.approx(mean_height(rest), rel=1e-14)


def test_heights_are_met(planned):
    path, _ = planned
    before = mean_height(path.equilibria[0])
    wanted = before * np.linspace(1, 1.2, len(path.equilibria))
    found = [mean_height(e) for e in path.equilibria]
    assert np.abs(found - wanted).max() < 1e-10


def test_every_shape_is_a_stable_equilibrium_above_its_floors(planned):
    path, tension_min = planned
    for equilibrium in path.equilibria[1:]:
        assert equilibrium.residual < 1e-9
        assert equilibrium.stable
        assert equilibrium.tensions[loose(equilibrium)].min() >= tension_min * (1 - 1e-9)
        assert (equilibrium.rest_lengths >= equilibrium.potential.members.floors).all()
    path.verify(tension_min)


def gradients(equilibrium, tendons):
    """Height and some tensions of re-solved equilibria, differenced centrally by each input."""

    def at(u):
        found = tc.find_equilibrium(SCENE, start=equilibrium.nodes, inputs=u)
        return np.append(found.tensions[tendons], mean_height(found))

    step, u = 1e-4, equilibrium.inputs
    return np.array([(at(u + d) - at(u - d)) / (2 * step) for d in step * np.eye(u.size)])


def test_least_change(planned):
    """KKT: u is a combination of the gradients of the height and of the tensions at their floor, theirs >= 0."""
    path, tension_min = planned
    last = path.target
    at_floor = np.flatnonzero(loose(last) & (last.tensions < tension_min + 0.05))
    assert at_floor.size == (3 if tension_min == 3.0 else 0)
    slopes = gradients(last, at_floor)
    multipliers, *_ = np.linalg.lstsq(slopes, last.inputs, rcond=None)
    left = last.inputs - slopes @ multipliers
    assert np.abs(left).max() < 1e-5 * np.abs(last.inputs).max()
    assert (multipliers[:-1] > 0).all()


def test_a_symmetric_mast_stays_symmetric(planned):
    """The least change is unique, so it has the threefold symmetry of the mast."""
    path, _ = planned
    u = dict(zip(path.target.structure.tendon_labels, path.target.rest_lengths, strict=True))
    for alpha in (1, 3, 4, 5, 6, 7, 8):
        assert np.ptp([u[f"t{alpha}_{i}_1"] for i in (1, 2, 3)]) < 1e-6 * 0.2


class TestTiming:
    def test_starts_and_ends_at_rest(self, planned):
        path, _ = planned
        first, last = path.equilibria[0], path.target
        for t, equilibrium in ((0.0, first), (0.5, first), (3.5, last), (9.0, last)):
            assert np.abs(path.inputs_at(t) - equilibrium.inputs).max() < 1e-14
            assert np.abs(path.nodes_at(t) - equilibrium.nodes).max() < 1e-13
            assert np.abs(path.tensions_at(t) - equilibrium.tensions).max() < 1e-12
            assert np.abs(path.velocities_at(t)).max() < 1e-8

    def test_reaches_planned_equilibria_at_their_times(self, planned):
        path, _ = planned
        assert path.time[0] == pytest.approx(0.5)
        assert path.time[-1] == pytest.approx(3.5)
        for k in (2, 4, 7):
            assert path.knot_at(path.time[k]) == k
            assert np.abs(path.balanced_inputs_at(path.time[k]) - path.equilibria[k].inputs).max() < 1e-6
            assert np.abs(path.nodes_at(path.time[k]) - path.equilibria[k].nodes).max() < 1e-6

    def test_rods_keep_their_lengths_on_the_way(self, planned):
        path, _ = planned
        rods, lengths = path.target.structure.rods, path.target.structure.rod_lengths
        for t in np.linspace(0, 4, 23):
            ends = path.nodes_at(t)[rods]
            assert np.abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / lengths - 1).max() < 1e-14

    def test_velocities_are_the_rates_of_nodes(self, planned):
        path, _ = planned
        for t in (0.8, 1.9, 3.1):
            wanted, steps = path.velocities_at(t), np.array([0.04, 0.02, 0.01])
            errors = [np.abs((path.nodes_at(t + h) - path.nodes_at(t - h)) / (2 * h) - wanted).max() for h in steps]
            assert order_of(steps, errors) > 1.8
            ends = path.target.structure.rods
            along = path.nodes_at(t)[ends[:, 1]] - path.nodes_at(t)[ends[:, 0]]
            turning = wanted[ends[:, 1]] - wanted[ends[:, 0]]
            assert np.abs((along * turning).sum(axis=1)).max() < 1e-9

    def test_spline_between_shapes_is_nearly_balanced(self, planned):
        """Between planned equilibria the reference itself is an equilibrium to 1e-4 N, of tensions of 10 N."""
        path, tension_min = planned
        potential, members = path.target.potential, path.target.potential.members
        for t in 0.5 * (path.time[1:] + path.time[:-1]):
            rest = members.rest_lengths.copy()
            rest[members.inputs] -= path.balanced_inputs_at(t)
            gradient = potential.at(path.nodes_at(t), rest).gradient
            assert np.abs(gradient).max() < (1e-4 if tension_min < 1 else 0.1)

    def test_fastest_is_the_largest_speed(self, planned):
        path, _ = planned
        t = np.linspace(0.5, 3.5, 20_001)
        speed = np.abs(np.gradient(path.inputs_at(t), t, axis=0)).max()
        assert path.fastest == pytest.approx(speed, rel=1e-3)


class TestRefusals:
    def test_too_short(self):
        short = SCENE.replaced(target={"height_scale": 1.2, "duration": 0.3}, mpc={})
        with pytest.raises(tc.SynthesisError, match=r"target.duration = 0.3 s .* rate_max = 0.5 m/s; allow") as caught:
            tc.plan_shape(short)
        needed = float(str(caught.value).split("allow ")[1].split(" s")[0])
        enough = SCENE.replaced(target={"height_scale": 1.2, "duration": 1.01 * needed}, mpc={})
        assert tc.plan_shape(enough).fastest < 0.5

    def test_out_of_reach(self):
        with pytest.raises(
            tc.SynthesisError, match=r"t1_1_1, .* at tension_min.*; ask for less, .*tension_min. The way leads \d+ %"
        ):
            tc.plan_shape(SCENE, 3.0, tension_min=0.1)

    def test_tension_out_of_reach(self):
        with pytest.raises(tc.SynthesisError, match=r"tensions above 1000 N: .*; ask for less, or lower tension_min"):
            tc.plan_shape(SCENE, tension_min=1000.0)

    def test_no_target(self):
        with pytest.raises(tc.SynthesisError, match="no target is given"):
            tc.plan_shape(shell_scene(pins=["P1_*_1"]))

    def test_no_shell(self):
        with pytest.raises(tc.SynthesisError, match="needs a shell with base nodes"):
            tc.plan_shape(prism_scene(), 1.1)

    def test_slack_start(self):
        with pytest.raises(tc.SynthesisError, match="starts from a stable equilibrium, and this one is: no prestress"):
            tc.plan_shape(shell_scene(tendons={"rest_ratio": 1.2}), 1.1)

    def test_verify_tells_a_low_tension(self, planned):
        path, _ = planned
        with pytest.raises(tc.SynthesisError, match="planned shape 1 is yes, its lowest tension"):
            path.verify(tension_min=20.0)

    def test_verify_tells_what_does_not_balance(self, planned):
        path, _ = planned
        last = path.target
        wrong = replaced(last, rest_lengths=last.rest_lengths * np.linspace(1, 1.001, 24))
        with pytest.raises(tc.EquilibriumError, match="the nodes are no equilibrium"):
            replaced(path, equilibria=(*path.equilibria[:-1], wrong)).verify()


def test_few_steps_lead_to_a_far_shape(monkeypatch):
    """Curvature is learned: without it the last shape of this crouch is not found in 200 steps."""
    monkeypatch.setattr(shape, "_STEPS", 40)
    path = tc.plan_shape(SCENE, 0.3, tension_min=0.1)
    assert mean_height(path.target) == pytest.approx(0.3 * mean_height(path.equilibria[0]), rel=1e-10)
    path.verify(0.1)
    at_floor = np.flatnonzero(loose(path.target) & (path.target.tensions < 0.1 + 1e-6))
    slopes = gradients(path.target, at_floor)
    multipliers, *_ = np.linalg.lstsq(slopes, path.target.inputs, rcond=None)
    assert np.abs(path.target.inputs - slopes @ multipliers).max() < 1e-4 * np.abs(path.target.inputs).max()


def test_free_shell_and_shorter_shape():
    path = tc.plan_shape(shell_scene(), 0.9, tension_min=1.0)
    assert mean_height(path.target) == pytest.approx(0.9 * mean_height(path.equilibria[0]), rel=1e-11)
    path.verify(1.0)


@pytest.fixture(scope="module")
def free():
    return tc.plan_shape(SCENE, 1.1, tension_min=0.1)


class TestLargestChange:
    """Planned within u_max, as the controller keeps it."""

    def test_the_plan_keeps_it_and_is_the_least_change_that_does(self, free):
        """KKT at the last shape: what holds u back is the height and the bounds that act, pushing inwards."""
        most = 0.9 * np.abs(free.target.inputs).max()
        path = tc.plan_shape(SCENE, 1.1, tension_min=0.1, u_max=most)
        u = np.stack([e.inputs for e in path.equilibria])
        assert np.abs(u).max() <= most * (1 + 1e-12)
        used = np.abs(u[-1]) >= most * (1 - 0.02)
        assert 1 <= used.sum() < used.size / 2
        assert mean_height(path.target) == pytest.approx(mean_height(free.target), rel=1e-11)
        assert np.linalg.norm(u[-1]) > np.linalg.norm(free.target.inputs) * (1 + 1e-6)
        height = gradients(path.target, [])[:, -1]
        price = u[-1][~used] @ height[~used] / (height[~used] @ height[~used])
        assert np.abs(u[-1] - price * height)[~used].max() < 1e-4 * most
        assert (np.sign(u[-1]) * (price * height - u[-1]))[used].min() > 0

    def test_a_wide_one_changes_nothing(self, free):
        path = tc.plan_shape(SCENE, 1.1, tension_min=0.1, u_max={"*": 1.0, "t5_*": 0.9})
        assert np.abs(path.target.inputs - free.target.inputs).max() < 1e-12

    def test_a_shape_beyond_it_is_told(self):
        scene = SCENE.replaced(mpc={"u_max": 0.03, "rate_max": 0.5})
        with pytest.raises(tc.SynthesisError, match=r"changed by at most u_max: .* or raise mpc.u_max. The way leads"):
            tc.plan_shape(scene)

    def test_a_start_beyond_it_is_told(self, free):
        with pytest.raises(tc.SynthesisError, match=r"planned shape 0 needs t.* raise u_max"):
            tc.plan_shape(SCENE, 1.2, start=free.target, u_max=0.01)
