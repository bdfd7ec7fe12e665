"""Calls from Python are refused in one sentence where a scene would be, and unusual but legal ones work."""

import json

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ({"rate_max": -1.0}, "rate_max is -1.0; expected a finite number > 0"),
        ({"dt": -0.1}, "dt is -0.1; expected a finite number > 0"),
        ({"horizon": 0}, "horizon is 0; expected a whole number >= 1"),
        ({"horizon": 2.5}, "horizon is 2.5; expected a whole number"),
        ({"solver": "gurobi"}, 'solver is "gurobi"'),
        ({"tension_min": np.nan}, "tension_min is nan"),
    ],
)
def test_settings_of_mpc(mast, setting, sentence):
    with pytest.raises(tc.TensctlError, match=sentence):
        tc.MPC(mast[2], **setting)


def test_mpc_without_an_input():
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": []}))
    with pytest.raises(tc.SynthesisError, match="no tendon has an actuator"):
        tc.MPC(linear)


@pytest.mark.parametrize(
    ("push", "sentence"),
    [
        (("P4_1_1", (5.0,), 0.0, 1.0), "force is"),
        (("P4_1_1", (np.nan, 0.0, 0.0), 0.0, 1.0), "force"),
        (("P4_1_1", (5.0, 0.0, 0.0), 0.1, 0.0), "expected a time after"),
    ],
)
def test_pushes(push, sentence):
    with pytest.raises(tc.SceneError, match=sentence):
        tc.Push(*push)


@pytest.mark.parametrize(
    ("target", "sentence"),
    [
        ({"hight_scale": 1.1}, "did you mean height_scale"),
        ("1.1", "height_scale is"),
        (True, "height_scale is"),
        ({"height_scale": 1.1, "duration": 0}, "duration is 0"),
    ],
)
def test_targets(target, sentence):
    with pytest.raises(tc.SceneError, match=sentence):
        tc.plan_shape(shell_scene(pins=["P1_*_1"]), target)


def test_a_shell_that_hangs_below_its_base_cannot_be_made_taller():
    scene = shell_scene(pins=["P1_*_1"], gravity={"g": 9.81})
    with pytest.raises(tc.SynthesisError, match="hangs below its base"):
        tc.plan_shape(scene, 1.1)


def test_a_slack_tendon_is_tightened_by_the_plan():
    """At rest t1 is slack under gravity; the planned shape has every tendon above the floor."""
    scene = shell_scene(pins=["P1_*_1"], gravity={"g": 9.81}, tendons={"EA": 1000.0, "rest_ratio": 0.9})
    rest, kept = tc.find_equilibrium(scene), slice(None)
    kept = ~rest.structure.grounded_tendons
    assert rest.tensions[kept].min() == 0
    path = tc.plan_shape(scene, 1.02, tension_min=0.1)
    assert path.target.tensions[kept].min() > 0.1 * (1 - 1e-6)


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        ({"rate_max": -1.0}, "rate_max is -1.0"),
        ({"tol": 0.0}, "tol is 0.0"),
        ({"method": "rk4"}, 'method is "rk4"; one of auto'),
        ({"controller": object()}, r"has no step\(\)"),
    ],
)
def test_settings_of_a_run(mast, setting, sentence):
    dynamics, rest, _ = mast
    with pytest.raises(tc.SimulationError, match=sentence):
        tc.simulate(dynamics, rest, t_end=0.1, **setting)


def test_a_controller_may_keep_records_of_its_own(mast):
    dynamics, rest, _ = mast

    class Logged:
        def __init__(self):
            self.records = []

        def reset(self):
            self.records.clear()

        def step(self, t, measurement):
            self.records.append((t, measurement.lengths.max()))
            return measurement.inputs

    run = tc.simulate(dynamics, rest, controller=Logged(), t_end=0.1)
    assert run.sample_time.size == 0
    assert set(run.status) == {"ok"}


def test_an_equilibrium_of_other_materials_is_refused(mast):
    dynamics, _, _ = mast
    other = tc.find_equilibrium(shell_scene(pins=["P1_*_1"], tendons={"stiffness": 120.0, "rest_ratio": 0.8}))
    with pytest.raises(tc.LinearizationError, match="other materials"):
        tc.linearize(dynamics, other)


@pytest.mark.parametrize(
    ("weights", "sentence"),
    [
        ({"Q": np.triu(np.ones((42, 42)))}, "Q is not symmetric"),
        ({"Q": np.full((42, 42), np.nan)}, "no finite numbers"),
        ({"Q": -np.eye(42)}, "weights are never negative"),
    ],
)
def test_weights(mast, weights, sentence):
    with pytest.raises(tc.SynthesisError, match=sentence):
        tc.lqr(mast[2], **weights)


def test_a_report_answers_its_own_question_only(mast):
    with pytest.raises(AttributeError, match="which modes are controllable, not which are observable"):
        _ = tc.controllability(mast[2]).observable_modes


def test_a_floor_out_of_reach_is_relaxed_at_every_step(mast):
    """20 N in every tendon at once: the floors give way, the solver never falls back, no answer is off its bounds."""
    dynamics, rest, linear = mast
    controller = tc.MPC(linear, horizon=5, tension_min=20.0)
    tc.simulate(dynamics, rest, controller=controller, t_end=0.2, rate_max=0.5)
    exact = [record for record in controller.records if record.status.endswith(" relaxed")]
    assert {record.status for record in controller.records} <= {"primal relaxed", "piqp relaxed", "primal bounded"}
    assert len(exact) >= 6
    assert max(record.kkt for record in exact) < 1e-9
    relaxed = [record.relaxed for record in controller.records]
    assert min(relaxed) > 1
    assert max(relaxed) < 1.5 * max(record.relaxed for record in exact)


@pytest.mark.parametrize("stages", [{"equilibrium": {}}, {"equilibrium": {}, "report": {}}])
def test_a_class_two_shell_runs_its_equilibrium(tmp_path, stages):
    scene = tc.Scene(structure={"kind": "shell", "n": 3, "m": 2, "class": 2}, **stages)
    tc.run(scene, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["equilibrium"]["stable"] == "yes"
    assert (tmp_path / "out" / "report.html").exists() == ("report" in stages)
