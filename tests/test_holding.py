"""Samples that tell nothing: LQR and LQG repeat their last command, as their exported source does."""

from dataclasses import replace

import numpy as np
import pytest
from support import disturbed, shell_scene, solved

import tensctl as tc
from tensctl.synthesis import Reading

FAULTS = (np.nan, np.inf, 1e200)


@pytest.fixture(scope="module")
def eyes(mast):
    return tc.sensors(mast[0].structure, lengths=1e-3)


def spoilt(sample, name, fault):
    """The sample with one entry that is no number."""
    wrong = getattr(sample, name).copy()
    wrong.flat[-1] = fault
    return replace(sample, **{name: wrong})


@pytest.mark.parametrize("dt", [None, 0.02], ids=["continuous", "sampled"])
@pytest.mark.parametrize("kind", ["mast", "free"])
def test_state_feedback_repeats_its_last_command(kind, dt, request):
    _, rest, linear = request.getfixturevalue(kind)
    controller, good = tc.lqr(linear, dt=dt), disturbed(rest, 1.0)
    assert (controller.step(0.0, None) == rest.inputs).all()
    sent = controller.step(0.02, good)
    assert np.abs(sent - rest.inputs).max() > 1e-3, "a command that is that of rest would prove nothing"
    for name in ("nodes", "velocities", *(["inputs"] if dt else [])):
        for fault in FAULTS:
            assert (controller.step(0.04, spoilt(good, name, fault)) == sent).all()
    assert (controller.step(0.06, None) == sent).all()
    again = tc.lqr(linear, dt=dt)
    again.restore(controller.state())
    assert (again.step(0.08, None) == sent).all()
    controller.reset()
    assert (controller.step(0.0, None) == rest.inputs).all()


def test_inputs_that_are_not_fed_back_need_not_be_known(mast):
    good, controller = disturbed(mast[1], 1.0), tc.lqr(mast[2])
    assert (controller.step(0.0, spoilt(good, "inputs", np.nan)) == controller.step(0.0, good)).all()


def test_feedback_along_a_path_begins_with_the_path(mast):
    path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), 1.02)
    controller = tc.scheduled_lqr(path, mast[0])
    assert np.abs(controller.step(1.0, None) - path.inputs_at(1.0)).max() < 1e-15


def test_of_lagging_actuators_the_commands_go_on():
    _, rest, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"lag": 0.05}))
    good = replace(disturbed(rest, 1.0), commands=rest.inputs)
    controller = tc.lqr(linear, dt=0.02)
    sent = controller.step(0.0, good)
    assert (controller.step(0.02, spoilt(good, "commands", np.nan)) == sent).all()


def test_output_feedback_repeats_its_last_command_and_begins_anew(mast, eyes):
    controller, good = tc.lqg(mast[2], eyes, dt=0.02), eyes.read(disturbed(mast[1], 1.0), 0)
    assert (controller.step(0.0, None) == mast[1].inputs).all()
    first = controller.step(0.02, good)
    second = controller.step(0.04, good)
    assert np.abs(second - first).max() > 1e-6, "an estimate that does not move would prove nothing"
    for name in ("values", "inputs"):
        for fault in FAULTS:
            assert (controller.step(0.06, spoilt(good, name, fault)) == second).all()
    assert (controller.step(0.08, None) == second).all()
    assert (controller.step(0.1, good) == first).all()


@pytest.mark.parametrize("fault", FAULTS)
def test_a_run_under_sensors_that_fail_for_a_while(mast, eyes, fault):
    """Commands stay numbers, and the structure comes to rest all the same."""
    controller = tc.lqg(mast[2], eyes, dt=0.02)

    class Failing:
        def step(self, t, measurement):
            reading = eyes.read(measurement, round(t / 0.02))
            return controller.step(t, spoilt(reading, "values", fault) if 0.5 < t < 0.6 else reading)

        def reset(self):
            controller.reset()

    run = tc.simulate(mast[0], disturbed(mast[1], 1.0).nodes, controller=Failing(), dt=0.02, t_end=2.0)
    assert np.isfinite(run.inputs).all()


@pytest.mark.parametrize("size", [39, 41, 200])
def test_velocities_beyond_all_measure_tell_a_predictive_controller_nothing(mast, size):
    """Without a warning from numpy, and with one answer for each."""
    controller, good = tc.MPC(mast[2], horizon=3), disturbed(mast[1], 0.1)
    with np.errstate(all="raise"):
        command = controller.step(0.0, replace(good, velocities=np.full_like(good.velocities, 10.0**size)))
    assert np.isfinite(command).all()
    assert (controller.records[-1].status == "no measurement") == (size > 40)


def test_arrays_of_another_shape_are_refused(mast, eyes):
    good = disturbed(mast[1], 1.0)
    with pytest.raises(tc.SynthesisError, match=r"the measurement has nodes of shape \(2, 3\); \(12, 3\) is expected"):
        tc.lqr(mast[2]).step(0.0, replace(good, nodes=np.zeros((2, 3))))
    with pytest.raises(tc.SynthesisError, match="LQG is shown what its 24 sensors read, and 21 inputs"):
        tc.lqg(mast[2], eyes, dt=0.02).step(0.0, Reading(np.zeros(3), np.zeros(21)))
