"""Options of scenes and predictive controllers that change what the C source holds: commands stay those of Python."""

import numpy as np
import pytest
from compiled import Compiled
from support import random_motion, shell_scene, solved
from test_export_c import RELAXED, Both

import tensctl as tc

STIFF = {"stiffness": {"*": 100.0, "t1_1_1": 3e5}, "rest_ratio": 0.8}
CASES = {
    "largest changes": ({}, {"u_max": {"*": 0.3, "t5_*": 0.27}}),
    "stall limits": ({"actuators": {"force_max": 60.0}}, {}),
    "some tendons": ({"actuators": {"tendons": ["t5_*", "t6_*"]}}, {}),
    "gangs": ({"actuators": {"gangs": {"g": {"t5_1_1": 1.0, "t5_2_1": 1.0, "t5_3_1": -0.5}}}}, {}),
    "strain": ({"tendons": {"EA": 100.0, "rest_ratio": 0.8}}, {}),
    "modes left out": ({"tendons": STIFF}, {"modes": "truncate", "tension_min": 0.0}),
}


@pytest.mark.parametrize("name", CASES)
def test_commands_are_those_of_python(name, tmp_path):
    sections, options = CASES[name]
    dynamics, rest, linear = solved(shell_scene(pins=["P1_*_1"], **sections))
    mpc = tc.MPC(linear, **({"horizon": 3, "tension_min": 1.0, "rate_max": 2.0} | options))
    tc.export_c(mpc, tmp_path)
    both = Both(mpc, Compiled(tmp_path / "controller.c", len(linear.inputs)))
    start = random_motion(rest.potential, np.random.default_rng(1), 0.01, 0.2)
    tc.simulate(dynamics, start, controller=both, t_end=0.2, rate_max=2.0)
    assert max(both.differences) < 1e-9
    assert [outcome == RELAXED for outcome in both.outcomes] == [s.endswith("relaxed") for s in both.statuses]
    assert len(mpc.linear.modes) < len(linear.flexible.modes) or name != "modes left out"
