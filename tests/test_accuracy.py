"""Error against run time of a scene's own motion: errors, drifts, failures, and the setting to use."""

import json
from dataclasses import replace

import numpy as np
import pytest

import tensctl as tc
from tensctl.accuracy import SolverPrecision, WorkPrecision, work_precision
from tensctl.accuracy.motion import Motion
from tensctl.cli import main
from tensctl.errors import SceneError, SimulationError
from tensctl.scene import AccuracyStage
from tensctl.simulation import simulate

METHODS = ("splitting4", "dopri5")
WINCH = {"tendon": "t1_*", "times": [0, 0.05], "change": [0, 0.1]}
PUSH = {"node": "P4_1_1", "force": [1, 0, 0], "from": 0, "to": 1}


def _with(scene, **simulation):
    changed = scene.simulation.model_copy(update=simulation)
    return scene.model_copy(update={"simulation": changed, "accuracy": AccuracyStage(methods=METHODS)})


def _free(**sections):
    """The (3,1) shell released from its nodes, bound to nothing."""
    given = {"simulation": {"t_end": 0.05}, "accuracy": {"methods": METHODS}} | sections
    return tc.Scene(structure=tc.shell(3, 1), **given)


@pytest.fixture(scope="module")
def scene():
    return tc.load_scene("examples/shell_3_1.toml")


@pytest.fixture(scope="module")
def measured(scene):
    return work_precision(_with(scene, t_end=0.2))


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

    monkeypatch.setattr("tensctl.accuracy.motion.simulate", failing)
    table = work_precision(_with(scene, t_end=0.05))
    failed = [a for a in table.attempts if a.method == "dopri5"]
    assert {a.failure for a in failed} == {"it cannot be followed."}
    assert table.table().count("it cannot be followed.") == len(failed)
    assert table.advised(1e-6).method == "splitting4"
    assert "against cvodes" in table.reference


def test_a_method_that_does_not_apply_says_why():
    scene = _free(tendons={"damping": 1.0}, accuracy={"methods": ["splitting6", "dopri5"], "tolerances": [1e-6]})
    first, second = work_precision(scene).attempts
    assert "undamped scenes only" in first.failure
    assert not second.failure


def test_what_takes_too_long_is_listed_as_skipped(scene):
    measured = work_precision(_with(scene, t_end=0.05), budget=0.0)
    assert {a.failure[:7] for a in measured.attempts} == {"skipped"}
    assert "against itself" in measured.reference


def test_another_integrator_sees_what_two_tolerances_share(monkeypatch):
    """A splitting that is off by a micrometre at every tolerance."""

    def off(*args, method, **given):
        run = simulate(*args, method=method, **given)
        return replace(run, nodes=run.nodes + 1e-7) if method == "splitting6" else run

    honest = work_precision(_free())
    assert "splitting6 at 1e-14 against dopri5" in honest.reference
    assert honest.reference_error < 1e-11
    monkeypatch.setattr("tensctl.accuracy.motion.simulate", off)
    assert work_precision(_free()).reference_error == pytest.approx(np.sqrt(3) * 1e-7, rel=1e-3)
    assert work_precision(_free(), budget=0.0).reference_error < 1e-11


def test_stiff_dampers_are_judged_by_another_statement():
    stiff = _free(tendons={"stiffness": 1e5, "damping": 1e5}, accuracy={"methods": ["dopri5"], "tolerances": [1e-4]})
    measured = work_precision(stiff)
    assert "rosenbrock at 1e-14 against cvodes" in measured.reference
    assert measured.reference_error < 1e-8


@pytest.mark.parametrize(
    ("sections", "kept"),
    [
        ({}, True),
        ({"tendons": {"damping": 2.0}}, True),
        (
            {"simulation": {"t_end": 0.05, "schedule": [{"tendon": "t1_*", "times": [0, 0.05], "change": [0, 0.1]}]}},
            True,
        ),
        ({"drag": {"coefficient": 0.1}}, False),
        ({"gravity": {}}, False),
        ({"loads": {"P4_1_1": [0.0, 0.0, 1.0]}}, False),
        ({"simulation": {"t_end": 0.05, "push": [PUSH]}}, False),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, dict) else "",
)
def test_momentum_is_shown_whenever_it_is_kept(sections, kept):
    motion = Motion.of(_free(**sections), 1.0)
    momentum = motion.drifts(motion.run("dopri5", 1e-10))[1]
    assert bool(np.isfinite(momentum)) is kept
    assert not kept or momentum < 1e-10


