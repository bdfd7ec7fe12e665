"""What stands in the way of a shape: named limits prove it, and searches that lead nowhere end soon, by linprog."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog
from support import shell_scene

import tensctl as tc
from tensctl.synthesis.blocked import block_of
from tensctl.synthesis.legs import legs_of
from tensctl.synthesis.qp import QP
from tensctl.synthesis.shape import ShapeProblem, _Tries
from tensctl.synthesis.shape_limits import Asked
from tensctl.synthesis.target import wanted_target

PINS = ["P1_*_1"]
MAST = shell_scene(pins=PINS)


def feasible(qp, rows, bounds):
    """Whether anything keeps these rows and these limits of the variables."""
    count = len(qp.f)
    A, lower, upper = qp.A[rows], qp.lower[count:][rows], qp.upper[count:][rows]
    A_ub, b_ub = np.vstack([A, -A]), np.concatenate([upper, -lower])
    finite = np.isfinite(b_ub)
    box = [(low, up) if k else (None, None) for low, up, k in zip(qp.lower, qp.upper, bounds, strict=False)]
    found = linprog(np.zeros(count), A_ub[finite], b_ub[finite], bounds=box)
    assert found.status in (0, 2)
    return found.status == 0


@pytest.fixture(scope="module")
def rest():
    return tc.find_equilibrium(MAST)


class TestBlock:
    @pytest.mark.parametrize("seed", range(20))
    def test_is_infeasible_by_itself_and_the_rest_is_not(self, seed):
        """An equality out of reach, inequalities half of which are far away, and limits of variables."""
        rng = np.random.default_rng(seed)
        count, rows = 6, 9
        A = rng.standard_normal((rows, count))
        lower = np.concatenate([[60.0], rng.uniform(-3, -0.5, rows - 1)])
        upper = np.concatenate([[60.0], np.full(rows - 1, np.inf)])
        box = np.full(count, 1.0)
        qp = QP(np.eye(count), np.zeros(count), A, np.concatenate([-box, lower]), np.concatenate([box, upper]))
        assert not feasible(qp, np.ones(rows, bool), np.ones(count, bool))
        block = block_of(qp, rng.uniform(-1, 1, count))
        assert block.rows[0]
        assert not feasible(qp, block.rows, block.lower | block.upper)
        assert feasible(qp, ~block.rows, np.ones(count, bool))
        assert block.rows.sum() + (block.lower | block.upper).sum() <= count + 1

    def test_a_little_too_much_has_the_same_limits_as_a_lot(self):
        """Two inputs up to 1 m, whose sum is wanted to be 2 m and a bit; a third one matters to none."""
        for more in (1.0, 1e-3, 1e-8):
            wanted = 2.0 + more
            A, far = np.array([[1.0, 1.0, 0.0]]), np.array([1.0, 1.0, 9.0, wanted])
            block = block_of(QP(np.eye(3), np.zeros(3), A, np.append(-far[:3], wanted), far), np.array([0.9, 0.8, 0.0]))
            assert block.upper.tolist() == [True, True, False]
            assert not block.lower.any()
            assert block.rows.tolist() == [True]


@pytest.mark.parametrize(
    ("more", "target", "asked", "sentence"),
    [
        ({}, 3.0, {"tension_min": 0.1}, r"t1_\d_1, .* at tension_min.*; ask for less, or lower tension_min. The way"),
        ({}, 1.2, {"u_max": 0.03}, r"most u_max: t1_1_1, t\S+, .* at u_max; .* or raise mpc.u_max. The way leads 12"),
        ({"force_max": 13.3}, 1.05, {"tension_min": 12.0}, r"t4_1_1, .* at force_max and .* raise actuators.force_max"),
        ({"tendons": ["t7_1_1"]}, {"tip": [0.3, 0.3]}, {}, "no limit stands in the way, but no rest length moves it"),
    ],
)
def test_limits_in_the_way_are_named(more, target, asked, sentence):
    scene = shell_scene(pins=PINS, **({"actuators": more} if more else {}))
    with pytest.raises(tc.SynthesisError, match=sentence):
        tc.plan_shape(scene, target, **asked)


@pytest.mark.parametrize("pins", [PINS, {"P1_*_1": "xyz", "P4_1_1": "xy"}])
def test_a_place_in_which_the_ground_holds_a_node_is_refused(pins):
    scene = shell_scene(pins=pins)
    rest = tc.find_equilibrium(scene)
    with pytest.raises(tc.SynthesisError, match=r"wants P1_1_1 at \[0, 0, 1\], but the ground holds it along"):
        tc.plan_shape(scene, {"nodes": {"P1_1_1": [0.0, 0.0, 1.0]}}, start=rest)
    if pins is PINS:
        return
    place = rest.nodes[rest.structure.node_labels.index("P4_1_1")]
    with pytest.raises(tc.SynthesisError, match=r"holds it along x and y at .*; name a node that can move there"):
        tc.plan_shape(scene, {"nodes": {"P4_1_1": [place[0] + 0.01, place[1], place[2]]}}, start=rest)
    path = tc.plan_shape(scene, {"nodes": {"P4_1_1": [place[0], place[1], place[2] + 0.05]}}, start=rest)
    assert [feature.name for feature in path.features] == ["P4_1_1 z, m"]


class TestSearch:
    def test_ends_where_nothing_gets_better(self, rest):
        """Two hundredths of a misfit in twenty tries lead on, two thousandths do not; what is met is left alone."""
        for falls, leads in ((0.999, True), (0.9999, False)):
            tries = _Tries(rest, 0.1)
            for k in range(1, 21):
                assert tries.lead_on
                tries.add(rest, 0.1 * falls**k)
            assert tries.lead_on is leads
        met = _Tries(rest, 1e-9)
        for _ in range(40):
            met.add(rest, 1e-9)
        assert met.lead_on

    @pytest.mark.parametrize(
        ("misfits", "ends"),
        [
            (np.full(60, 0.1), 20),
            (np.linspace(0.1, 0.2, 60), 20),
            (0.1 * 0.999 ** np.arange(60), None),
            (np.append(1e-6, np.linspace(2e-6, 1e-4, 59)), None),
        ],
        ids=["as far", "farther", "nearer", "met before"],
    )
    def test_cheaper_counts_once_the_shape_is_met(self, rest, misfits, ends):
        """Every try costs less than the one before; out of reach that is no progress."""
        shortened = rest.potential.members.shortened
        changed = [replace(rest, rest_lengths=shortened(0.2 - 0.002 * k + 0 * rest.inputs)) for k in range(60)]
        tries = _Tries(changed[0], misfits[0])
        for now, misfit in zip(changed[1:], misfits[1:], strict=True):
            if not tries.lead_on:
                break
            tries.add(now, misfit)
        assert tries.lead_on is (ends is None)
        assert tries.count == (59 if ends is None else ends)

    def test_a_shape_out_of_reach_takes_few_tries(self, monkeypatch):
        """The mast cannot be drawn to thrice its height: some 15 tries say so, where 200 did not."""
        worse, tries = ShapeProblem._worse, []
        monkeypatch.setattr(ShapeProblem, "_worse", lambda *a: tries.append(a[0]) or worse(*a))
        with pytest.raises(tc.SynthesisError) as caught:
            tc.plan_shape(MAST, 3.0, tension_min=0.1)
        assert sum(problem is tries[-1] for problem in tries) < 60
        had, sought = re.findall(r"height (\S+) m", str(caught.value))[:2]
        assert had != sought

    def test_values_are_told_apart(self, rest):
        (leg,) = legs_of(wanted_target(MAST, 1.1), rest.structure, rest.nodes)
        asked = Asked(0.1)
        problem = ShapeProblem(leg.features, asked, asked.limits(rest))
        told = problem._told_apart(np.array([1.8630123]), np.array([1.8630456]))
        assert told == ["height 1.86301 m", "height 1.86305 m"]
        assert problem._told_apart(np.array([-1e-17])) == ["height 0 m"]
