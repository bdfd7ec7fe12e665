"""Predictive control in C that follows something: signals of outputs, as tables or shown at each step."""

import numpy as np
import pytest
from compiled import Compiled
from support import random_motion
from test_export_c import OK, REFUSED, Both, flat, shown

import tensctl as tc

N, DT = 3, 0.02
TIP = tc.Weights(outputs={"nodes:P4_1_1": 1e-2})
# The solver whose KKT residual is the least: 1e-15, where others stop at 1e-12.
LIMITS = {"horizon": N, "dt": DT, "tension_min": 0.5, "rate_max": 2.0, "weights": TIP, "solver": "daqp"}
TIMES = np.array([0.1, 0.33, 0.7, 1.1])
MOVES = 0.01 * np.array([[0, 0, 0], [1, 0, 0.5], [1, 1, -0.5], [0, -1, 0.2]])


def tip_of(rest):
    return rest.nodes[rest.structure.node_labels.index("P4_1_1")]


def played(mast, controller, folder, asked=None, t_end=0.6):
    """A closed loop of both, from a small push."""
    dynamics, rest, _ = mast
    tc.export_c(controller, folder)
    both = Both(controller, Compiled(folder / "controller.c", 21), asked)
    start = random_motion(rest.potential, np.random.default_rng(1), 1e-3, 0.01)
    tc.simulate(dynamics, start, controller=both, t_end=t_end, rate_max=LIMITS["rate_max"])
    return both


def test_a_table_known_ahead(mast, tmp_path):
    """In total, 151 steps to beyond its last knot, with a delay; without a signal the tip would stay."""
    _, rest, linear = mast
    signal = TIMES, tip_of(rest) + MOVES
    both = played(mast, tc.MPC(linear, signal=signal, delay=0.01, **LIMITS), tmp_path, t_end=3.0)
    assert len(both.differences) == 151
    assert max(both.differences) < 1e-9
    assert np.abs(np.array([u for _, u, _ in both.steps[15:]]) - rest.inputs).max() > 5e-3


def test_courses_about_rest_taken_to_last(mast, tmp_path):
    """Without preview; one output has two knots, one has three, and one stays."""
    courses = tc.Courses({"P4_1_1_x": ([0.1, 0.3], [0.0, 0.02]), "P4_1_1_z": ([0.05, 0.2, 0.35], [0.0, 0.01, -0.02])})
    both = played(mast, tc.MPC(mast[2], signal=courses, preview=False, **LIMITS), tmp_path)
    assert max(both.differences) < 1e-9


@pytest.mark.parametrize("preview", [True, False])
def test_what_is_wanted_is_shown_where_the_signal_is_a_function(mast, tmp_path, preview):
    _, rest, linear = mast

    def signal(t):
        return tip_of(rest) + 0.01 * np.sin(3 * t + np.arange(3))

    def asked(t):
        times = t + DT * np.arange(1, N + 1) if preview else [t]
        return np.concatenate([signal(time) for time in times])

    controller = tc.MPC(linear, signal=signal, preview=preview, **LIMITS)
    both = played(mast, controller, tmp_path, asked)
    assert max(both.differences) < 1e-9
    assert "wanted of P4_1_1_x, P4_1_1_y, P4_1_1_z, in total" in (tmp_path / "controller.h").read_text()
    seen = flat(shown(rest, rest.nodes, np.zeros_like(rest.nodes), rest.inputs))
    assert both.c.step(np.concatenate([seen, asked(0.0)]))[0] == OK
    assert both.c.step(np.concatenate([seen, np.nan * asked(0.0)]))[0] == REFUSED


def test_from_sensors(mast, tmp_path):
    dynamics, rest, linear = mast
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    signal = TIMES, tip_of(rest) + MOVES
    both = played(mast, tc.OutputMPC(linear, eyes, signal=signal, **LIMITS), tmp_path)
    assert max(both.differences) < 1e-8


def test_from_sensors_with_a_function(mast, tmp_path):
    """What is missing from the sensors is gone without; what is wanted has to be told."""
    dynamics, rest, linear = mast
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)

    def signal(t):
        return tip_of(rest) + 0.01 * np.sin(3 * t + np.arange(3))

    controller = tc.OutputMPC(linear, eyes, signal=signal, preview=False, **LIMITS)
    both = played(mast, controller, tmp_path, signal)
    assert max(both.differences) < 1e-8
    seen = np.concatenate([eyes.of(rest), rest.inputs])
    assert both.c.step(np.concatenate([np.nan * seen, signal(0.0)]))[0] == OK
    outcome, u = both.c.step(np.concatenate([seen, [np.nan, 0.0, 0.0]]))
    assert outcome == REFUSED
    assert np.isfinite(u).all()
