"""Controllers in C that follow a path of shapes: the reference moves, and the model with it, as in Python."""

import numpy as np
import pytest
from compiled import Compiled
from support import shell_scene
from test_export_c import Both

import tensctl as tc
from tensctl.errors import OutputError
from tensctl.pipeline import design
from tensctl.synthesis import ScheduledLQR
from tensctl.synthesis.reference import Hold

DT = 0.02
# The solver whose KKT residual is the least.
LIMITS = {"horizon": 3, "dt": DT, "tension_min": 0.5, "rate_max": 2.0, "solver": "daqp"}
TALLER = {"height_scale": 1.05, "duration": 0.5, "start": 0.1}


@pytest.fixture(scope="module")
def way(mast):
    """The mast grows by a twentieth in half a second."""
    return tc.plan_shape(shell_scene(pins=["P1_*_1"]), TALLER, start=mast[1])


def played(case, controller, folder, t_end=1.0):
    """A closed loop of both from rest at the path's start, and the C source."""
    dynamics, rest, _ = case
    made = tc.export_c(controller, folder)
    both = Both(controller, Compiled(folder / "controller.c", rest.inputs.size))
    run = tc.simulate(dynamics, rest, controller=both, t_end=t_end, rate_max=LIMITS["rate_max"])
    return both, run, {table.name: table.values for table in made.tables}


def test_predictive_control(mast, way, tmp_path):
    """101 steps with a delay, along all five models and beyond the end, where the shape stays; a reset begins anew."""
    controller = tc.MPC(mast[2], path=way, delay=0.01, **LIMITS)
    both, run, tables = played(mast, controller, tmp_path, t_end=2.0)
    assert len(both.differences) == 101
    assert max(both.differences) < 1e-9
    assert set(tables["course_model"].tolist()) == set(range(5))
    assert run.distance_to(way.target_nodes)[-1] < 0.1 * run.distance_to(way.target_nodes)[0]
    first, last = both.steps[0][1], both.c.step(both.measurements[0])[1]
    assert np.abs(first - last).max() > 1e-4
    both.c.reset()
    assert (both.c.step(both.measurements[0])[1] == first).all()


def test_a_free_structure(free, tmp_path):
    """Each model has its own frame."""
    path = tc.plan_shape(shell_scene(), TALLER, start=free[1])
    both, _, _ = played(free, tc.MPC(free[2], path=path, **LIMITS), tmp_path, t_end=0.7)
    assert max(both.differences) < 1e-9


def test_from_sensors(mast, way, tmp_path):
    """One model; what is wanted of the sensors moves, and outputs follow a signal beside it."""
    dynamics, rest, linear = mast
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    tip = tc.Weights(outputs={"nodes:P4_1_1": 1e-2})
    signal = np.array([0.0, 1.0]), way.target_nodes[rest.structure.node_labels.index("P4_1_1")] * np.ones((2, 1))
    controller = tc.OutputMPC(linear, eyes, path=way, weights=tip, signal=signal, **LIMITS)
    both, _, _ = played(mast, controller, tmp_path)
    assert max(both.differences) < 1e-8


def test_a_signal_in_total_beside_a_path(mast, way, tmp_path):
    rest = mast[1]
    tip = tc.Weights(outputs={"nodes:P4_1_1": 1e-2})
    signal = np.array([0.0, 1.0]), way.target_nodes[rest.structure.node_labels.index("P4_1_1")] * np.ones((2, 1))
    both, _, _ = played(mast, tc.MPC(mast[2], path=way, weights=tip, signal=signal, **LIMITS), tmp_path)
    assert max(both.differences) < 1e-9


def test_scheduled_feedback(mast, way, tmp_path):
    """The gain of the nearest planned shape; 151 steps."""
    controller = tc.scheduled_lqr(way, mast[0], lambda linear: tc.lqr(linear, dt=DT))
    both, run, tables = played(mast, controller, tmp_path, t_end=3.0)
    assert len(both.differences) == 151
    assert max(both.differences) < 1e-11
    assert set(tables["course_model"].tolist()) == set(range(len(controller.designs)))
    assert run.distance_to(way.target_nodes)[-1] < 1e-3


def test_the_scene_s_lqr_is_the_one_that_its_run_has():
    found = design(shell_scene(pins=["P1_*_1"], target=TALLER, lqr={"dt": DT}))
    assert isinstance(found, ScheduledLQR)


class Endless(Hold):
    """One that may go on for ever."""

    ends = np.inf


def test_a_reference_without_end_is_refused(mast, tmp_path):
    controller = tc.MPC(mast[2], path=Endless(mast[1]), **LIMITS)
    with pytest.raises(OutputError, match="Endless that does not say when it comes to rest"):
        tc.export_c(controller, tmp_path)


def test_designs_of_two_kinds_are_refused(mast, way, tmp_path):
    kinds = iter([{}, {"dt": DT}, {}, {"dt": DT}, {}])
    controller = tc.scheduled_lqr(way, mast[0], lambda linear: tc.lqr(linear, **next(kinds)))
    with pytest.raises(OutputError, match="sampled in part"):
        tc.export_c(controller, tmp_path)


def test_other_tension_rows_on_the_way_are_refused(tmp_path, mast, way, monkeypatch):
    """A tendon that is slack in some shapes has no floor there."""
    controller = tc.MPC(mast[2], path=way, **LIMITS)
    problem = controller.piece_at(0.0).problem
    monkeypatch.setitem(vars(problem), "tendons", problem.tendons[::-1])
    with pytest.raises(OutputError, match="slack in some planned shapes"):
        tc.export_c(controller, tmp_path)


def test_a_controller_on_the_nonlinear_structure_has_no_form(mast, tmp_path):
    with pytest.raises(OutputError, match="NonlinearMPC has no form in C: it rolls"):
        tc.export_c(tc.NonlinearMPC(mast[0], mast[1], horizon=2), tmp_path)
