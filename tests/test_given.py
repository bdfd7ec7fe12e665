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


MEASURED = {
    "mpc": (lambda x, mast, mpc: tc.solver_precision(x, mast[1], t_end=0.1), r"mpc is of type .*; a tc\.MPC is ex"),
    "start": (lambda x, mast, mpc: tc.solver_precision(mpc, x, t_end=0.1), "start .*expected"),
    "t_end": (lambda x, mast, mpc: tc.solver_precision(mpc, mast[1], t_end=x), "t_end is .*> 0"),
    "pushes": (lambda x, mast, mpc: tc.solver_precision(mpc, mast[1], t_end=0.1, pushes=x), r"pushes .*tc\.Push"),
    "tolerances": (
        lambda x, mast, mpc: tc.solver_precision(mpc, mast[1], t_end=0.1, tolerances=x), "tolerances .*expected"
    ),
    "budget": (lambda x, mast, mpc: tc.solver_precision(mpc, mast[1], t_end=0.1, budget=x), "budget is .*> 0"),
}  # fmt: skip


@pytest.mark.parametrize("wrong", ["a", -1.0, np.nan, [[1], [2, 3]]], ids=repr)
@pytest.mark.parametrize("argument", MEASURED)
def test_solvers_measured_on_what_is_none(mast, argument, wrong):
    call, sentence = MEASURED[argument]
    with pytest.raises(tc.TensctlError, match=sentence):
        call(wrong, mast, tc.MPC(mast[2], horizon=2))


RUNS = {
    "start": "^start .*expected",
    "t_end": "^t_end is .*> 0",
    "timepts": "timepts.*ascending order",
    "dt": "^the control period dt is .*> 0",
    "rate_max": "^rate_max is .*> 0",
    "tol": "^tol is .*> 0 and < 1",
    "pushes": r"^pushes holds .*tc\.Push",
    "schedule": r"^schedule holds .*tc\.Schedule",
}


@pytest.mark.parametrize("wrong", ["a", -1.0, np.nan, [[1], [2, 3]]], ids=repr)
@pytest.mark.parametrize("name", RUNS)
def test_runs_of_what_is_none(mast, name, wrong):
    if name == "timepts" and wrong == -1.0:
        wrong = [1.0, -1.0]
    given = {"start": mast[1], "t_end": 0.1, "controller": tc.MPC(mast[2], horizon=2)} | {name: wrong}
    with pytest.raises(tc.SimulationError, match=RUNS[name]):
        tc.simulate(mast[0], **given)


@pytest.mark.parametrize("wrong", ["a", None, {}], ids=repr)
def test_a_controller_that_gives_no_numbers(mast, wrong):
    class Wrong:
        reset = staticmethod(lambda: None)
        step = staticmethod(lambda t, measurement: wrong)

    with pytest.raises(tc.SimulationError, match=r"controller gave.*\(21,\) is expected"):
        tc.simulate(mast[0], mast[1], controller=Wrong(), t_end=0.1)


@pytest.mark.parametrize("design", [tc.lqr, lambda linear, dt: tc.MPC(linear, horizon=2, dt=dt)], ids=["lqr", "mpc"])
def test_periods_that_rounding_hides(mast, design):
    """Ten times the least period has a design, a tenth of it has none, and the least period is told."""
    least = 1e-12 / mast[2].flexible.scales.min()
    design(mast[2], dt=10 * least)
    with pytest.raises(tc.SynthesisError, match=f"short that rounding hides .*; take dt above {least:.2g} s"):
        design(mast[2], dt=0.1 * least)
