"""Shapes one after the other: tilts with exact gradients, circles, legs that join smoothly, inertia on the way."""

import numpy as np
import pytest
from support import order_of, random_motion, replaced, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential
from tensctl.scene import TargetStage
from tensctl.synthesis.inertia import inertial
from tensctl.synthesis.target import features_of

PINS = ["P1_*_1"]
SCENE = shell_scene(3, 2, pins=PINS)
ROUND = {
    "start": 0.4,
    "waypoint": [
        {"tilt": [0.2, 0.0], "height_scale": 1.02, "duration": 2.0},
        {"circle": "tilt", "turns": -0.5, "duration": 4.0},
        {"tilt": [0.0, 0.0], "height_scale": 1.0},
    ],
}


@pytest.fixture(scope="module")
def rest():
    return tc.find_equilibrium(SCENE)


@pytest.fixture(scope="module")
def path(rest):
    return tc.plan_shape(SCENE, ROUND, start=rest, tension_min=0.1)


def tilts(rest):
    return [feature for feature, _ in features_of(TargetStage.checked(tilt=[0.1, 0.0]), rest.structure, rest.nodes)]


def turn(axis, angle):
    """Rotation by an angle about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


class TestTilt:
    @pytest.mark.parametrize("lean", [0.0, 1e-6, 0.3, 2.0])
    def test_gradients(self, rest, lean):
        """Remainders of the first-order model are of second order, on both sides of the series near upright too."""
        _, direction = random_motion(Potential.of(SCENE), np.random.default_rng(1))
        nodes = rest.nodes @ turn([0.6, 0.8, 0], lean).T
        for feature in tilts(rest):
            slope, here = feature.slope(nodes), feature.of(nodes)

            def left(step, feature=feature, slope=slope, here=here, nodes=nodes):
                return feature.of(nodes + step * direction) - here - step * (slope * direction).sum()

            assert taylor_order(left, np.array([1e-1, 1e-2, 1e-3])) > 1.8

    @pytest.mark.parametrize("angle", [1e-9, 1e-5, 0.7, 3.0])
    @pytest.mark.parametrize("towards", [0.0, 2.2, -1.0])
    def test_leans_by_the_angle_of_a_rotation(self, rest, angle, towards):
        """Turned about a level axis the normal leans towards what is square to it; places and sizes do not matter."""
        axis = [-np.sin(towards), np.cos(towards), 0.0]
        nodes = 1.7 * rest.nodes @ turn(axis, angle).T + [0.3, -0.2, 0.5]
        found = np.array([feature.of(nodes) for feature in tilts(rest)])
        assert found == pytest.approx(angle * np.array([np.cos(towards), np.sin(towards)]), abs=1e-13)

    def test_spinning_the_ring_leans_nothing(self, rest):
        lean = turn([0, 1, 0], 0.4)
        for spin in (0.5, 2.0):
            nodes = rest.nodes @ (lean @ turn([0, 0, 1], spin)).T
            assert [f.of(nodes) for f in tilts(rest)] == pytest.approx([0.4, 0.0], abs=1e-14)


class TestLegs:
    def test_shapes_are_reached_at_their_times(self, path):
        height, x, y = path.legs[0].features
        for t, wanted in ((0.4, (0, 0, 1)), (2.4, (0.2, 0, 1.02)), (4.4, (0, -0.2, 1.02)), (6.4, (-0.2, 0, 1.02))):
            found = path.nodes_at(t)
            scale = height.of(found) / height.of(path.equilibria[0].nodes)
            assert [x.of(found), y.of(found), scale] == pytest.approx(wanted, abs=1e-6)
        assert path.time[[0, 8, 20, 28]] == pytest.approx([0.4, 2.4, 6.4, 9.4])
        path.verify(0.1)

    def test_the_way_back_ends_at_rest(self, path, rest):
        """The least change back to the first shape is none."""
        assert np.abs(path.target.inputs).max() < 1e-8
        assert np.abs(path.target.nodes - rest.nodes).max() < 1e-8

    def test_place_and_its_rates(self, path):
        for t in (1.0, 3.1, 7.0):
            steps = np.array([0.04, 0.02, 0.01])
            place, speed, rate = path.motion(t)
            first = [abs((path.place(t + h) - path.place(t - h)) / (2 * h) - speed) for h in steps]
            second = [abs((path.place(t + h) - 2 * place + path.place(t - h)) / h**2 - rate) for h in steps]
            assert order_of(steps, first) > 1.9
            assert order_of(steps, second) > 1.9

    def test_rests_where_legs_join(self, path):
        """Speed and acceleration vanish on both sides, to the first order of the jerk."""
        for t in (2.4, 6.4):
            for h in (-1e-4, 1e-4):
                assert np.abs(path.velocities_at(t + h)).max() < 1e-6
            assert path.motion(t)[1:] == pytest.approx((0, 0), abs=1e-12)

    def test_splines_meet_the_equilibria(self, path):
        for k, t in enumerate(path.time):
            assert np.abs(path.nodes_at(t) - path.equilibria[k].nodes).max() < 1e-5
        for k in (0, 8, 20, 28):
            assert np.abs(path.nodes_of(k) - path.equilibria[k].nodes).max() < 1e-13

    def test_played_frames_keep_rods(self, path):
        frames, structure = path.played, path.target.structure
        ends = frames.nodes[:, structure.rods]
        lengths = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
        assert np.abs(lengths / structure.rod_lengths - 1).max() < 1e-13
        assert (frames.time[0], frames.time[-1]) == pytest.approx((path.time[0], path.time[-1]))
        assert np.abs(frames.nodes[-1] - path.target.nodes).max() < 1e-13
        assert np.abs(frames.tensions[60] - path.equilibria[8].tensions).max() < 1e-12

    def test_full_round_comes_back(self, rest):
        way = {"waypoint": [{"tip": [0.1, 0.05]}, {"circle": "tip", "duration": 8.0}]}
        path = tc.plan_shape(SCENE, way, start=rest, tension_min=0.1)
        assert np.abs(path.target.inputs - path.equilibria[8].inputs).max() < 1e-6 * np.abs(path.target.inputs).max()
        far = [np.hypot(*(f.of(n) - f.of(rest.nodes) for f in path.features)) for n in path.nodes[8:]]
        assert np.ptp(far) < 1e-10
        assert far[0] == pytest.approx(np.hypot(0.1, 0.05), abs=1e-10)


class TestInertia:
    def test_what_is_left_is_pulled_by_nothing(self, path):
        """The full model's accelerations at the reference differ from the reference's own by no pull of any tendon."""
        dynamics, potential = tc.build_dynamics(SCENE), path.target.potential
        members, tick = potential.members, 1e-3
        for t in path.time[[3, 14, 25]]:
            nodes = path.nodes_at(t)
            wanted = (path.nodes_at(t + tick) - 2 * nodes + path.nodes_at(t - tick)) / tick**2
            x = dynamics.pack(nodes, path.velocities_at(t))
            _, found = dynamics.unpack(np.asarray(dynamics.f(x, path.inputs_at(t), [])).ravel())
            rest = members.rest_lengths.copy()
            rest[members.inputs] -= path.inputs_at(t)
            pull = potential.at(nodes, rest).input_map[:, members.inputs]
            tangent = potential.manifold.tangent(nodes)
            needed, missing = (tangent.T @ _times_mass(potential, a).ravel() for a in (wanted, found - wanted))
            assert np.abs(pull.T @ missing).max() < 1e-4 * np.abs(pull.T @ needed).max()

    def test_open_loop_follows(self, rest):
        """Without feedback and damping, moving with inertia ends nearer by far than moving as if at rest."""
        path = tc.plan_shape(SCENE, {"tilt": [0.2, 0.1], "duration": 2.0}, start=rest, tension_min=0.1)
        dynamics = tc.build_dynamics(SCENE)
        ends = []
        for planned in (path.inputs_at, path.balanced_inputs_at):
            run = tc.simulate(dynamics, rest, controller=_Planned(planned), t_end=2.0, dt=0.02)
            ends.append(np.abs(run.nodes[-1] - path.target.nodes).max())
        assert ends[0] < 0.05 * ends[1]

    def test_scales_with_the_square_of_the_pace(self, path):
        slow = replaced(path, legs=tuple(replaced(g, start=3 * g.start, duration=3 * g.duration) for g in path.legs))
        quick, slowly = inertial(path, path.time), inertial(slow, 3 * path.time)
        assert slowly.inputs == pytest.approx(quick.inputs / 9, abs=1e-7 * np.abs(quick.inputs).max())
        assert slowly.tensions == pytest.approx(quick.tensions / 9, abs=1e-7 * np.abs(quick.tensions).max())


class _Planned:
    """Rest lengths as planned, reached at the end of each period."""

    def __init__(self, planned):
        self.planned = planned

    def reset(self):
        pass

    def step(self, t, measurement):
        return self.planned(t + 0.02)


def _times_mass(potential, accelerations):
    """Inertia of uniform rods on their ends: m/6 (2 a + b, a + 2 b)."""
    force = np.zeros_like(accelerations)
    for (a, b), m in zip(potential.structure.rods, potential.members.mass, strict=True):
        force[a] += m / 6 * (2 * accelerations[a] + accelerations[b])
        force[b] += m / 6 * (2 * accelerations[b] + accelerations[a])
    return force


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        ({"waypoint": [{"circle": "tilt"}]}, r"waypoint\[0\] goes round a circle of no size; expected a waypoint"),
        ({"waypoint": [{"tilt": [0.1, 0.0], "circle": "tilt"}]}, r"waypoint\[0\] names both a shape and a circle"),
        ({"waypoint": [{"duration": 1.0}]}, r"waypoint\[0\] names no shape; expected height_scale, .* or circle alone"),
        ({"waypoint": [{"circle": "tilt", "turns": 0}]}, r"waypoint\[0\].turns is 0; expected how often to go round"),
        ({"waypoint": [{"circle": "twist"}]}, r"waypoint\[0\].circle is \"twist\"; expected \"tilt\" or \"tip\""),
        ({"waypoint": [{"tilt": [0.1, 0.0]}], "twist": 0.1}, "names a shape and waypoints; expected one of the two"),
        ({"tilt": [0.1]}, r"tilt is .0.1.; expected two numbers, along x and y .rad."),
        ({"waypoint": [{"twist": 0.0}, {"height_scale": 30.0}]}, r"target.waypoint\[1\]: no .* The way leads"),
    ],
)
def test_refusals(rest, target, sentence):
    with pytest.raises(tc.TensctlError, match=sentence):
        tc.plan_shape(SCENE, target, start=rest, tension_min=0.1)


def test_a_free_shell_tilts_nothing():
    with pytest.raises(tc.SynthesisError, match=r"target.tilt needs pins"):
        tc.plan_shape(shell_scene(), {"tilt": [0.1, 0.0]})


def test_a_leg_too_short_is_named(rest):
    short = {"waypoint": [{"twist": -0.1}, {"twist": 0.0, "duration": 0.1}]}
    with pytest.raises(tc.SynthesisError, match=r"target.waypoint\[1\].duration = 0.1 s makes a rest length change at"):
        tc.plan_shape(SCENE, short, start=rest, rate_max=0.5)


def test_scenes_keep_their_waypoints(tmp_path):
    scene = SCENE.replaced(target=ROUND)
    (tmp_path / "scene.toml").write_text(scene.to_toml(), encoding="utf-8")
    assert tc.load_scene(tmp_path / "scene.toml") == scene
