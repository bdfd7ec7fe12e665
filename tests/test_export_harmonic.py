"""Harmonic designs in C: one gain and one estimator, by the same commands as Python's harmonics."""

import numpy as np
import pytest
from compiled import Compiled
from support import random_motion, shell_scene
from test_export_c import Both
from test_export_lag import Told

import tensctl as tc
from tensctl.codegen import dense
from tensctl.errors import OutputError

DT = 0.02


def harmonic(**actuators):
    """The pinned (4,1) shell: dynamics, equilibrium, harmonics, and sensors of all lengths."""
    scene = shell_scene(4, 1, pins=["P1_*_1"], **({"actuators": actuators} if actuators else {}))
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    return dynamics, rest, tc.harmonics(dynamics, rest), tc.sensors(dynamics.structure, lengths=1e-3, seed=3)


@pytest.fixture(scope="module")
def shell():
    return harmonic()


@pytest.fixture(scope="module")
def lagging():
    return harmonic(lag=0.1)


def largest(case, design, folder, told=Both, shows=()):
    """Largest difference of commands over 26 steps."""
    dynamics, rest, _, _ = case
    tc.export_c(design, folder)
    both = told(design, Compiled(folder / "controller.c", rest.inputs.size))
    both.shows = shows
    start = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.3)
    tc.simulate(dynamics, start, controller=both, t_end=0.5, rate_max=1.0)
    assert np.ptp([u for _, u, _ in both.steps], axis=0).max() > 1e-3
    return max(both.differences)


@pytest.mark.parametrize("dt", [None, DT])
def test_state_feedback(shell, tmp_path, dt):
    assert largest(shell, tc.harmonic_lqr(shell[2], dt=dt), tmp_path) < 1e-11


def test_output_feedback(shell, tmp_path):
    assert largest(shell, tc.harmonic_lqg(shell[2], shell[3], dt=DT), tmp_path) < 1e-10


def test_state_feedback_of_actuators_with_lag(lagging, tmp_path):
    assert largest(lagging, tc.harmonic_lqr(lagging[2], dt=DT), tmp_path, Told, ("inputs", "commands")) < 1e-11


def test_output_feedback_of_actuators_with_lag(lagging, tmp_path):
    assert largest(lagging, tc.harmonic_lqg(lagging[2], lagging[3], dt=DT), tmp_path, Told, ("commands",)) < 1e-10


def test_what_is_refused(shell, tmp_path, monkeypatch):
    """A design that cannot be run, and one of more numbers than a compiler takes."""
    with pytest.raises(OutputError, match="give harmonic_lqg a control period dt"):
        tc.export_c(tc.harmonic_lqg(shell[2], shell[3]), tmp_path)
    monkeypatch.setattr(dense, "_LARGEST", 100)
    with pytest.raises(OutputError, match="are written, so choose fewer actuators"):
        tc.export_c(tc.harmonic_lqr(shell[2], dt=DT), tmp_path)
