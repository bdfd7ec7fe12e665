"""Error against run time of a scene's own motion: errors, drifts, failures, and the setting to use."""

import importlib
import json

import numpy as np
import pytest

import tensctl as tc
from tensctl.accuracy.work_precision import work_precision
from tensctl.cli import main
from tensctl.errors import SimulationError
from tensctl.simulation import simulate

room = importlib.import_module("tensctl.accuracy.work_precision")
METHODS = ("splitting4", "dopri5")


def _with(scene, **simulation):
    return scene.model_copy(update={"simulation": scene.simulation.model_copy(update=simulation)})


@pytest.fixture(scope="module")
def scene():
    return tc.load_scene("examples/shell_3_1.toml")


@pytest.fixture(scope="module")
def measured(scene):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(room, "applicable", lambda _: METHODS)
        short = _with(scene, t_end=0.2)
        return work_precision(short)


def test_errors_fall_with_the_tolerance(measured):
    for method in METHODS:
        error = [max(a.error, measured.reference_error) for a in measured.attempts if a.method == method]
        assert error[0] > 10 * error[2]
        assert (np.diff(error) <= 0).all()


def test_the_advised_setting_reaches_the_error(measured):
    best = measured.advised(1e-6)
    assert best.error <= 1e-6
    assert all(a.seconds >= best.seconds for a in measured.attempts if a.error <= 1e-6)
    assert measured.advised(measured.reference_error / 2) is None


def test_a_failing_method_is_listed(scene, monkeypatch):
    def failing(*args, method, **given):
        if method == "dopri5":
            raise SimulationError("it cannot be followed.")
        return simulate(*args, method=method, **given)

    monkeypatch.setattr(room, "applicable", lambda _: METHODS)
    monkeypatch.setattr(room, "simulate", failing)
    table = work_precision(_with(scene, t_end=0.05))
    failed = [a for a in table.attempts if a.method == "dopri5"]
    assert {a.failure for a in failed} == {"it cannot be followed."}
    assert table.table().count("it cannot be followed.") == len(failed)
    assert table.advised(1e-6).method == "splitting4"


def test_what_takes_too_long_is_listed_as_skipped(scene, monkeypatch):
    monkeypatch.setattr(room, "applicable", lambda _: METHODS)
    short = _with(scene, t_end=0.05)
    assert {a.failure[:7] for a in work_precision(short, budget=0.0).attempts} == {"skipped"}


def test_json_plot_and_command_line(measured, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("tensctl.accuracy.work_precision", lambda _: measured)
    assert main(["accuracy", "examples/shell_3_1.toml", "-o", str(tmp_path / "new")]) == 0
    assert measured.table() in capsys.readouterr().out
    read = json.loads((tmp_path / "new" / "accuracy.json").read_text())
    assert [a["tol"] for a in read["attempts"]] == [a.tol for a in measured.attempts]
    assert "splitting4" in str(read["attempts"])
    assert "</svg>" in (tmp_path / "new" / "accuracy.svg").read_text()


def test_drifts_are_those_of_the_recorded_motion(measured, scene, monkeypatch):
    """Rods as three masses, m/6, 4m/6 and m/6, have the same momenta as uniform ones."""
    assert all(np.isnan(a.momentum_drift) and np.isnan(a.energy_drift) for a in measured.attempts)
    free = _with(scene, push=(), start="nodes", t_end=0.05)
    free = free.model_copy(update={"structure": free.structure.model_copy(update={"pins": ()})})
    motion = room._motion(free)
    run = motion.run("dopri5", 1e-4)
    rods, mass = run.structure.rods, motion.dynamics.members.mass
    weight = np.stack([mass, 4 * mass, mass], axis=1) / 6
    ends = (run.nodes[:, rods], run.velocities[:, rods])
    x, v = (np.stack([a[:, :, 0], a.mean(axis=2), a[:, :, 1]], axis=2) for a in ends)
    centre = np.einsum("ra,trai->ti", weight, x) / mass.sum()
    linear = np.einsum("ra,trai->ti", weight, v)
    angular = np.einsum("ra,trai->ti", weight, np.cross(x - centre[:, None, None], v))
    scale = mass.sum() * np.linalg.norm(run.velocities, axis=2).max()
    size = np.ptp(motion.dynamics.structure.nodes, axis=0).max()
    expected = max(np.linalg.norm(p - p[0], axis=1).max() / s for p, s in ((linear, scale), (angular, scale * size)))
    energy, momentum = motion._drifts(run)
    assert momentum == pytest.approx(expected, rel=1e-3, abs=1e-15)
    assert motion._drifts(motion.run("dopri5", 1e-10))[1] < 1e-3 * momentum
    assert np.isfinite(energy)
