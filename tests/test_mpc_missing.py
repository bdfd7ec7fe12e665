"""Samples that tell nothing: a predictive controller goes on with its plan, and rest lengths keep their floors."""

from dataclasses import replace

import numpy as np
import pytest

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.simulation.actuators import Actuators
from tensctl.synthesis import Reading

HORIZON = 5


@pytest.fixture
def controller(mast):
    return tc.MPC(mast[2], horizon=HORIZON)


def sample(mast, rng):
    """A moving structure as it is measured."""
    rest = mast[1]
    manifold = rest.potential.manifold
    nodes = manifold.retract(rest.nodes, 0.002 * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (0.05 * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs)


def spoilt(measurement, how):
    """The sample with one fault."""
    nodes, velocities = measurement.nodes.copy(), measurement.velocities.copy()
    if how == "a node":
        nodes[7, 1] = np.nan
    elif how == "a velocity":
        velocities[7, 1] = np.inf
    elif how == "all zero":
        nodes[:] = 0.0
    elif how == "in millimetres":
        nodes *= 1e3
    return None if how == "no sample" else replace(measurement, nodes=nodes, velocities=velocities)


@pytest.mark.parametrize("how", ["no sample", "a node", "a velocity", "all zero", "in millimetres"])
class TestNothingMeasured:
    def test_the_plan_goes_on_and_its_end_is_held(self, mast, controller, rng, how):
        good = sample(mast, rng)
        plan = controller.solve(0.0, good) + mast[1].inputs
        sent = [controller.step(0.0, good)]
        for k in range(1, HORIZON + 2):
            sent.append(controller.step(k * controller.dt, spoilt(replace(good, inputs=sent[-1]), how)))
        wanted = np.vstack([plan, plan[-1:], plan[-1:]])
        assert np.abs(np.diff(plan, axis=0)).max() > 1e-4, "a plan that stands still would prove little"
        assert np.abs(np.array(sent) - wanted).max() < 1e-12
        assert [r.status for r in controller.records[1:]] == ["no measurement"] * (HORIZON + 1)
        assert all(np.isnan(r.kkt) and r.relaxed == 0 for r in controller.records[1:])

    def test_before_the_first_plan_rest_lengths_stay(self, mast, controller, rng, how):
        good = replace(sample(mast, rng), inputs=0.01 * rng.standard_normal(21))
        stays = mast[1].inputs if how == "no sample" else good.inputs
        assert (controller.step(0.0, spoilt(good, how)) == stays).all()


def test_a_free_shell_without_a_measurement(free, rng):
    """Its own frame cannot be found in numbers that are missing."""
    rest = free[1]
    controller = tc.MPC(free[2], horizon=3)
    blank = Measurement(np.nan * rest.nodes, np.nan * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
    assert (controller.step(0.0, blank) == rest.inputs).all()


def test_inputs_not_measured_are_those_of_the_last_command(mast, rng):
    good = sample(mast, rng)
    first, second = (tc.MPC(mast[2], horizon=HORIZON) for _ in range(2))
    sent = first.step(0.0, good)
    second.step(0.0, good)
    told, untold = replace(good, inputs=sent), replace(good, inputs=np.full(21, np.nan))
    assert (first.step(first.dt, told) == second.step(first.dt, untold)).all()
    third = tc.MPC(mast[2], horizon=HORIZON)
    third.step(0.0, good)
    restored = tc.MPC(mast[2], horizon=HORIZON)
    restored.restore(third.state())
    assert (restored.step(first.dt, untold) == third.step(first.dt, untold)).all()


def test_sensors_that_never_answer_are_all_missing(mast):
    eyes = tc.sensors(mast[0].structure, lengths=1e-3, tensions=0.1)
    first, second = (tc.OutputMPC(mast[2], eyes, horizon=3) for _ in range(2))
    for controller in (first, second):
        controller.step(0.0, eyes.read(mast[1], 0))
    silent = Reading(np.full(48, np.nan), np.full(21, np.nan))
    assert (first.step(0.02, None) == second.step(0.02, silent)).all()
    assert first.estimate.missing == 48
    assert first.records[-1].status == "dual"


class TestFloors:
    def test_a_ramp_that_ends_late_by_rounding_stops_at_the_floor(self, mast, rng):
        """Sample times at 2000 s are good to 2e-13 s; lengths that ramp down for so much too long keep their floors."""
        members = mast[0].members
        late = np.diff(0.02 * np.arange(99_990, 100_000)).max()
        assert 1e-14 < late - 0.02 < 1e-12
        for _ in range(50):
            start = members.floors + 0.02 * rng.random(24)
            actuators = Actuators(members, start, 1.0)
            actuators.command(np.full(21, 10.0), 0.02)
            assert (start + late * actuators.rate < members.floors).any()
            assert (actuators.after(np.array([0.0, late])) >= members.floors).all()
            actuators.advance(np.array([late]))
            assert (actuators.rest >= members.floors).all()
            assert (actuators.asked >= members.floors).all()
            assert (actuators.rest[members.inputs] < members.floors[members.inputs] * (1 + 1e-9)).any()

    def test_lengths_that_begin_below_their_floor_are_let_out_at_the_rate_limit(self, mast):
        members = mast[0].members
        start = members.floors - 1e-4
        actuators = Actuators(members, start, 1e-3)
        actuators.command(mast[1].inputs, 0.02)
        actuators.advance(np.array([0.02]))
        assert np.abs(actuators.rest - start)[members.inputs] == pytest.approx(2e-5, rel=1e-6)


@pytest.mark.parametrize("kind", ["linear", "nonlinear"])
def test_a_memory_of_another_controller_is_refused(mast, kind):
    """That of an LQG, and that of another horizon; the controller then remembers what it did before."""
    make = {
        "linear": lambda n: tc.MPC(mast[2], horizon=n),
        "nonlinear": lambda n: tc.NonlinearMPC(*mast[:2], horizon=n),
    }
    controller, other = make[kind](HORIZON), make[kind](HORIZON + 1)
    other.step(0.0, None)
    controller.step(0.0, None)
    before = controller.state()["plan"]
    with pytest.raises(tc.SynthesisError, match=r"the memory holds estimate, inputs; a plan of shape"):
        controller.restore({"estimate": np.zeros(42), "inputs": np.zeros(21)})
    with pytest.raises(tc.SynthesisError, match="so restore what state"):
        controller.restore(other.state())
    assert controller.state()["plan"] is before
