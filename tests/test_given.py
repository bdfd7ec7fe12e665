"""Arguments of calls from Python that are of the wrong kind get one sentence, not a traceback."""

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc

HEIGHT = {"nodes:P4_1_1_z": 1e-3}
TOO_LARGE = [1e101, 10**400]


@pytest.fixture(scope="module")
def path():
    return tc.plan_shape(shell_scene(pins=["P1_*_1"]), 1.02)


@pytest.fixture(scope="module")
def eyes(mast):
    return tc.sensors(mast[0].structure, lengths=1e-3)


KINDS = {
    "lqr": (lambda x, mast, path, eyes: tc.lqr(x), "linear"),
    "lqr cost": (lambda x, mast, path, eyes: tc.lqr(mast[2], cost=x), "cost"),
    "lqg": (lambda x, mast, path, eyes: tc.lqg(x, eyes), "linear"),
    "lqg sensors": (lambda x, mast, path, eyes: tc.lqg(mast[2], x), "sensors"),
    "weights": (lambda x, mast, path, eyes: tc.weights(x, energy=1.0), "linear"),
    "truncate": (lambda x, mast, path, eyes: tc.truncate(x, 4), "linear"),
    "scheduled_lqr": (lambda x, mast, path, eyes: tc.scheduled_lqr(x, mast[0]), "path"),
    "scheduled_lqr dynamics": (lambda x, mast, path, eyes: tc.scheduled_lqr(path, x), "dynamics"),
    "survey": (lambda x, mast, path, eyes: tc.survey(x, mast[0]), "path"),
    "survey dynamics": (lambda x, mast, path, eyes: tc.survey(path, x), "dynamics"),
    "plan_shape": (lambda x, mast, path, eyes: tc.plan_shape(x, 1.1), "scene"),
    "plan_shape start": (lambda x, mast, path, eyes: tc.plan_shape(shell_scene(), 1.1, start=x), "start"),
    "NonlinearMPC": (lambda x, mast, path, eyes: tc.NonlinearMPC(x, mast[1]), "dynamics"),
    "NonlinearMPC path": (lambda x, mast, path, eyes: tc.NonlinearMPC(mast[0], x), "path"),
    "NonlinearMPC weights": (lambda x, mast, path, eyes: tc.NonlinearMPC(*mast[:2], weights=x), "weights"),
    "OutputMPC path": (lambda x, mast, path, eyes: tc.OutputMPC(mast[2], eyes, horizon=2, path=x), "path"),
    "actuator_demand": (lambda x, mast, path, eyes: tc.actuator_demand(x, mast[0]), "motion"),
    "sensors": (lambda x, mast, path, eyes: tc.sensors(x, lengths=1e-3), "structure"),
}


@pytest.mark.parametrize("wrong", ["a", 3, (), {}], ids=repr)
@pytest.mark.parametrize("call", KINDS)
def test_objects_of_another_kind(call, wrong, mast, path, eyes):
    make, name = KINDS[call]
    with pytest.raises(tc.TensctlError, match=rf"^{name} is of type {type(wrong).__name__}; .* is expected\.$"):
        make(wrong, mast, path, eyes)


def test_sensors_of_dynamics(mast):
    with pytest.raises(tc.SynthesisError, match="structure is of type Dynamics; a Structure, such as"):
        tc.sensors(mast[0], lengths=1e-3)


def test_paths_of_another_structure(mast, eyes):
    other = tc.plan_shape(shell_scene(4, 1, pins=["P1_*_1"]), 1.01)
    for make in (
        lambda: tc.MPC(mast[2], path=other),
        lambda: tc.OutputMPC(mast[2], eyes, horizon=2, path=other),
        lambda: tc.NonlinearMPC(mast[0], other),
        lambda: tc.NonlinearMPC(mast[0], other.target),
    ):
        with pytest.raises(
            tc.SynthesisError, match=r"another structure, with 16 nodes and 32 tendons .* has 12 and 24"
        ):
            make()


