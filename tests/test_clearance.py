"""Rods keep a distance along a planned path: distances against the run's own kernel, gradients, least change."""

import numpy as np
import pytest
from support import random_motion, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential, rod_gaps
from tensctl.simulation.segments import nearest
from tensctl.statics import static_influence

PINS = ["P1_*_1"]
SCENE = shell_scene(pins=PINS)
TALL = {"height_scale": 1.2}
CLEARANCE = 0.11


def gaps_at(structure, nodes, radius=0.0):
    return rod_gaps(structure.rods, np.full(len(structure.rods), radius), nodes)


class TestDistances:
    def test_are_those_of_a_run(self):
        """The same as the compiled kernel that looks over runs, in random, parallel and touching positions."""
        rng, rods = np.random.default_rng(0), np.array([[0, 1], [2, 3]])
        for trial in range(300):
            nodes = rng.standard_normal((4, 3))
            if trial % 3 == 1:
                nodes[3] = nodes[2] + rng.uniform(-2, 2) * (nodes[1] - nodes[0])
            if trial % 3 == 2:
                nodes[2:, 2] = nodes[:2, 2] = 0.0
            gaps = rod_gaps(rods, np.zeros(2), nodes)
            a, b = nodes[0], nodes[2]
            assert gaps.least == pytest.approx(nearest(a, nodes[1] - a, b, nodes[3] - b)[2], abs=1e-13)

    def test_thickness_and_shared_nodes(self):
        structure = tc.shell(3, 2, cls=2)
        gaps = gaps_at(structure, structure.nodes, radius=0.01)
        rods = structure.rods
        shared = sum(bool(set(rods[a]) & set(rods[b])) for a in range(len(rods)) for b in range(a))
        assert len(gaps.pairs) == len(rods) * (len(rods) - 1) // 2 - shared
        assert gaps.distance == pytest.approx(gaps_at(structure, structure.nodes).distance - 0.02)

    def test_gradients(self):
        """First-order remainders of every pair of a shell, save near switches of the nearest points."""
        potential = Potential.of(SCENE)
        nodes, direction = random_motion(potential, np.random.default_rng(3))
        gaps = gaps_at(potential.structure, nodes)
        some = np.flatnonzero((np.abs(gaps.shares - 0.5) < 0.45).all(axis=1))
        assert some.size > 3
        rates = gaps.slope(some, len(nodes)) @ direction.ravel()

        def left(step):
            moved = gaps_at(potential.structure, nodes + step * direction)
            return (moved.distance - gaps.distance)[some] - step * rates

        assert taylor_order(left, np.array([1e-2, 1e-3, 1e-4])) > 1.9

    @pytest.mark.parametrize("tail", [(0.5, 1.0, 0.2), (2.0, 1.0, 0.2)])
    def test_gradients_at_ends(self, tail):
        """An end against a rod, and an end against an end."""
        rods, head = np.array([[0, 1], [2, 3]]), (2.5, 3.0, 0.3)
        nodes = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), tail, head])
        direction = np.random.default_rng(5).standard_normal((4, 3))
        gaps = rod_gaps(rods, np.zeros(2), nodes)
        rate = (gaps.slope(np.zeros(1, int), 4) @ direction.ravel())[0]

        def left(step):
            return rod_gaps(rods, np.zeros(2), nodes + step * direction).least - gaps.least - step * rate

        assert taylor_order(left, np.array([1e-2, 1e-3, 1e-4])) > 1.9


@pytest.fixture(scope="module")
def rest():
    return tc.find_equilibrium(SCENE)


@pytest.fixture(scope="module")
def near(rest):
    return tc.plan_shape(SCENE, TALL, start=rest, tension_min=0.1)


@pytest.fixture(scope="module")
def clear(rest):
    return tc.plan_shape(SCENE, TALL | {"clearance": CLEARANCE}, start=rest, tension_min=0.1)


def least(equilibrium):
    return gaps_at(equilibrium.structure, equilibrium.nodes).least


class TestPath:
    def test_rods_keep_their_distance(self, near, clear):
        assert least(near.target) < 0.08
        assert min(map(least, clear.equilibria)) > CLEARANCE * (1 - 1e-9)
        assert clear.features[0].of(clear.target.nodes) == pytest.approx(
            near.features[0].of(near.target.nodes), rel=1e-11
        )
        clear.verify(0.1)

    def test_changes_nothing_where_rods_are_clear(self, near, clear):
        free = [k for k, e in enumerate(near.equilibria) if least(e) > CLEARANCE * 1.001]
        assert len(free) == 4
        for k in free[:-1]:  # the last is beside the corner, and gives way for it
            assert np.abs(clear.equilibria[k].inputs - near.equilibria[k].inputs).max() < 1e-6

    def test_least_change(self, clear):
        """KKT: u is a combination of the gradients of the height and of the pairs at the clearance, theirs >= 0."""
        last = clear.target
        gaps = gaps_at(last.structure, last.nodes)
        tight = np.flatnonzero(gaps.distance < CLEARANCE + 2e-4)
        assert tight.size >= 3
        moved = last.point.tangent @ static_influence(last)
        height = clear.features[0].slope(last.nodes).ravel() @ moved
        slopes = np.vstack([gaps.slope(tight, len(last.nodes)) @ moved, height]).T
        multipliers, *_ = np.linalg.lstsq(slopes, last.inputs, rcond=None)
        assert np.abs(last.inputs - slopes @ multipliers).max() < 1e-5 * np.abs(last.inputs).max()
        assert (multipliers[:-1] > 0).all()


class TestRefusals:
    def test_crowded_start(self, rest):
        wanted = {"height_scale": 1.1, "clearance": 0.2}
        with pytest.raises(
            tc.SynthesisError, match=r"start has rods r\d.* only 0.127\d m apart, nearer than .* = 0.2 m"
        ):
            tc.plan_shape(SCENE, wanted, start=rest)

    def test_out_of_reach(self, rest):
        wanted = {"height_scale": 2.5, "clearance": 0.127}
        with pytest.raises(
            tc.SynthesisError, match=r"r\S+ and r.* at target.clearance; .*lower target.clearance. The way leads"
        ):
            tc.plan_shape(SCENE, wanted, start=rest, tension_min=0.1)
