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


# Every argument of these calls that is of no use, and the words that say so; `run` is one without a controller.
ASIDE = {
    "store": (lambda x, mast, run: tc.simulate(*mast[:2], t_end=0.1, store=x), "^store is of type .*a file .*expected"),
    "chunk": (lambda x, mast, run: tc.simulate(*mast[:2], t_end=0.1, chunk=x), "^chunk is .*a whole number >= 1"),
    "progress": (lambda x, mast, run: tc.simulate(*mast[:2], t_end=0.1, progress=x), r"^progress .*advance\(n\)"),
    "dt alone": (lambda x, mast, run: tc.simulate(*mast[:2], t_end=0.1, dt=x), "^the control period dt is .*> 0"),
    "method": (lambda x, mast, run: tc.simulate(*mast[:2], t_end=0.1, method=x), "^method is .*; one of auto"),
    "resume": (lambda x, mast, run: tc.resume(mast[0], x), "^store is of type .*what simulate was given as store"),
    "resume dynamics": (lambda x, mast, run: tc.resume(x, "run.nc"), "^dynamics is of type"),
    "save": (lambda x, mast, run: run.save(x), "^path is of type .*expected"),
    "load": (lambda x, mast, run: tc.Run.load(x), "^path is of type .*expected"),
    "inspect_run": (lambda x, mast, run: tc.inspect_run(x, run), "^dynamics is of type"),
    "inspect_run run": (lambda x, mast, run: tc.inspect_run(mast[0], x), "^run is of type"),
    "inspect_run pushes": (lambda x, mast, run: tc.inspect_run(mast[0], run, pushes=[x]), r"^pushes holds .*tc\.Push"),
    "inertia": (lambda x, mast, run: tc.actuator_demand(run, mast[0], inertia=x), "^inertia is .*true or false"),
    "simulate_many": (
        lambda x, mast, run: tc.simulate_many(x, tc.Variations(), timepts=[0.0, 0.1]), "^dynamics is of type"
    ),
    "variations": (lambda x, mast, run: tc.simulate_many(mast[0], x, timepts=[0.0, 0.1]), "^variations is of type"),
    "variations mass": (
        lambda x, mast, run: tc.simulate_many(mast[0], tc.Variations(mass=x), timepts=[0.0, 0.1]), "^mass of the varia"
    ),
    "workers": (
        lambda x, mast, run: tc.simulate_many(mast[0], tc.Variations(), timepts=[0.0, 0.1], workers=x), "^workers is"
    ),
    "recovery": (lambda x, mast, run: recovered(mast, dynamics=x), "^dynamics is of type"),
    "recovery equilibrium": (lambda x, mast, run: recovered(mast, equilibrium=x), "^equilibrium is of type"),
    "disturbances": (lambda x, mast, run: recovered(mast, disturbances=x), r"^disturbances holds .*tc\.Kick"),
    "cap": (lambda x, mast, run: recovered(mast, cap=x), "^cap is .*a finite number > 0"),
    "hold": (lambda x, mast, run: recovered(mast, hold=x), "^hold is .*a finite number >= 0"),
    "collide": (lambda x, mast, run: recovered(mast, collide=x), "^collide is .*true or false"),
    "below": (lambda x, mast, run: recovered(mast, below=x), "^below is .*a whole number >= 0"),
    "times of a history": (lambda x, mast, run: tc.History("P4_1_1", x, [[1.0, 0.0, 0.0]]), "^the times|^times"),
    "forces of a history": (lambda x, mast, run: tc.History("P4_1_1", [0.0], x), "^the forces|^forces"),
    "node of a history": (lambda x, mast, run: tc.History(x, [0.0], [[1.0, 0.0, 0.0]]), "^node is .*a label or patt"),
    "times of a schedule": (lambda x, mast, run: tc.Schedule("t5_1_1", x, [0.0]), "^the times|^times"),
    "change of a schedule": (lambda x, mast, run: tc.Schedule("t5_1_1", [0.0], x), "^the schedule|^change"),
    "tendon of a schedule": (lambda x, mast, run: tc.Schedule(x, [0.0], [0.0]), "^tendon is .*a label or pattern"),
    "kick": (lambda x, mast, run: tc.Kick("k", x), "velocities of kick .*expected"),
    "label of a kick": (lambda x, mast, run: tc.Kick(x, np.ones((12, 3))), "^label is"),
    "stop of a wave": (lambda x, mast, run: tc.Wave("P4_1_1", (1.0, 0.0, 0.0), 1.0, stop=x), "^stop is"),
}  # fmt: skip


