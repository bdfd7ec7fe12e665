"""Limits hold between planned shapes as at them: tensions and inputs with inertia, rods, rates, on dense samples."""

import json
import re

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc
from tensctl.elements import rod_gaps
from tensctl.statics import settle
from tensctl.synthesis import all_along
from tensctl.synthesis.legs import legs_of
from tensctl.synthesis.pace import _as_it_is, _told_below
from tensctl.synthesis.shape_limits import Asked
from tensctl.synthesis.target import wanted_target

PINS = ["P1_*_1"]
MAST, TALL = shell_scene(pins=PINS), shell_scene(3, 2, pins=PINS)
STALLS = shell_scene(3, 2, pins=PINS, actuators={"force_max": 15.3})
QUARTER = {"waypoint": [{"tilt": [0.4, 0.0]}, {"circle": "tilt", "turns": 0.25, "duration": 2.5}]}

# Scene, target, what else is asked of the path, and what its shapes alone lack, in words.
CASES = {
    "rods round a corner": (TALL, QUARTER, {"clearance": 0.18}, r"rods r\S+ and r\S+ come to 0.17\d+ m, nearer than"),
    "rods near from the start": (MAST, {"height_scale": 1.2}, {"clearance": 0.127}, "rods r.* come to 0.126"),
    "floors far above the start": (
        MAST,
        {"height_scale": 1.2},
        {"tension_min": 6.0},
        r"t6_\d_1 falls to 5.96\d N, below",
    ),
    "stall limits": (STALLS, {"twist": -0.4}, {}, r"t4_\d_1 rises to 15.3 N, above its force_max"),
    "largest change": (MAST, {"height_scale": 1.1, "duration": 3.0}, {"u_max": 0.07045}, "the input of t.* beyond its"),
}


def planned(name):
    scene, target, asked, _ = CASES[name]
    asked = {"tension_min": 0.1, "rate_max": 2.0} | asked
    clearance = asked.pop("clearance", None)
    path = tc.plan_shape(scene, target if clearance is None else target | {"clearance": clearance}, **asked)
    return path, Asked(asked["tension_min"], clearance, asked.get("u_max")), asked["rate_max"]


@pytest.fixture(scope="module", params=CASES)
def case(request):
    """Path, what was asked of it, rate limit."""
    return planned(request.param)


def gaps(path, nodes):
    return rod_gaps(path.target.structure.rods, path.target.potential.members.radius, nodes).least


class TestDenseSamples:
    """About 250 a way between two shapes; the planner looks at 62."""

    def test_tensions(self, case):
        path, asked, _ = case
        time = np.linspace(path.time[1], path.ends, 2001)
        kept = ~path.target.structure.grounded_tendons
        tensions = path.tensions_at(time)[:, kept]
        rounding = 2e-6 * tensions.max()
        assert tensions.min() >= asked.tension_min - rounding
        assert (tensions.max(axis=0) <= path.target.potential.members.force_max[kept] + rounding).all()

    def test_inputs_and_their_rates(self, case):
        path, asked, rate_max = case
        limits, time = asked.limits(path.target), np.linspace(path.start, path.ends, 2001)
        inputs = path.inputs_at(time)
        assert (inputs >= limits.lower - 2e-6).all()
        assert (inputs <= limits.upper + 2e-6).all()
        assert np.abs(np.diff(inputs, axis=0)).max() / (time[1] - time[0]) <= rate_max

    def test_rods_and_their_equilibria(self, case):
        """On the moving path, and where its rest lengths lead when it is infinitely slow."""
        path, asked, _ = case
        if asked.clearance is None:
            return
        time = np.linspace(path.start, path.ends, 501)
        assert min(gaps(path, path.nodes_at(t)) for t in time) > asked.clearance - 1e-6
        for t in time[::8]:
            found = settle(path.target.potential, start=path.nodes_at(t), inputs=path.balanced_inputs_at(t))
            assert gaps(path, found.nodes) > asked.clearance - 3e-6


@pytest.mark.parametrize("name", CASES)
def test_shapes_alone_would_lack_it(name, monkeypatch):
    """Without plans after the first, the same limits are passed between its shapes, and the sentence says where."""
    monkeypatch.setattr(all_along, "_ROUNDS", 0)
    with pytest.raises(tc.SynthesisError, match=rf"between \d.* s {CASES[name][3]}"):
        planned(name)


def test_what_inertia_takes_is_refused_with_the_time_that_would_do():
    with pytest.raises(
        tc.SynthesisError, match=r"= 0.4 s is quick for this prestress: inertia would take t1_.*; allow"
    ) as caught:
        tc.plan_shape(MAST, {"height_scale": 1.2, "duration": 0.4}, tension_min=0.1)
    needed = float(str(caught.value).split("allow ")[1].split(" s")[0])
    path = tc.plan_shape(MAST, {"height_scale": 1.2, "duration": 1.01 * needed}, tension_min=0.1)
    kept = ~path.target.structure.grounded_tendons
    assert path.tensions_at(np.linspace(0, path.ends, 2001))[:, kept].min() >= 0.1


