"""Compilers have no complaint about exported controllers, and sanitizers find nothing while they run.

Every controller that a test compiles is compiled with the same warnings as errors; here the templates' branches come
together in few sources, each shown to a second compiler and played under the sanitizers to the same commands.
`benchmarks/export_c_strict.py` does it with all kinds and longer horizons.
"""

import numpy as np
import pytest
from compiled import Compiled, played, sanitized, zig_compiles
from support import random_motion, shell_scene, solved
from test_export_c import REFUSED, RELAXED
from test_export_lag import DT, TALLER, Told

import tensctl as tc

LIMITS = {"horizon": 2, "dt": DT, "tension_min": 3.0, "rate_max": 2.0}
TIP = tc.Weights(outputs={"nodes:P4_1_1": 1e-2})
COURSES = tc.Courses({"P4_1_1_x": ([0.1, 0.3], [0.0, 0.02])})


@pytest.fixture(scope="module")
def lagging():
    scene = shell_scene(pins=["P1_*_1"], actuators={"lag": 0.15})
    dynamics, rest, linear = solved(scene)
    return dynamics, rest, linear, tc.plan_shape(scene, TALLER, start=rest)


def state_feedback(dynamics, linear, path):
    return tc.scheduled_lqr(path, dynamics, lambda linear: tc.lqr(linear, dt=DT)), ("inputs", "commands"), None


def output_feedback(dynamics, linear, path):
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    return tc.lqg(linear, eyes, dt=DT, order=40), ("commands",), None


def plans(dynamics, linear, path):
    """What is wanted is shown for the whole horizon."""

    def signal(t):
        return 0.01 * np.sin(3 * t + np.arange(3))

    def asked(t):
        return np.concatenate([signal(t + 0.007 + DT * k) for k in (1, 2)])

    wanted = {"path": path, "delay": 0.007, "signal": signal, "weights": TIP}
    return tc.MPC(linear, **wanted, **LIMITS), ("inputs", "commands"), asked


def plans_from_sensors(dynamics, linear, path):
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    wanted = {"path": path, "delay": 0.007, "signal": COURSES, "weights": TIP}
    return tc.OutputMPC(linear, eyes, **wanted, **LIMITS), ("inputs", "commands"), None


@pytest.mark.parametrize("kind", [state_feedback, output_feedback, plans, plans_from_sensors])
def test_nothing_to_complain_about(lagging, tmp_path, kind):
    """A motion that floors give way to, samples that tell nothing on the way."""
    dynamics, rest, linear, path = lagging
    controller, shows, asked = kind(dynamics, linear, path)
    tc.export_c(controller, tmp_path)
    zig_compiles(tmp_path / "controller.c")
    both = Told(controller, Compiled(tmp_path / "controller.c", rest.inputs.size, "-O2"), asked)
    both.shows = shows
    start = random_motion(rest.potential, np.random.default_rng(1), 0.01, 0.3)
    tc.simulate(dynamics, start, controller=both, t_end=0.5, rate_max=2.0)
    shown = np.array(both.measurements)
    shown[[3, 11, 12], [0, 2, -1]] = np.nan
    both.c.reset()
    wanted = [both.c.step(one) for one in shown]
    outcomes, commands = played(sanitized(tmp_path), shown)
    assert outcomes.tolist() == [outcome for outcome, _ in wanted]
    assert np.abs(commands - np.array([u for _, u in wanted])).max() < 1e-10
    assert set(outcomes.tolist()) >= ({REFUSED} if kind in (state_feedback, output_feedback) else {RELAXED})
    assert max(both.differences) < 1e-8
