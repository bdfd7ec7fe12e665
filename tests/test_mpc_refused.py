"""What a predictive controller cannot take is refused in one sentence; copies answer as their originals do."""

import copy
import pickle
import re
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from support import shell_scene, solved

import tensctl as tc
from tensctl.synthesis import Reading

DT = 0.02


def sample(rest, **other):
    whole = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
    return replace(whole, **other)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"tension_min": "1"}, 'tension_min is "1"; expected a finite number >= 0 .N; below 0 a tendon would push'),
        ({"tension_min": None}, "tension_min is nothing; expected a finite number >= 0"),
        ({"path": 3}, "path is of type int; the ShapePath"),
        ({"weights": {"energy": 1.0}}, "weights is of type dict; a tc.Weights"),
    ],
)
def test_settings_of_another_kind(mast, given, said):
    with pytest.raises(tc.SynthesisError, match=said):
        tc.MPC(mast[2], horizon=2, **given)


@pytest.mark.parametrize("lag", [0.0, 0.05])
def test_a_mode_that_one_motor_does_not_reach_is_named(lag):
    """Of the mast's undamped modes one tendon drives half of each pair; the sentence is LQR's, up to the advice."""
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": ["t5_1_1"], "lag": lag}))
    with pytest.raises(tc.SynthesisError) as known:
        tc.lqr(linear, dt=DT)
    said = str(known.value).split(";")[0]
    assert said.startswith("mode ")
    with pytest.raises(tc.SynthesisError, match=re.escape(f"{said}; give tendons that reach it, or some damping.")):
        tc.MPC(linear, horizon=2, dt=DT)


def test_a_model_of_another_kind(mast):
    with pytest.raises(tc.SynthesisError, match=r"linear is of type Dynamics; the LinearModel"):
        tc.MPC(mast[0], horizon=2)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"energy": "a"}, 'weights.energy is "a"; expected a finite number >= 0'),
        ({"input": None}, "weights.input is nothing"),
        ({"input": 0.0}, "the weight of input is 0, .* a number > 0 is expected, or rest_lengths"),
        ({"outputs": 3}, "outputs is 3; a table of sizes"),
        ({"outputs": {"nodes": "a"}}, 'weights.outputs.nodes is "a"; expected a finite number > 0'),
        ({"rest_lengths": "a"}, 'weights.rest_lengths is "a"; expected a finite number > 0'),
    ],
)
def test_weights_that_are_none(given, said):
    with pytest.raises(tc.SynthesisError, match=said):
        tc.Weights(**given)


def test_inputs_may_cost_by_their_size_alone(mast):
    assert tc.MPC(mast[2], horizon=2, weights=tc.Weights(input=0.0, rest_lengths=0.1)).problem.riccati_residual < 1e-9


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_measurements_of_another_shape(mast, kind):
    """Refused before anything is remembered of them."""
    dynamics, rest, linear = mast
    controller = tc.MPC(linear, horizon=2) if kind == "linear" else tc.NonlinearMPC(dynamics, rest, horizon=2)
    wrong = [
        ({"nodes": rest.nodes[1:]}, r"nodes of shape \(11, 3\); \(12, 3\) is expected"),
        ({"nodes": rest.nodes.ravel()}, r"nodes of shape \(36,\); \(12, 3\) is expected"),
        ({"nodes": None}, r"no nodes; \(12, 3\) is expected"),
        ({"velocities": np.zeros(3)}, r"velocities of shape \(3,\)"),
        ({"inputs": rest.inputs[1:]}, r"inputs of shape \(20,\); \(21,\) is expected"),
        ({"inputs": None}, "no inputs"),
        ({"tensions": np.zeros(3)}, r"tensions of shape \(3,\); \(24,\) is expected"),
    ]
    for given, said in wrong:
        with pytest.raises(tc.SynthesisError, match=f"the measurement has {said}"):
            controller.step(0.0, sample(rest, **given))
    with pytest.raises(tc.SynthesisError, match="the measurement has no nodes"):
        controller.step(0.0, cast(Any, 3))
    assert not controller.records
    assert not controller.state()


