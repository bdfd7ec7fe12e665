"""Controllers in C for actuators with lag: rest lengths are states and commands inputs, as in Python."""

from dataclasses import replace

import numpy as np
import pytest
from compiled import Compiled
from support import shell_scene
from test_export_c import Both

import tensctl as tc

DT, LAG = 0.02, 0.15
TALLER = {"height_scale": 1.05, "duration": 0.5, "start": 0.1}
LIMITS = {"horizon": 4, "dt": DT, "tension_min": 0.5, "rate_max": 2.0}
PUSH = tc.Push("P4_1_1", (2.0, 0.0, 0.0), 0.2, 0.3)


class Told(Both):
    """Both are shown what C needs; `blind` at two of three samples not the rest lengths."""

    shows, blind = ("inputs", "commands"), False

    def as_array(self, measurement):
        state = ("nodes", "velocities") if self.sensors is None else ("values",)
        return np.concatenate([getattr(measurement, name).ravel() for name in state + self.shows])

    def step(self, t, measurement):
        if self.blind and round(t / DT) % 3:
            measurement = replace(measurement, inputs=np.full_like(measurement.inputs, np.nan))
        return super().step(t, measurement)


@pytest.fixture(scope="module")
def lagging():
    scene = shell_scene(pins=["P1_*_1"], actuators={"lag": LAG})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    return dynamics, rest, tc.linearize(dynamics, rest), tc.plan_shape(scene, TALLER, start=rest)


def played(case, controller, folder, *, shows=("inputs", "commands"), blind=False):
    """A closed loop of both under a push."""
    dynamics, rest, *_ = case
    made = tc.export_c(controller, folder)
    both = Told(controller, Compiled(folder / "controller.c", rest.inputs.size))
    both.shows, both.blind = shows, blind
    tc.simulate(dynamics, rest, controller=both, t_end=1.0, rate_max=2.0, pushes=[PUSH])
    assert f"TENSCTL_MEASUREMENT {both.measurements[0].size}\n" in made.header
    assert np.ptp([u for _, u, _ in both.steps], axis=0).max() > 1e-3
    return both


@pytest.mark.parametrize(("dt", "shows"), [(None, ("inputs",)), (DT, ("inputs", "commands"))])
def test_state_feedback(lagging, tmp_path, dt, shows):
    """The continuous gain does not read commands."""
    assert max(played(lagging, tc.lqr(lagging[2], dt=dt), tmp_path, shows=shows).differences) < 1e-11


def test_scheduled_feedback(lagging, tmp_path):
    dynamics, _, _, path = lagging
    controller = tc.scheduled_lqr(path, dynamics, lambda linear: tc.lqr(linear, dt=DT))
    assert max(played(lagging, controller, tmp_path).differences) < 1e-11


def test_output_feedback_needs_commands_only(lagging, tmp_path):
    eyes = tc.sensors(lagging[0].structure, lengths=1e-4, tensions=1e-2, seed=3)
    both = played(lagging, tc.lqg(lagging[2], eyes, dt=DT), tmp_path, shows=("commands",))
    assert max(both.differences) < 1e-10


@pytest.mark.parametrize("delay", [0.0, 0.007])
@pytest.mark.parametrize("blind", [False, True])
def test_predictive_control_along_a_path(lagging, tmp_path, delay, blind):
    """Also while rest lengths are measured at one sample in three: both carry them along."""
    controller = tc.MPC(lagging[2], path=lagging[3], delay=delay, **LIMITS)
    assert max(played(lagging, controller, tmp_path, blind=blind).differences) < 1e-9


@pytest.mark.parametrize("delay", [0.0, 0.007])
def test_predictive_control_from_sensors_along_a_path(lagging, tmp_path, delay):
    eyes = tc.sensors(lagging[0].structure, lengths=1e-4, tensions=1e-2, seed=3)
    controller = tc.OutputMPC(lagging[2], eyes, path=lagging[3], delay=delay, **LIMITS)
    assert max(played(lagging, controller, tmp_path).differences) < 1e-8
