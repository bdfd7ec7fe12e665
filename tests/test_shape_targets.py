"""Several kinds of shape are wanted by one interface: features with exact gradients, met together along a path."""

import re
from pathlib import Path

import numpy as np
import pytest
from support import mast_scene, order_of, prism_scene, random_motion, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Potential
from tensctl.scene import TargetStage
from tensctl.simulation.clearance import Segments, clearance
from tensctl.synthesis import too_quick
from tensctl.synthesis.target import features_of

PINS = ["P1_*_1"]
EXAMPLES = Path(__file__).parents[1] / "examples"
ALL = TargetStage.checked(height_scale=1.1, twist=0.3, tip=[0.1, -0.05], nodes={"P4_1_2": [1.0, 0.0, 2.0]})


def ring(equilibrium, kind, stage):
    labels = equilibrium.structure.node_labels
    return np.array([equilibrium.nodes[k] for k, x in enumerate(labels) if re.fullmatch(rf"P{kind}_\d+_{stage}", x)])


@pytest.fixture(scope="module")
def rest():
    return tc.find_equilibrium(shell_scene(3, 2, pins=PINS))


def test_gradients(rest):
    """Remainders of the first-order model: of second order for the twist, none for linear features."""
    rng = np.random.default_rng(1)
    away, direction = random_motion(Potential.of(shell_scene(3, 2, pins=PINS)), rng, reach=0.2)
    for feature, _ in features_of(ALL, rest.structure, rest.nodes):
        slope, here = feature.slope(away), feature.of(away)

        def left(step, feature=feature, slope=slope, here=here):
            return feature.of(away + step * direction) - here - step * (slope * direction).sum()

        if feature.name.startswith("twist"):
            assert taylor_order(left, np.array([1e-1, 1e-2, 1e-3])) > 1.9
        else:
            assert abs(left(1.0)) < 1e-13


@pytest.mark.parametrize("angle", [-2.0, 0.4, 3.0])
def test_twist_of_a_turned_ring_is_its_angle(rest, angle):
    """Turning, moving and widening the top ring turns it by the angle; turning everything twists nothing."""
    (twist, _), *_ = features_of(TargetStage.checked(twist=0.1), rest.structure, rest.nodes)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    labels, turned = rest.structure.node_labels, rest.nodes.copy()
    top = [k for k, label in enumerate(labels) if label.startswith("P4") and label.endswith("_2")]
    turned[top] = 1.3 * turned[top] @ turn.T + [0.3, -0.2, 0.5]
    assert twist.of(turned) == pytest.approx(angle, abs=1e-14)
    assert twist.of(rest.nodes @ turn.T) == pytest.approx(0.0, abs=1e-14)


@pytest.fixture(scope="module")
def several():
    scene = shell_scene(3, 2, pins=PINS)
    return tc.plan_shape(scene, {"height_scale": 1.1, "twist": 0.3, "tip": [0.1, -0.05]}, tension_min=0.1)


def test_several_at_once(several):
    """Measured anew from the rings: the turn by the best rotation of the plane (Kabsch)."""
    several.verify(0.1)
    first, last = several.equilibria[0], several.target
    shifts, heights = [], []
    for e in (first, last):
        shift = ring(e, 4, 2).mean(axis=0) - ring(e, 1, 1).mean(axis=0)
        shifts.append(shift[:2])
        heights.append(shift[2])
    assert heights[1] == pytest.approx(1.1 * heights[0], abs=1e-11)
    assert np.abs(shifts[1] - shifts[0] - [0.1, -0.05]).max() < 1e-11
    a, b = ((r := ring(e, 4, 2)[:, :2]) - r.mean(axis=0) for e in (first, last))
    u, _, vt = np.linalg.svd(a.T @ b)
    best = vt.T @ np.diag([1, np.sign(np.linalg.det(vt.T @ u.T))]) @ u.T
    assert np.arctan2(best[1, 0], best[0, 0]) == pytest.approx(0.3, abs=1e-11)


def test_each_wanted_value_grows_in_equal_steps(several):
    for feature in several.features:
        values = [feature.of(e.nodes) for e in several.equilibria]
        assert np.abs(np.diff(values, 2)).max() < 1e-10


def test_small_twists_need_changes_in_proportion():
    """A half twist needs half the change, to first order."""
    scene = shell_scene(3, 2, pins=PINS)
    angles = np.array([0.08, 0.04, 0.02])
    ways = [tc.plan_shape(scene, {"twist": float(a)}, tension_min=0.1).target.inputs / a for a in angles]
    apart = [np.abs(ways[k] - ways[k + 1]).max() for k in range(2)]
    assert order_of(angles[:2], apart) > 0.9