def test_numbers_in_lists_are_taken(mast):
    rest, controller = mast[1], tc.MPC(mast[2], horizon=2)
    shown = {"nodes": rest.nodes + 1e-3, "velocities": 0.1 * rest.nodes}
    answers = [controller.step(0.0, sample(rest, **shown))]
    controller.reset()
    answers.append(controller.step(0.0, sample(rest, **{name: value.tolist() for name, value in shown.items()})))
    assert np.abs(answers[0] - rest.inputs).max() > 1e-3
    assert (answers[0] == answers[1]).all()


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"sensors": None}, "sensors is of type NoneType; what tc.sensors gives"),
        ({"track": 3}, "track is 3; patterns of sensor labels"),
        ({"track": ()}, r"track is \[\]; patterns of sensor labels"),
        ({"drift": "a"}, 'drift is "a"; expected a finite number > 0'),
    ],
)
def test_settings_of_control_from_sensors(mast, given, said):
    with pytest.raises(tc.TensctlError, match=said):
        tc.OutputMPC(mast[2], **{"sensors": tc.sensors(mast[0].structure, lengths=1e-4), "horizon": 2, **given})


@pytest.mark.parametrize("noise", ["a", [1e-3] * 24, {"t5_*": None}])
def test_noise_that_is_no_number(mast, noise):
    with pytest.raises(tc.SynthesisError, match=r"sensors\.lengths.* is .*; expected a finite number > 0"):
        tc.sensors(mast[0].structure, lengths=noise)


@pytest.mark.parametrize("signal", [[0.0, 1.0], {"P4_1_1_x": ([0.0], [0.1])}, (1.0, 2.0, 3.0)])
def test_signals_of_another_kind(mast, signal):
    with pytest.raises(tc.SynthesisError, match=r"signal is of type .*; a function of time, two arrays"):
        tc.MPC(mast[2], horizon=2, weights=tc.Weights(outputs={"nodes:P4_1_1": 1e-3}), signal=signal)


def test_readings_of_another_shape(mast):
    eyes = tc.sensors(mast[0].structure, lengths=1e-4)
    controller = tc.OutputMPC(mast[2], eyes, horizon=2)
    with pytest.raises(tc.SynthesisError, match="24 sensors read, and 21 inputs"):
        controller.step(0.0, Reading(np.zeros(24), np.zeros(20)))


@pytest.mark.parametrize(
    ("memory", "said"),
    [
        (None, "the memory is of type NoneType; a table by name"),
        ({"plan": np.zeros((2, 21)), "command": np.zeros(2)}, r"a command of shape \(2,\); a command of shape \(21,\)"),
    ],
)
def test_memories_of_another_shape(mast, memory, said):
    with pytest.raises(tc.SynthesisError, match=said):
        tc.MPC(mast[2], horizon=2).restore(memory)


@pytest.mark.parametrize("twin_of", [copy.deepcopy, lambda given: pickle.loads(pickle.dumps(given))])
@pytest.mark.parametrize("kind", ["states", "outputs"])
def test_a_copy_goes_on_as_its_original(mast, kind, twin_of):
    """Also after steps that every solver in Python's hands took part in: some of them cannot be copied."""
    dynamics, rest, linear = mast
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2)
    controller = tc.MPC(linear, horizon=3) if kind == "states" else tc.OutputMPC(linear, eyes, horizon=3)
    moving = sample(rest, tensions=rest.tensions + 30.0, velocities=0 * rest.nodes + 30.0)
    shown: Any = eyes.read(moving, 0) if kind == "outputs" else moving
    controller.step(0.0, shown)
    assert kind == "outputs" or controller.records[-1].status == "daqp relaxed"
    twin = twin_of(controller)
    for k in range(1, 4):
        answer = controller.step(DT * k, shown)
        assert np.abs(answer - rest.inputs).max() > 1e-3
        assert (twin.step(DT * k, shown) == answer).all()