def recovered(mast, **given):
    kick = tc.Kick("all", np.ones((12, 3)))
    usual = {"dynamics": mast[0], "equilibrium": mast[1], "disturbances": [kick], "cap": 1.0, "t_end": 0.1}
    return tc.recovery(**usual | given)


@pytest.fixture(scope="module")
def run(mast):
    return tc.simulate(*mast[:2], timepts=[0.0, 1e-3])


ODD = ["object", "negative", "nan", "ragged", "words"]


@pytest.mark.parametrize("wrong", [object(), -1.5, np.nan, [[1], [2, 3]], np.array(["q", "r"])], ids=ODD)
@pytest.mark.parametrize("name", ASIDE)
def test_what_runs_are_given_besides(mast, run, name, wrong):
    call, sentence = ASIDE[name]
    with pytest.raises(tc.TensctlError, match=sentence):
        call(wrong, mast, run)


SCENES = {
    "build_dynamics": (tc.build_dynamics, "scene"),
    "find_equilibrium": (tc.find_equilibrium, "scene"),
    "find_equilibrium start": (lambda x: tc.find_equilibrium(shell_scene(), start=x), "start"),
    "find_equilibrium inputs": (lambda x: tc.find_equilibrium(shell_scene(), inputs=x), "inputs"),
    "work_precision": (tc.work_precision, "scene"),
    "budget": (lambda x: tc.work_precision(shell_scene(), budget=x), "budget"),
    "run": (lambda x: tc.run(x, "out"), "scene"),
    "out": (lambda x: tc.run(shell_scene(), x), "out"),
    "load_scene": (tc.load_scene, "path"),
    "harmonic_lqr": (tc.harmonic_lqr, "linear"),
    "harmonic_lqg": (lambda x: tc.harmonic_lqg(x, None), "linear"),
    "harmonic_kalman": (lambda x: tc.harmonic_kalman(x, None), "linear"),
    "harmonic_truncate": (lambda x: tc.harmonic_truncate(x, 4), "outputs"),
    "harmonic_weights": (lambda x: tc.harmonic_weights(x, energy=1.0), "linear"),
}


@pytest.mark.parametrize("wrong", [object(), [[1], [2, 3]], {}, 1j], ids=["object", "ragged", "dict", "complex"])
@pytest.mark.parametrize("name", SCENES)
def test_calls_with_what_is_no_scene_or_model(name, wrong):
    call, argument = SCENES[name]
    with pytest.raises(tc.TensctlError, match=rf"^{argument} is .*expected"):
        call(wrong)


@pytest.mark.parametrize("place", ["", "."])
def test_a_run_stored_as_a_folder(mast, tmp_path, monkeypatch, place):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(tc.OutputError, match="it is a folder; give a file in it"):
        tc.simulate(*mast[:2], t_end=0.1, store=place)


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


STEPPED = {
    "lqr": lambda mast, path, eyes: tc.lqr(mast[2]),
    "scheduled_lqr": lambda mast, path, eyes: tc.scheduled_lqr(path, mast[0], every=100),
    "lqg": lambda mast, path, eyes: tc.lqg(mast[2], eyes, dt=0.02),
    "MPC": lambda mast, path, eyes: tc.MPC(mast[2], horizon=2),
    "OutputMPC": lambda mast, path, eyes: tc.OutputMPC(mast[2], eyes, horizon=2),
    "NonlinearMPC": lambda mast, path, eyes: tc.NonlinearMPC(*mast[:2], horizon=2),
}


@pytest.mark.parametrize("name", STEPPED)
def test_steps_at_no_time(mast, path, eyes, name):
    """Refused before anything is remembered; a whole number and NumPy's are times."""
    controller = STEPPED[name](mast, path, eyes)
    for wrong in ("a", None, np.nan, np.inf, -np.inf, [0.0], 1j, True, *TOO_LARGE):
        with pytest.raises(tc.SynthesisError, match=r"^t is .*; expected a finite number \(s, the time of"):
            controller.step(wrong, None)
    assert controller.state() == {}
    for t in (0, np.float32(0.0), np.int64(0), np.array(0.0)):
        assert np.abs(controller.step(t, None) - mast[1].inputs).max() < 1e-9