NUMBERS = {
    "force_noise": lambda x, mast, path, eyes: tc.lqg(mast[2], eyes, dt=0.02, force_noise=x),
    "force_noise of MPC": lambda x, mast, path, eyes: tc.OutputMPC(mast[2], eyes, horizon=2, force_noise=x),
    "drift": lambda x, mast, path, eyes: tc.OutputMPC(mast[2], eyes, horizon=2, drift=x),
    "sensors.seed": lambda x, mast, path, eyes: tc.sensors(mast[0].structure, lengths=1e-3, seed=x),
    "sensors.tensions": lambda x, mast, path, eyes: tc.sensors(mast[0].structure, tensions=x),
    "dt": lambda x, mast, path, eyes: tc.lqr(mast[2], dt=x),
    "dt of LQG": lambda x, mast, path, eyes: tc.lqg(mast[2], eyes, dt=x),
    "every": lambda x, mast, path, eyes: tc.scheduled_lqr(path, mast[0], every=x),
    "energy": lambda x, mast, path, eyes: tc.weights(mast[2], energy=x),
    "nodes": lambda x, mast, path, eyes: tc.weights(mast[2], energy=1.0, nodes={"P4_*": x}),
    "weights.energy": lambda x, mast, path, eyes: tc.Weights(energy=x),
    "weights.outputs.nodes": lambda x, mast, path, eyes: tc.Weights(outputs={"nodes": x}),
    "damping": lambda x, mast, path, eyes: tc.truncate(mast[2], 4, damping=x),
    "horizon": lambda x, mast, path, eyes: tc.truncate(mast[2], 4, horizon=x),
    "order": lambda x, mast, path, eyes: tc.lqg(mast[2], eyes, dt=0.02, order=x),
    "iterations": lambda x, mast, path, eyes: tc.NonlinearMPC(*mast[:2], iterations=x),
    "tension_min": lambda x, mast, path, eyes: tc.MPC(mast[2], tension_min=x),
    "rate_max": lambda x, mast, path, eyes: tc.plan_shape(shell_scene(pins=["P1_*_1"]), 1.02, rate_max=x),
    "u_max": lambda x, mast, path, eyes: tc.plan_shape(shell_scene(pins=["P1_*_1"]), 1.02, u_max=x),
    "preview": lambda x, mast, path, eyes: tc.MPC(mast[2], preview=x),
}


@pytest.mark.parametrize("wrong", ["a", -1.0, np.nan, np.inf, [1.0], 1j, *TOO_LARGE], ids=repr)
@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_that_are_none(name, wrong, mast, path, eyes):
    with pytest.raises(tc.TensctlError, match=rf"^{name.split(' of ')[0]}\S* is .* expected") as said:
        NUMBERS[name](wrong, mast, path, eyes)
    assert len(str(said.value)) < 220


@pytest.mark.parametrize("name", ["Q", "R", "N"])
def test_weights_that_are_no_matrix(mast, name):
    with pytest.raises(tc.SynthesisError, match=f"{name} is of type str; a matrix of numbers is expected"):
        tc.lqr(mast[2], **{name: "a"})


@pytest.mark.parametrize(
    ("signal", "sentence"),
    [
        (lambda t: "up", r'^signal\(0\) is "up"; finite numbers are expected'),
        (lambda t: None, r"^signal\(0\) is"),
        (lambda t: np.zeros(2), r"^signal\(0\) is of shape \(2,\); finite \(1,\) is expected"),
        (lambda: 0.0, "^signal takes no time; a function of one number, s, is expected"),
        ((["a", "b"], [0.0, 1.0]), r'^the times of a signal is \["a", "b"\]; finite numbers are expected'),
        (([0.0, 1.0], ["a", "b"]), r"^the signal's table is"),
    ],
)
def test_signals_that_give_no_numbers(mast, signal, sentence):
    with pytest.raises(tc.SynthesisError, match=sentence):
        tc.MPC(mast[2], horizon=2, weights=tc.Weights(outputs=HEIGHT), signal=signal)


@pytest.mark.parametrize("table", ["a", {"P4_1_1_z": 3.0}, {"P4_1_1_z": ([0.0],)}], ids=repr)
def test_courses_that_are_none(table):
    with pytest.raises(tc.SynthesisError, match="courses are a table of"):
        tc.Courses(table)


def test_settings_that_are_not_given_are_the_usual_ones(mast):
    controller = tc.MPC(mast[2], horizon=None, delay=None)
    assert (controller.horizon, controller.delay) == (20, 0.0)


def test_a_file_that_is_no_place(mast):
    with pytest.raises(tc.OutputError, match=r"path is of type int; a file NAME[.]c or a folder is expected"):
        tc.export_c(tc.lqr(mast[2]), 3)