def test_a_start_far_below_its_floor_is_told_to_tighten_first():
    """The waypoint that the sentence asks for leads to the floor; what was wanted then takes the time that it had."""
    asked, wanted = {"tension_min": 20.0, "rate_max": 0.5}, {"height_scale": 1.05, "duration": 3.0}
    sentence = r"or tighten first, since the start has 3\.\d+ N in t\S+, below tension_min = 20 N: put a waypoint with"
    with pytest.raises(tc.SynthesisError, match=sentence) as caught:
        tc.plan_shape(MAST, wanted, **asked)
    key, value, duration = re.search(
        r"with (\w+) = (\S+|\[.*\]) and duration = (\S+) before", str(caught.value)
    ).groups()
    first = {key: json.loads(value), "duration": float(duration)}
    path = tc.plan_shape(MAST, {"waypoint": [first, wanted]}, **asked)
    kept = ~path.target.structure.grounded_tendons
    tight = path.legs[1].start
    assert path.tensions_at(np.linspace(tight, path.ends, 2001))[:, kept].min() > 20.0 * (1 - 1e-6)
    lowest = path.tensions_at(np.linspace(0.0, tight, 2001))[:, kept].min(axis=1)
    assert lowest[0] < 4.0
    assert np.diff(lowest).min() > -1e-3, "tightening falls back"
    assert path.fastest <= 0.5


@pytest.mark.parametrize("floor", [-1.0, float("nan"), float("inf")])
def test_a_floor_below_which_tendons_push_is_refused(floor):
    with pytest.raises(tc.SynthesisError, match=rf"tension_min is {floor}; expected a finite number >= 0"):
        tc.plan_shape(MAST, 1.1, tension_min=floor)


@pytest.mark.parametrize(
    ("scene", "target", "said"),
    [
        (MAST, {"twist": 0.1}, "twist = 0.0"),
        (MAST, {"tip": [0.1, 0.0]}, "tip = [0.0, 0.0]"),
        (MAST, {"tilt": [0.1, 0.0]}, "tilt = [0.0, 0.0]"),
        (MAST, {"nodes": {"P4_1_1": [0.0, 0.0, 1.0]}}, "nodes.P4_1_1 = ["),
    ],
)
def test_what_a_waypoint_says_to_stay(scene, target, said):
    rest = tc.find_equilibrium(scene)
    (leg,) = legs_of(wanted_target(scene, target), rest.structure, rest.nodes)
    told = _as_it_is(leg.features[0], rest.nodes)
    assert told.startswith(said)
    if "nodes" in told:
        place = json.loads(told.split("= ")[1])
        assert place == pytest.approx(rest.nodes[rest.structure.node_labels.index("P4_1_1")], rel=1e-5)


def test_inputs_that_inertia_takes_beyond_their_range_are_refused():
    """Where prestress is high, a fifth of a second asks for more than u_max as the mast sets off."""
    tight = shell_scene(pins=PINS, tendons={"rest_ratio": 0.5, "stiffness": 100.0})
    sentence = r"the input of t1_\S+ comes to .* as it moves, and the .*; allow (\S+) s or more\.$"
    with pytest.raises(tc.SynthesisError, match=sentence) as caught:
        tc.plan_shape(tight, {"height_scale": 1.1, "duration": 0.2}, u_max=0.06)
    needed = float(re.search(sentence, str(caught.value))[1])
    path = tc.plan_shape(tight, {"height_scale": 1.1, "duration": needed}, u_max=0.06)
    assert np.abs(path.inputs_at(np.linspace(0, needed, 2001))).max() <= 0.06 + 1e-6


def test_inertia_that_passes_a_floor_above_the_start_is_told_to_tighten_first():
    """Tightened first, the same way needs a fraction of the time that it needs from the start."""
    asked, wanted = {"tension_min": 4.0, "rate_max": 5.0}, {"height_scale": 1.2, "duration": 0.5}
    with pytest.raises(tc.SynthesisError, match="inertia would take") as caught:
        tc.plan_shape(MAST, wanted, **asked)
    sentence = r"allow (\S+) s or more; or tighten first, .* put a waypoint with (\w+) = (\S+) before the others\.$"
    needed, key, value = re.search(sentence, str(caught.value)).groups()
    path = tc.plan_shape(MAST, wanted | {"duration": float(needed)}, **asked)
    assert path.duration < 6.0, "what room the floor leaves would say 66 s"
    legs = [{key: json.loads(value), "duration": 1.0}, wanted]
    with pytest.raises(tc.SynthesisError, match=r"waypoint\[1\].* is quick for this prestress") as caught:
        tc.plan_shape(MAST, {"waypoint": legs}, **asked)
    assert "tighten first" not in str(caught.value)
    for duration, k in re.findall(r"(\S+) s or more in target.waypoint\[(\d)\]", str(caught.value)):
        legs[int(k)] = legs[int(k)] | {"duration": float(duration)}
    tight = tc.plan_shape(MAST, {"waypoint": legs}, **asked)
    assert tight.legs[1].duration < path.duration


@pytest.mark.parametrize(("value", "said"), [(0.4961, "0.496"), (5.99953, "5.9995"), (-2.0, "-2")])
def test_a_tension_below_its_floor_reads_as_below_it(value, said):
    assert _told_below(value, 6.0) == said
