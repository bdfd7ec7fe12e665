"""Predictive control from sensors in C: filter, target and plan are those of Python, faults of sensors included."""

import numpy as np
import pytest
from compiled import Compiled
from support import network_scene, random_motion, shell_scene, solved
from test_export_c import BOUNDED, OK, RELAXED, Both

import tensctl as tc
from tensctl.synthesis.sensors import Reading

# Largest difference of commands, m; 1.4e-11 was seen with all faults. The weight that holds on to the last target, 3e-4
# of the easiest direction's, leaves rounding over that in the inputs of the weakest.
SAME = 1e-9
RATE = 2.0


class Faulty(Both):
    """Sensors that fail on the way: one in five is silent, then all are; then one says the same absurd thing."""

    def step(self, t, measurement):
        values, inputs, k = measurement.values.copy(), measurement.inputs, len(self.steps)
        if 20 <= k < 30:
            values[::5] = np.nan
        if 40 <= k < 42:
            values[:], inputs = np.nan, np.full(inputs.size, np.nan)
        if 60 <= k < 68:
            values[3] += 5.0
        return super().step(t, Reading(values, inputs))


def made(mast, folder, **given):
    """The controller from noisy lengths and tensions, and its C source."""
    eyes = tc.sensors(mast[0].structure, lengths=1e-4, tensions=1e-2, seed=3)
    python = tc.OutputMPC(mast[2], eyes, **{"horizon": 5, "tension_min": 1.0, "rate_max": RATE} | given)
    tc.export_c(python, folder)
    return python, Compiled(folder / "controller.c", 21)


@pytest.fixture(scope="module")
def soft():
    """The mast with tendons 5 % softer than its model's, base pinned."""
    return tc.build_dynamics(shell_scene(pins=["P1_*_1"], tendons={"stiffness": 95.0}))


def test_commands_are_those_of_python(mast, soft, tmp_path):
    """101 steps of a structure that the model is wrong about, with a delay and every fault of sensors."""
    both = Faulty(*made(mast, tmp_path, delay=0.01))
    start = random_motion(mast[1].potential, np.random.default_rng(1), 0.003, 0.05)
    tc.simulate(soft, start, controller=both, t_end=2.0, rate_max=RATE)
    assert len(both.differences) == 101
    assert max(both.differences) < SAME
    assert set(both.outcomes) == {OK, RELAXED}
    estimate = both.python.estimate
    assert estimate.missing == 10 * 10 + 2 * 48
    assert estimate.rejected >= 5


def test_bounded_searches_begin_at_the_last_plan(mast, tmp_path, monkeypatch):
    """With a tenth of the work for searches, both end at the same commands, though C keeps its plan by itself."""
    from tensctl.synthesis import qp_primal

    monkeypatch.setattr(qp_primal, "_WORK", 2e6)
    both = Both(*made(mast, tmp_path))
    start = random_motion(mast[1].potential, np.random.default_rng(2), 0.015, 0.35)
    tc.simulate(mast[0], start, controller=both, t_end=1.0, rate_max=RATE)
    bounded = np.array(both.outcomes) == BOUNDED
    said = np.array([status.endswith("bounded") for status in both.statuses])
    assert 5 < said.sum() < 45
    assert (bounded != said).sum() <= 1  # C bounds its dual search too
    assert np.array(both.differences)[bounded == said].max() < SAME


def test_the_filter_comes_back_to_its_constant_gain(tmp_path):
    """A silent sample, then as many as it takes: commands agree while P varies, and when it does no longer."""
    scene = network_scene(
        {"o": [0, 0, 0], "head": [1.0, 0.2, 0.1], "a": [-1.0, 0, 0], "b": [2, 1, 0], "c": [2, -1, 1]},
        {"rod": ["o", "head"]}, {"t1": ["head", "a"], "t2": ["head", "b"], "t3": ["head", "c"]}, ["o", "a", "b", "c"],
        tendons={"stiffness": 100.0, "rest_ratio": 0.7},
    )  # fmt: skip
    dynamics, rest, linear = solved(scene)
    eyes = tc.sensors(dynamics.structure, lengths=1e-3, seed=3)
    python = tc.OutputMPC(linear, eyes, horizon=3)
    tc.export_c(python, tmp_path)
    both = Both(python, Compiled(tmp_path / "controller.c", 3))
    inputs, varies = rest.inputs, []
    for k in range(120):
        values = np.full(3, np.nan) if k == 3 else eyes.read(rest, k).values
        inputs = both.step(0.02 * k, Reading(values, inputs))
        varies.append(python.estimate.covariance is not None)
    assert max(both.differences) < SAME
    assert varies[2:4] == [False, True]
    assert varies[-1] is False
    assert 50 < sum(varies) < 110


def test_a_target_whose_floors_give_way(mast, tmp_path):
    """Tensions of 6 N at rest are out of reach of 5 mm: the target comes as near as they let it."""
    both = Both(*made(mast, tmp_path, tension_min=6.0, u_max=5e-3, horizon=3))
    nodes = mast[1].nodes
    tc.simulate(mast[0], (nodes, 0 * nodes), controller=both, t_end=0.2, rate_max=RATE)
    assert both.python.target.relaxed > 1e-3
    assert max(both.differences) < SAME


def test_sensors_of_nodes_that_are_to_be_reached(mast, tmp_path):
    """Only what is tracked is aimed at."""
    eyes = tc.sensors(mast[0].structure, lengths=1e-4, nodes={"P4_*": 1e-3}, seed=1)
    python = tc.OutputMPC(mast[2], eyes, horizon=3, track="P4_1_1_z", tension_min=0.5)
    tc.export_c(python, tmp_path)
    both = Both(python, Compiled(tmp_path / "controller.c", 21))
    nodes = mast[1].nodes
    tc.simulate(mast[0], (nodes, 0 * nodes), controller=both, t_end=0.2)
    assert max(both.differences) < SAME