def test_json_plot_and_command_line(measured, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr("tensctl.accuracy.work_precision", lambda _: measured)
    idle = SolverPrecision((), 0.02, 20, 420, 840, 11, 0, 0.2, 0.0)
    monkeypatch.setattr("tensctl.pipeline.measure_solvers", lambda _: idle)
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
    motion = Motion.of(free, 1.0)
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
    energy, momentum = motion.drifts(run)
    assert momentum == pytest.approx(expected, rel=1e-3, abs=1e-15)
    assert motion.drifts(motion.run("dopri5", 1e-10))[1] < 1e-3 * momentum
    assert np.isfinite(energy)


def test_the_section_is_checked_and_spelled_out():
    scene = _free(accuracy={})
    assert "[accuracy]\nmethods = []\ntolerances = [0.0001, 1e-06, 1e-08, 1e-10, 1e-12]\n" in scene.to_toml()
    assert "budget = 30.0  # s" in scene.to_toml()
    assert scene.stages["accuracy"]
    assert not tc.Scene(structure=tc.shell(3, 1)).stages["accuracy"]
    for given, words in (
        ({"tolerances": [0.0, 1e-3]}, r"accuracy.tolerances is \[0.0, 0.001\]; expected numbers > 0 and < 1"),
        ({"methods": ["dopri5", "dopri5"]}, "accuracy.methods is .*; expected each once"),
        ({"methods": ["euler"]}, "accuracy.methods"),
        ({"budget": 0}, r"accuracy.budget is 0; expected a finite number > 0 \(s\)"),
        ({"tol": 1e-3}, "accuracy.tol is no key of a scene"),
    ):
        with pytest.raises(SceneError, match=words):
            _free(accuracy=given)


def test_a_scene_that_asks_gets_it_in_summary_and_report(tmp_path):
    scene = _free(accuracy={"methods": METHODS, "tolerances": [1e-4, 1e-8]}, report={})
    results = tc.run(scene, tmp_path / "out")
    told = json.loads((tmp_path / "out" / "summary.json").read_text())["accuracy"]
    assert told == results.accuracy.to_dict()
    assert [(a["method"], a["tol"]) for a in told["attempts"]] == [(m, tol) for m in METHODS for tol in (1e-4, 1e-8)]
    best = results.accuracy.advised()
    assert told["recommended"] == {"method": best.method, "tol": best.tol}
    assert best.error <= told["wanted"]
    page = (tmp_path / "out" / "report.html").read_text()
    section = page[page.index('<section id="accuracy"') :]
    assert f'method = "{best.method}"' in section
    assert told["reference"] in section
    assert section[: section.index("</section>")].count("<tr>") == 5


def test_without_a_reference_the_other_results_stand(tmp_path, monkeypatch):
    def refused(scene):
        raise SimulationError("two strict runs part.")

    monkeypatch.setattr("tensctl.accuracy.work_precision", refused)
    results = tc.run(_free(report={}), tmp_path / "out")
    assert isinstance(results.accuracy, WorkPrecision)
    assert results.run.time[-1] == 0.05
    told = json.loads((tmp_path / "out" / "summary.json").read_text())["accuracy"]
    assert (told["failure"], told["attempts"], told["recommended"]) == ("two strict runs part.", [], None)
    assert "Nothing could be measured: two strict runs part." in (tmp_path / "out" / "report.html").read_text()


def test_explain_says_whether_it_is_asked_for(tmp_path, capsys):
    asked, absent = tmp_path / "asked.toml", tmp_path / "absent.toml"
    asked.write_text(_free().to_toml())
    absent.write_text(tc.Scene(structure=tc.shell(3, 1)).to_toml())
    assert main(["explain", str(asked)]) == 0
    assert "\nstages asked for: simulation, accuracy\n" in capsys.readouterr().out
    assert main(["explain", str(absent)]) == 0
    said = capsys.readouterr().out
    assert "\nstages asked for: none\n" in said
    assert ", accuracy, report\n" in said[said.index("left out at no cost") :]
