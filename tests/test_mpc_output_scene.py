"""Predictive control from sensors, asked for by a scene: what is run, reported and certified is what sensors say."""

import json

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc
from tensctl.pipeline.certificate import _as_then
from tensctl.simulation import Measurement

WIND = {"node": "P4_*", "force": [1.0, 0.0, 0.0], "times": [0.1, 0.2], "factors": [0.0, 1.0]}
MPC = {"horizon": 5, "tension_min": 0.5, "feedback": "outputs"}
SENSORS = {"lengths": 1e-4, "tensions": 1e-2, "seed": 1}


def windy(t_end, **sections):
    simulation = {"t_end": t_end, "controller": "mpc", "history": [WIND]}
    return shell_scene(pins=["P1_*_1"], mpc=MPC, sensors=SENSORS, simulation=simulation, **sections)


@pytest.fixture(scope="module")
def blown(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blown") / "out"
    return tc.run(windy(5.0, report={}), folder), folder


def test_the_shape_is_held_without_offset(blown):
    """A wind that leans the mast by 63 mm under control of the exact state leaves less than a millimetre."""
    results, folder = blown
    assert isinstance(results.mpc, tc.OutputMPC)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert summary["simulation"]["largest_shape_error_m"] > 0.05
    assert summary["simulation"]["final_shape_error_m"] < 1e-3
    mpc = summary["mpc"]
    assert (mpc["feedback"], mpc["measured"], mpc["tracked"]) == ("outputs", 48, 24)
    assert mpc["hard_limit_violations"] == 0
    assert mpc["cvxpy_cost_difference"] < 1e-7
    assert mpc["cvxpy_input_difference_m"] < 1e-7
    assert "48 sensors, 24 tracked" in (folder / "report.html").read_text(encoding="utf-8")


def test_the_step_that_is_certified_is_the_one_that_was_taken(blown):
    """The controller is brought back to what it knew then: its answer is the command of the run."""
    results, _ = blown
    run, k = results.run, 40
    twin, reading = _as_then(results.mpc, run, k)
    asked = twin.step(float(run.time[k]), reading)
    assert np.abs(asked - run.inputs[k + 1]).max() < 1e-12
    assert np.abs(asked).max() > 1e-3
    assert len(results.mpc.records) == run.kkt.size


def test_observing_is_what_a_step_remembers(blown):
    mpc, run = blown[0].mpc, blown[0].run
    stepped, observed = (tc.OutputMPC(mpc.linear, mpc.sensors, horizon=3) for _ in range(2))
    for k in range(5):
        shown = Measurement(run.nodes[k], run.velocities[k], run.lengths[k], run.tensions[k], run.inputs[k])
        reading = mpc.sensors.read(shown, k)
        stepped.step(0.02 * k, reading)
        observed.observe(0.02 * k, reading)
    assert (stepped.estimate.mean == observed.estimate.mean).all()
    with pytest.raises(tc.SynthesisError, match="48 sensors read"):
        observed.observe(0.1, None)


def test_a_path_is_followed_from_where_it_starts(tmp_path):
    """The linear model is that of the start, where the filter begins; the reference is the path."""
    scene = shell_scene(
        pins=["P1_*_1"], mpc=MPC, sensors=SENSORS, target={"height_scale": 1.05, "duration": 0.8},
        simulation={"t_end": 3.5, "controller": "mpc"},
    )  # fmt: skip
    results = tc.run(scene, tmp_path / "out")
    moved = np.array([results.path.nodes_at(t) for t in results.run.time])
    off = np.linalg.norm(results.run.nodes - moved, axis=2).max(axis=1)
    assert off[results.run.time < 0.8].max() < 0.013  # a target that stays for the horizon is 19 mm behind
    assert results.mpc.linear.equilibrium is results.equilibrium
    assert results.mpc.wanted is results.path
    assert results.shape_error[0] > 0.03
    assert results.shape_error[-1] < 1e-3


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ({"mpc": MPC}, r'mpc.feedback is "outputs"; expected a section \[sensors\]'),
        ({"mpc": MPC | {"feedback": "noses"}}, "mpc.feedback is"),
        ({"mpc": MPC | {"drift": 0}}, "mpc.drift is 0"),
        ({"mpc": MPC | {"track": "l_*"}}, "mpc.track is"),
    ],
)
def test_refused_scenes(sections, sentence):
    with pytest.raises(tc.SceneError, match=sentence):
        shell_scene(pins=["P1_*_1"], **sections)


def test_what_nothing_measures_cannot_be_tracked(tmp_path):
    scene = windy(0.1).replaced(mpc=MPC | {"track": ["P4_1_1_z"]})
    with pytest.raises(tc.TensctlError, match='track: "P4_1_1_z" names nothing'):
        tc.run(scene, tmp_path / "out")


def test_an_output_follows_its_course_from_sensors(tmp_path):
    """In a wind that nothing measures; what the run made of it is told against the path."""
    course = {"output": "l_t5_1_1", "size": 1e-3, "times": [0.5, 1.0], "change": [0.0, 0.02]}
    results = tc.run(windy(3.0).replaced(mpc=MPC | {"follow": [course]}), tmp_path / "out")
    told = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["mpc"]
    tendon = results.structure.tendon_labels.index("t5_1_1")
    change = results.run.lengths[:, tendon] - results.equilibrium.lengths[tendon]
    wanted = np.interp(results.run.time, [0.5, 1.0], [0.0, 0.02])
    assert told["followed"]["l_t5_1_1"]["worst"] == pytest.approx(np.abs(change - wanted).max(), rel=1e-6)
    assert abs(change[-1] - 0.02) < 1e-3
    assert told["cvxpy_cost_difference"] < 1e-7
    assert told["cvxpy_input_difference_m"] < 1e-7
