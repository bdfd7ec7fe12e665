"""Runs are looked over: distances, passings, forces along rods, Euler loads and slack tendons."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import MIXED_PINS, network_scene, pendulum_scene, replaced, rotation, shell_scene, solved

import tensctl as tc
from tensctl.progress import Progress
from tensctl.simulation.buckling import buckling, euler_loads
from tensctl.simulation.clearance import Segments, clearance
from tensctl.simulation.rod_forces import rod_forces_along
from tensctl.simulation.sanity import NEAR
from tensctl.simulation.segments import nearest
from tensctl.simulation.warn import nearer_than

X, Y, Z = np.eye(3)


def distance(a, b, c, d):
    """Distance of the segments from a to b and from c to d."""
    a, b, c, d = (np.asarray(p, float) for p in (a, b, c, d))
    return nearest(a, b - a, c, d - c)[2]


def sampled_distance(a, b, c, d, count=400):
    """An upper bound that is near: the exact distance to the second segment from many points of the first."""
    points = a + np.linspace(0, 1, count)[:, None] * (b - a)
    along = d - c
    place = np.clip((points - c) @ along / max(along @ along, 1e-300), 0, 1)
    return np.linalg.norm(points - c - place[:, None] * along, axis=1).min()


class TestDistance:
    @pytest.mark.parametrize(
        ("points", "wanted"),
        [
            ((0 * X, X, Y, X + Y), 1.0),  # parallel, side by side
            ((0 * X, X, 3 * X + Y, 2 * X + Y), np.sqrt(2)),  # parallel, one behind the other
            ((-X, X, -Y + 0.5 * Z, Y + 0.5 * Z), 0.5),  # crossing at a height
            ((-X, X, -Y, Y), 0.0),  # crossing in one plane
            ((0 * X, X, 1.25 * X, 2 * X), 0.25),  # end to end on one line
            ((0 * X, 2 * X, X, 3 * X), 0.0),  # over each other on one line
            ((0 * X, X, 2 * X + Y, 2 * X - Y), 1.0),  # an end against the inside
            ((0 * X, 0 * X, Y, Y), 1.0),  # two points
            ((0 * X, 0 * X, Y - X, Y + X), 1.0),  # a point and a segment
            ((0 * X, X, X, X + Y), 0.0),  # a shared end
        ],
    )
    def test_known(self, points, wanted):
        assert distance(*points) == pytest.approx(wanted, abs=1e-15)

    def test_nearly_parallel(self):
        """The stationary point divides by |u x v|^2 = 1e-18: the edges give the answer."""
        assert distance(0 * X, X, Y, X + (1 - 1e-9) * Y) == pytest.approx(1 - 1e-9, abs=1e-12)

    def test_against_sampling(self, rng):
        for _ in range(300):
            a, b, c, d = rng.standard_normal((4, 3))
            found, above = distance(a, b, c, d), sampled_distance(a, b, c, d)
            assert above - 1e-2 * np.linalg.norm(b - a) <= found <= above + 1e-14

    @given(seed=st.integers(0, 2**32 - 1))
    @settings(max_examples=50)
    def test_rigid_motion_order_and_direction_change_nothing(self, seed):
        rng = np.random.default_rng(seed)
        a, b, c, d = rng.standard_normal((4, 3))
        turn, shift = rotation(rng), rng.standard_normal(3)
        wanted = distance(a, b, c, d)
        assert distance(*(turn @ p + shift for p in (a, b, c, d))) == pytest.approx(wanted, abs=1e-13)
        assert distance(c, d, b, a) == pytest.approx(wanted, abs=1e-13)


def motion(rng, count=12, times=7, speed=0.3):
    """Segments in straight motion, no two sharing a node, with nodes and velocities over time."""
    first, rate = rng.standard_normal((2 * count, 3)), speed * rng.standard_normal((2 * count, 3))
    time = np.linspace(0, 1, times)
    ends = np.arange(2 * count).reshape(-1, 2)
    return time, first + time[:, None, None] * rate, np.broadcast_to(rate, (times, *rate.shape)), ends


class TestClearance:
    def test_is_the_least_of_all_pairs(self, rng):
        """The broad phase loses nothing: radii, among one kind and between two, every time and pair."""
        time, nodes, rates, ends = motion(rng)
        radius = rng.uniform(0, 0.05, len(ends))
        rods, others = Segments(ends[:7], radius[:7], 0 * radius[:7]), Segments(ends[7:], radius[7:], 0 * radius[7:])

        def gap(k, i, j):
            return distance(*nodes[k, ends[i]], *nodes[k, ends[j]]) - radius[i] - radius[j]

        among, between = clearance(time, nodes, rates, rods), clearance(time, nodes, rates, rods, others)
        for k in range(len(time)):
            one = {(i, j): gap(k, i, j) for i in range(7) for j in range(i + 1, 7)}
            two = {(i, j): gap(k, i, 7 + j) for i in range(7) for j in range(5)}
            for found, wanted in ((among, one), (between, two)):
                assert found.distance[k] == pytest.approx(min(wanted.values()), abs=1e-14)
                assert tuple(found.pairs[k]) == min(wanted, key=wanted.__getitem__)
            assert among.least <= among.distance[k]

    def test_lists_every_close_pair_once(self, rng):
        time, nodes, rates, ends = motion(rng, count=48)
        near = np.full(48, 0.4)
        found = clearance(time, nodes, rates, Segments(ends, 0 * near, near))
        wanted = {}
        for i in range(48):
            for j in range(i + 1, 48):
                gaps = np.array([distance(*frame[ends[i]], *frame[ends[j]]) for frame in nodes])
                if (gaps <= 0.4).any():
                    wanted[i, j] = (time[(gaps <= 0.4).argmax()], gaps.min(), time[gaps.argmin()])
        assert len(wanted) * len(time) > 1024, "more than the room that is there at first"
        assert {(e.first, e.second): (e.begins, e.distance, e.time) for e in found.encounters} == wanted
        assert list(found.encounters) == sorted(found.encounters, key=lambda e: e.begins)

    def test_members_that_share_a_node_are_no_pair(self):
        nodes = np.array([[0 * X, X, Y, X + 2 * Z, 5 * X, 5 * X + Y]])
        rods = Segments(np.array([[0, 1], [1, 2], [4, 5]]), np.zeros(3), np.zeros(3))
        found = clearance(np.zeros(1), nodes, 0 * nodes, rods)
        assert found.least == pytest.approx(4.0)
        alone = clearance(np.zeros(1), nodes, 0 * nodes, Segments(rods.ends[:2], np.zeros(2), np.zeros(2)))
        assert np.isinf(alone.least)
        assert tuple(alone.pairs[0]) == (-1, -1)

    @pytest.mark.parametrize("records", [2, 3, 10, 101])
    def test_passing(self, records, rng):
        """Two rods of which one turns and flies across the other: the moment, at any density of records."""
        time = np.linspace(0, 1, records)
        height = 0.4 - time * (0.8 + 0.3 * time)
        nodes = np.empty((records, 4, 3))
        nodes[:, 0], nodes[:, 1] = -X, X
        nodes[:, 2], nodes[:, 3] = -Y + height[:, None] * Z, Y + 0.2 * X + height[:, None] * Z
        rates = np.zeros_like(nodes)
        rates[:, 2:, 2] = -(0.8 + 0.6 * time)[:, None]
        turn = rotation(rng)
        rods = Segments(np.array([[0, 1], [2, 3]]), np.zeros(2), np.zeros(2))
        found = clearance(time, nodes @ turn.T, rates @ turn.T, rods)
        wanted = (-0.8 + np.sqrt(0.64 + 4 * 0.3 * 0.4)) / 0.6
        assert [(p.first, p.second) for p in found.passings] == [(0, 1)]
        assert found.passings[0].time == pytest.approx(wanted, abs=1e-9)
        beside = Segments(rods.ends, np.zeros(2), np.zeros(2))
        missed = nodes.copy()
        missed[:, 2:] += 1.2 * X  # the lines meet, beyond the first rod's end
        assert not clearance(time, missed, rates, beside).passings

    def test_rods_in_one_plane_meet_where_they_touch(self):
        """A triple product that is rounding all the time tells nothing; a distance of zero does."""
        time = np.linspace(0, 1, 11)
        nodes = np.zeros((11, 4, 3))
        nodes[:, 1] = X
        nodes[:, 2], nodes[:, 3] = 0.5 * X + (0.55 - time[:, None]) * Y, 0.5 * X + (1.55 - time[:, None]) * Y
        rates = np.zeros_like(nodes)
        rates[:, 2:, 1] = -1
        near = np.full(2, 1e-12)
        found = clearance(time, nodes, rates, Segments(np.array([[0, 1], [2, 3]]), np.zeros(2), near))
        assert not found.passings
        assert [e.begins for e in found.encounters] == [time[6]]


def two_rods(speed=1.0, **rods):
    """Two free rods, square to each other and 0.5 m apart, the second flying towards the first; a slack tendon each."""
    nodes = {"a": -X, "b": X, "c": -Y + 0.5 * Z, "d": Y + 0.5 * Z, "e": 9 * X + Z, "f": 9 * X - Z}
    scene = network_scene(
        {name: place.tolist() for name, place in nodes.items()},
        {"lying": ["a", "b"], "flying": ["c", "d"]},
        {"t1": ["a", "e"], "t2": ["c", "f"]},
        ["e", "f"],
        tendons={"rest_length": 50.0},
        rods=rods,
    )
    dynamics = tc.build_dynamics(scene)
    velocities = np.zeros((6, 3))
    velocities[2:4, 2] = -speed
    return dynamics, (dynamics.structure.nodes, velocities)


class TestWarnings:
    def test_rods_that_pass_through_each_other(self):
        dynamics, start = two_rods()
        run = tc.simulate(dynamics, start, timepts=[0.0, 0.3, 0.7, 1.0])
        sanity = tc.inspect_run(dynamics, run)
        assert sanity.rods is not None
        assert sanity.rods.passings[0].time == pytest.approx(0.5, abs=1e-9)
        assert sanity.warnings[0].startswith("rods lying and flying pass through each other at 0.5 s")
        assert "rods.radius" in sanity.not_checked[0]

    def test_rods_that_touch(self):
        dynamics, start = two_rods(radius={"lying": 0.03, "flying": 0.02})
        run = tc.simulate(dynamics, start, timepts=np.linspace(0, 0.48, 49))
        sanity = tc.inspect_run(dynamics, run)
        assert sanity.rods is not None
        assert sanity.rods.distance == pytest.approx(0.45 - run.time, abs=1e-12)
        assert sanity.warnings[0] == "rods lying and flying touch at 0.45 s; 0.03 m into each other at 0.48 s."

    def test_rods_nearer_than_a_path_was_asked_to_keep(self):
        dynamics, start = two_rods(radius={"lying": 0.03, "flying": 0.02})
        sanity = tc.inspect_run(dynamics, tc.simulate(dynamics, start, timepts=np.linspace(0, 0.4, 41)))
        assert nearer_than(sanity, 0.05) is None
        told = nearer_than(sanity, 0.0501)
        assert told is not None
        assert told.startswith("rods lying and flying come to 0.05 m at 0.4 s, nearer than target.clearance = 0.0501 m")

    def test_rods_of_a_plane_that_cross_all_the_time_touch_from_the_start(self):
        """Their distance is rounding throughout, least at some time that means nothing."""
        scene = tc.Scene(
            structure={
                "kind": "planar",
                "nodes": {"a": [0, 0], "b": [2, 0], "c": [2, 1.5], "d": [0, 1.4]},
                "rods": {"r1": ["a", "c"], "r2": ["d", "b"]},
                "tendons": {"t1": ["a", "b"], "t2": ["b", "c"], "t3": ["c", "d"], "t4": ["d", "a"]},
            }
        )
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.5)
        assert tc.inspect_run(dynamics, run).warnings[0] == "rods r1 and r2 touch at 0 s."

    def test_thin_rods_that_come_near(self):
        dynamics, start = two_rods()
        assert NEAR * 2.0 > 0.015
        run = tc.simulate(dynamics, start, timepts=np.linspace(0, 0.485, 98))
        assert (
            tc.inspect_run(dynamics, run)
            .warnings[0]
            .startswith("rods lying and flying come within 0.015 m of each other at 0.485 s")
        )
        far = tc.simulate(dynamics, start, timepts=[0.0, 0.4])
        assert not [w for w in tc.inspect_run(dynamics, far).warnings if w.startswith("rods")]
        assert tc.inspect_run(dynamics, far).warnings[0] == "rod flying and tendon t1 touch at 0.4 s."

    def test_shell_let_go_from_the_cylinder(self, free):
        """Rods of the undamped (3,1) shell pass through each other: all copies at once, whatever is recorded."""
        dynamics = free[0]
        coarse, fine = (
            tc.inspect_run(dynamics, tc.simulate(dynamics, dynamics.structure.nodes, timepts=np.linspace(0, 0.3, n)))
            for n in (31, 301)
        )
        assert coarse.rods is not None
        assert fine.rods is not None
        assert len(fine.rods.passings) == 6
        moments = np.array([[p.time for p in found.rods.passings] for found in (coarse, fine)])
        assert np.ptp(moments[1]) < 1e-8, "six copies by symmetry"
        assert np.abs(moments[0] - moments[1]).max() < 1e-5
        assert fine.warnings[3].endswith("And 2 more pairs.")

    def test_slack_tendons(self, free):
        dynamics = free[0]
        run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.5)
        sanity = tc.inspect_run(dynamics, run)
        slack = (run.lengths <= run.rest_lengths).mean(axis=1)
        assert (sanity.slack == slack).all()
        assert sanity.most_slack == (slack.max(), run.time[slack.argmax()])
        dynamics, start = two_rods()
        loose = tc.inspect_run(dynamics, tc.simulate(dynamics, start, timepts=[0.0, 0.1]))
        assert loose.warnings == ("more than 50% of the tendons are slack from 0 s on, 100% at 0 s.",)

    def test_tendons_between_pins_do_not_count(self, mast):
        dynamics, rest, _ = mast
        run = tc.simulate(dynamics, rest, timepts=[0.0])
        tensions = run.tensions.copy()
        tensions[:, dynamics.structure.grounded_tendons] = 0
        assert dynamics.structure.grounded_tendons.sum() == 3
        assert tc.inspect_run(dynamics, replaced(run, tensions=tensions)).slack[0] == 0


def at_rest(scene):
    dynamics, rest, _ = solved(scene)
    return dynamics, rest, tc.simulate(dynamics, rest, timepts=[0.0])


class TestRodForces:
    @pytest.mark.parametrize("pins", [[], ["P1_*_1"], MIXED_PINS], ids=["free", "base", "mixed"])
    def test_at_rest(self, pins):
        dynamics, rest, run = at_rest(shell_scene(pins=pins))
        forces = rod_forces_along(dynamics, run)
        for values in (forces.largest, forces.least, forces.at(0.3)):
            assert np.abs(values[0] - rest.rod_forces).max() < 1e-9

    def test_at_rest_with_weight(self):
        """Weight is spread: in the middle stands what the equilibrium has, and m g . e/2 more at the lower end."""
        dynamics, rest, run = at_rest(shell_scene(gravity={"g": 9.8}, pins=["P1_*_1"]))
        forces = rod_forces_along(dynamics, run)
        rods = dynamics.structure.rods
        up = (rest.nodes[rods[:, 1]] - rest.nodes[rods[:, 0]])[:, 2] / dynamics.structure.rod_lengths
        is_free = ~dynamics.structure.pinned[rods].any(axis=1)
        assert np.abs(forces.at(0.5)[0] - rest.rod_forces)[is_free].max() < 1e-9
        assert np.abs(forces.largest[0] - rest.rod_forces - 9.8 / 2 * np.abs(up))[is_free].max() < 1e-9

    def test_spinning_rod(self):
        """A free rod that turns at omega is pulled by m omega^2 L/8 in its middle, and by nothing at its ends."""
        dynamics, (nodes, velocities) = two_rods(speed=0.0, mass=3.0)
        omega = 5.0
        velocities[2:4] = np.cross(omega * X, nodes[2:4] - 0.5 * Z) + 0.7 * X
        run = tc.simulate(dynamics, (nodes, velocities), timepts=np.linspace(0, 1, 7))
        forces = rod_forces_along(dynamics, run)
        assert forces.least[:, 1] == pytest.approx(-3.0 * omega**2 * 2.0 / 8, rel=1e-9)
        assert np.abs(forces.largest).max() < 1e-9

    def test_falling_rod_feels_nothing(self):
        dynamics, start = two_rods()
        scene_gravity = np.array([0.0, 0.0, -9.8])
        heavy = replaced(dynamics.members, gravity=scene_gravity, forces=_weight(dynamics, scene_gravity))
        dynamics = replaced(dynamics, potential=replaced(dynamics.potential, members=heavy))
        run = tc.simulate(dynamics, start, timepts=[0.0, 0.2])
        assert np.abs(rod_forces_along(dynamics, run).largest).max() < 1e-9

    @pytest.mark.parametrize("flipped", [False, True])
    def test_pendulum(self, flipped):
        """The pull at a distance s from the pin: m g cos(angle)(1 - s) + m omega^2 L/2 (1 - s^2)."""
        nodes = {"o": [0, 0, 0], "head": [1.2, 0, -1.6], "far": [90, 0, 0]}
        rod = ["head", "o"] if flipped else ["o", "head"]
        scene = network_scene(
            nodes, {"rod": rod}, {"tie": ["head", "far"]}, ["o", "far"],
            tendons={"rest_length": 200.0}, gravity={"g": 9.8}, rods={"mass": 1.7},
        )  # fmt: skip
        dynamics = tc.build_dynamics(scene)
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=np.linspace(0, 2, 9))
        forces = rod_forces_along(dynamics, run)
        cosine = -run.nodes[:, 1, 2] / 2.0
        spin = np.linalg.norm(run.velocities[:, 1], axis=1) / 2.0
        for s in (0.0, 0.3, 1.0):
            pull = 1.7 * (9.8 * cosine * (1 - s) + spin**2 * 2.0 / 2 * (1 - s**2))
            assert np.abs(forces.at(1 - s if flipped else s)[:, 0] + pull).max() < 1e-8
        wanted = np.maximum(0.0, -1.7 * (9.8 * cosine + spin**2))
        assert np.abs(forces.largest[:, 0] - wanted).max() < 1e-8

    def test_extremes_are_those_of_the_curve(self, rng):
        """In wild motion, with drag, dampers and a push: the largest and least values along the rod."""
        scene = shell_scene(pins=["P1_1_1", "P3_2_1"], drag={"coefficient": 0.4}, tendons={"damping": 0.5})
        dynamics = tc.build_dynamics(scene)
        push = tc.Push("P4_1_1", (30.0, 0.0, 0.0), 0.0, 0.2)
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=np.linspace(0, 0.4, 21), pushes=[push])
        forces = rod_forces_along(dynamics, run, [push])
        curve = np.stack([forces.at(s) for s in np.linspace(0, 1, 2001)])
        assert np.abs(curve.max(axis=0) - forces.largest).max() < 1e-9
        assert np.abs(curve.min(axis=0) - forces.least).max() < 1e-4

    def test_balances_every_piece(self):
        """dC/ds is weight less inertia of a piece, with accelerations from differences of recorded velocities."""
        scene = shell_scene(pins=["P1_1_1", "P4_2_1"], drag={"coefficient": 0.4}, gravity={"g": 9.8})
        dynamics = tc.build_dynamics(scene)
        h = 1e-5
        moments = 0.05 + np.arange(3) * h
        push = tc.Push("P4_1_1", (30.0, 0.0, 0.0), 0.0, 0.2)
        run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=moments, pushes=[push])
        forces = rod_forces_along(dynamics, run, [push])
        acceleration = (run.velocities[2] - run.velocities[0]) / (2 * h)
        rods, members = dynamics.structure.rods, dynamics.members
        e = (run.nodes[1, rods[:, 1]] - run.nodes[1, rods[:, 0]]) / dynamics.structure.rod_lengths[:, None]
        felt = members.mass[:, None] * np.einsum(
            "ri,rki->rk", e, members.gravity - acceleration[rods]
        )  # along the rod at tail and head, N; the drag of held ends is the ground's
        s = np.array([0.0, 0.5, 1.0])[:, None]
        slope = (forces.at(s[1] + 1e-4) - forces.at(s[1] - 1e-4))[1] / 2e-4
        assert np.abs(slope - felt.mean(axis=1)).max() < 1e-3


def _weight(dynamics, gravity):
    forces = np.zeros_like(dynamics.structure.nodes)
    np.add.at(forces, dynamics.structure.rods, 0.5 * dynamics.members.mass[:, None, None] * gravity)
    return forces


class TestBuckling:
    def test_euler_load(self):
        """A steel tube of 1 m: pi^2 EI/L^2; four times less at twice the length."""
        assert euler_loads(np.array([10.0, 10.0]), np.array([1.0, 2.0])) == pytest.approx([98.69604401, 24.674011])

    def test_crossing_at_the_right_time(self):
        """Compression 10 t against a load of 7: reached at 0.7 s, between records."""
        time = np.linspace(0, 2, 9)
        found = buckling(time, 10 * time[:, None] * [1.0, 0.1, -1.0], np.full(3, 7 / np.pi**2), np.ones(3))
        assert [(o.rod, o.begins, o.time) for o in found.overloads] == [(0, pytest.approx(0.7), 2.0)]
        assert found.overloads[0].share == pytest.approx(20 / 7)
        assert (found.share[:, 2] == 0).all()

    def test_is_warned_of(self):
        """Only rods with EI are looked at, at the load that their own force reaches."""
        _, rest, _ = at_rest(shell_scene())
        load = rest.rod_forces[0] * tc.build_structure(shell_scene()).rod_lengths[0] ** 2 / np.pi**2
        dynamics, rest, run = at_rest(shell_scene(rods={"EI": {"r1_2_1": 0.99 * load, "r1_1_1": 1.01 * load}}))
        sanity = tc.inspect_run(dynamics, run)
        assert sanity.buckling is not None
        assert np.isfinite(sanity.buckling.critical).sum() == 2
        assert [w.split(" would")[0] for w in sanity.warnings] == ["rod r1_2_1"]
        assert not any("buckling" in missing for missing in sanity.not_checked)

    def test_without_EI_nothing_is_computed(self, free):
        dynamics, rest, _ = free
        sanity = tc.inspect_run(dynamics, tc.simulate(dynamics, rest, timepts=[0.0]))
        assert sanity.buckling is None
        assert "buckling: give rods.EI" in sanity.not_checked


class Heard(Progress):
    """Keeps what would be said."""

    def __init__(self):
        super().__init__(quiet=True)
        self.warnings = []

    def warn(self, sentence):
        self.warnings.append(sentence)


@pytest.fixture(scope="module")
def passed(tmp_path_factory):
    """A scene through the pipeline whose rods pass through each other and would buckle."""
    scene = shell_scene(rods={"EI": 12.0}, simulation={"t_end": 0.3}, report={})
    folder, heard = tmp_path_factory.mktemp("sanity") / "out", Heard()
    return tc.run(scene, folder, progress=heard), folder, heard


class TestPipeline:
    def test_says_it_everywhere(self, passed):
        results, folder, heard = passed
        warnings = results.sanity.warnings
        assert any("pass through" in w for w in warnings)
        assert any("would buckle" in w for w in warnings)
        assert heard.warnings == list(warnings)
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["sanity"]
        assert summary["warnings"] == list(warnings)
        assert summary["rod_rod_clearance_m"] == results.sanity.rods.least
        assert summary["rod_rod_passings"] == 6
        assert summary["largest_share_of_euler_load"] == results.sanity.buckling.share.max()
        page = (folder / "report.html").read_text(encoding="utf-8")
        assert page.count("pass through each other at") == 4
        for title in ("Least distance, mm", "Rod compression over Euler load", "Slack tendons, %"):
            assert title in page

    def test_pushes_act_on_rods(self, tmp_path):
        """A push of 1000 N along a pinned rod is carried by it while it lasts."""
        scene = pendulum_scene(
            simulation={"t_end": 0.02, "push": [{"node": "head", "force": [-1000, 0, 0], "from": 0.0, "to": 0.01}]}
        )
        sanity = tc.run(scene, tmp_path / "out").sanity
        assert sanity is not None
        during = sanity.time < 0.010001
        assert sanity.forces.largest[during, 0][:-1] == pytest.approx(1000 + 40, abs=1.0)
        assert sanity.forces.largest[~during, 0] == pytest.approx(40, abs=1.0)