def test_nodes_of_a_network():
    scene = mast_scene(PINS)
    rest = tc.find_equilibrium(scene)
    k = rest.structure.node_labels.index("P4_1_2")
    place = rest.nodes[k] + [0.03, 0.02, 0.04]
    path = tc.plan_shape(scene, {"nodes": {"P4_1_2": place.tolist()}}, start=rest, tension_min=0.1)
    path.verify(0.1)
    assert np.abs(path.target.nodes[k] - place).max() < 1e-11


@pytest.mark.parametrize(
    ("scene", "target", "sentence"),
    [
        (shell_scene(), {"tip": [0.1, 0.0]}, "target.tip needs pins"),
        (shell_scene(), {"nodes": {"P4_1_1": [0.0, 0.0, 1.0]}}, "target.nodes needs pins"),
        (shell_scene(pins=PINS), {"nodes": {"top": [0.0, 0.0, 1.0]}}, "target.nodes names top"),
        (shell_scene(pins=PINS), {"tip": [0.1]}, "tip is .0.1.; expected two numbers"),
        (shell_scene(pins=PINS), {"start": 1.0}, "names no shape; expected height_scale, twist, tip, tilt or nodes"),
        (prism_scene(), {"twist": 0.1}, "target.twist needs a shell"),
    ],
)
def test_refusals(scene, target, sentence):
    with pytest.raises(tc.TensctlError, match=sentence):
        tc.plan_shape(scene, target)


@pytest.mark.parametrize(
    ("name", "target", "passings"),
    [
        ("mast_8_4_bends", None, 0),
        ("shell_3_2_twist", None, 0),
        ("shell_3_2_twist", {"twist": 0.4}, 3),
        ("pinned_mast_circle", None, 0),
    ],
)
def test_rods_of_the_examples_stay_clear(name, target, passings):
    """Rods stay 0.1 m apart and pass through no tendon; twisted the other way, three do, as the example says."""
    path = tc.plan_shape(tc.load_scene(EXAMPLES / f"{name}.toml"), target)
    time, structure = path.start + np.linspace(0, path.duration, 61), path.target.structure
    nodes, velocities = (np.stack([at(t) for t in time]) for at in (path.nodes_at, path.velocities_at))
    rods, tendons = (Segments(e, *np.zeros((2, len(e)))) for e in (structure.rods, structure.segments))
    among = clearance(time, nodes, velocities, rods)
    assert among.least > 0.1
    assert not among.passings
    assert len(clearance(time, nodes, velocities, rods, tendons).passings) == passings


def test_the_bent_mast_of_the_examples():
    """(8,4): 64 rods, 304 tendons, the tip 0.8 m aside in an upright base, tensions above the floor."""
    path = tc.plan_shape(tc.load_scene(EXAMPLES / "mast_8_4_bends.toml"), tension_min=0.1)
    path.verify(0.1)
    assert path.target.structure.rods.shape == (64, 2)
    assert ring(path.target, 4, 4).mean(axis=0)[:2] == pytest.approx([0.8, 0.0], abs=1e-10)


def test_the_bent_mast_follows_without_feedback():
    """(8,4), undamped: what little the tendons pull at its bending is enough to follow, in the time that it has."""
    scene = tc.load_scene(EXAMPLES / "mast_8_4_bends.toml")
    path = tc.plan_shape(scene, tension_min=0.1)
    assert too_quick(path, 0.1) is None
    time = path.start + path.duration * np.linspace(0, 1, 201)
    dynamics, inputs = tc.build_dynamics(scene), path.inputs_at(time)
    plan = [tc.Schedule(label, time, inputs[:, k]) for k, label in enumerate(dynamics.input_labels)]
    run = tc.simulate(
        dynamics, path.equilibria[0], schedule=plan, timepts=path.start + np.array([0.0, 5.0, 10.0]), tol=1e-6
    )
    for t, nodes in zip(run.time, run.nodes, strict=True):
        assert np.abs(nodes - path.nodes_at(t)).max() < 0.02


def test_the_twisting_mast_of_the_examples(tmp_path):
    """The run, cut short for the test, ends near its wanted twist."""
    scene = tc.load_scene(EXAMPLES / "shell_3_2_twist.toml").replaced(report=None)
    quick = scene.replaced(target={"twist": -0.05, "duration": 1.0}, simulation={"t_end": 2.0, "controller": "mpc"})
    results = tc.run(quick, out=tmp_path)
    (twist,) = results.path.features
    assert twist.of(results.run.nodes[0]) == pytest.approx(0.0, abs=1e-9)
    assert twist.of(results.run.nodes[-1]) == pytest.approx(-0.05, abs=1e-3)
