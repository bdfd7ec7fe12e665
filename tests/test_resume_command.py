"""`tensctl run` stores a run while it goes on, `tensctl resume` ends it: identical to one that was never cut short."""

import json
from contextlib import suppress

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc
from tensctl.cli import main
from tensctl.errors import OutputError, SimulationError
from tensctl.simulation.store import Store
from tensctl.synthesis import MPC, Weights
from tensctl.synthesis.qp import QP
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_osqp import OsqpSolver

ARRAYS = ("time", "nodes", "velocities", "lengths", "tensions", "rest_lengths", "inputs", "kkt", "relaxed")
PUSH = {"node": "P4_1_1", "force": [3.0, 0.0, 0.0], "from": 0.1, "to": 0.15}
TARGET = {"height_scale": 1.02, "duration": 0.3}


class Killed(BaseException):
    """What stops a run: nothing catches it."""


def _scene(controller, **sections):
    run = {"t_end": 0.5, "controller": controller, "store": True, "chunk": 7, "push": [PUSH]}
    return shell_scene(pins=["P1_*_1"], simulation=run, **sections)


SCENES = {
    "none": _scene("none"),
    "lqr": _scene("lqr", lqr={}),
    "mpc": _scene("mpc", mpc={"horizon": 5}, target=TARGET),
    "mpc with osqp": _scene("mpc", mpc={"horizon": 5, "solver": "osqp", "tension_min": 5.0}),
    "mpc that gives way": _scene("mpc", mpc={"horizon": 3, "tension_min": 40.0}),
}


def _cut(monkeypatch, keeps):
    """Let the machine die while the next chunk after so many is on its way to the disk."""
    kept, whole = [], Store.keep

    def dying(self, part, state):
        if len(kept) == keeps:
            raise Killed
        kept.append(part)
        whole(self, part, state)

    monkeypatch.setattr(Store, "keep", dying)


def _equal(one, other):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    np.testing.assert_array_equal(one.status, other.status)
    assert (one.evaluations, one.switches, one.method) == (other.evaluations, other.switches, other.method)


@pytest.mark.parametrize("name", SCENES)
def test_a_run_cut_short_ends_as_if_it_had_not_been(name, tmp_path, monkeypatch, capsys):
    scene = SCENES[name]
    whole = tc.run(scene, tmp_path / "whole").run
    file, out = tmp_path / "scene.json", tmp_path / "cut"
    file.write_text(scene.model_dump_json(by_alias=True))
    with monkeypatch.context() as patch:
        _cut(patch, 2)
        with pytest.raises(Killed):
            main(["run", str(file), "-o", str(out), "--quiet"])
    assert len(tc.Run.load(out / "unfinished" / "run.nc").time) == 14
    assert not (out / "summary.json").exists()
    assert main(["resume", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out == f"results: {out}\n"
    assert sorted(p.name for p in out.iterdir() if not p.name.startswith(".")) == ["run.nc", "summary.json"]
    _equal(tc.Run.load(out / "run.nc"), whole)
    ours, theirs = (json.loads((tmp_path / f / "summary.json").read_text()) for f in ("cut", "whole"))
    for told in (ours, theirs):
        del told["seconds"]
        for time in ("median_step_s", "worst_step_s"):
            told.get("mpc", {}).pop(time, None)
    assert ours == theirs
    if name == "mpc that gives way":
        assert whole.relaxed.max() > 0


def test_the_motion_is_that_of_a_run_that_is_not_stored(tmp_path):
    scene = SCENES["none"]
    plain = scene.model_copy(update={"simulation": scene.simulation.model_copy(update={"store": False})})
    stored, other = (tc.run(each, tmp_path / str(k)).run for k, each in enumerate((scene, plain)))
    np.testing.assert_array_equal(stored.time, other.time)
    np.testing.assert_allclose(stored.nodes, other.nodes, rtol=0, atol=1e-9)


def test_a_run_that_was_whole_before_its_report_is_not_run_again(tmp_path, monkeypatch):
    scene = SCENES["lqr"]
    with monkeypatch.context() as patch:
        patch.setattr("tensctl.simulation.inspect_run", _die)
        with pytest.raises(Killed):
            tc.run(scene, tmp_path)
    monkeypatch.setattr(Store, "keep", _die)
    assert main(["resume", str(tmp_path), "--quiet"]) == 0
    assert tc.Run.load(tmp_path / "run.nc").time[-1] == 0.5


def _die(*args, **given):
    raise Killed


def test_what_was_recorded_is_not_thrown_away(tmp_path, monkeypatch, capsys):
    with monkeypatch.context() as patch:
        _cut(patch, 1)
        with suppress(Killed):
            tc.run(SCENES["none"], tmp_path)
    with pytest.raises(OutputError, match="holds an unfinished run; go on with it"):
        tc.run(SCENES["none"], tmp_path)
    assert main(["resume", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    assert main(["resume", str(tmp_path)]) == 2
    assert "holds no unfinished run" in capsys.readouterr().err


def test_nothing_stays_of_a_run_that_recorded_nothing(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        _cut(patch, 0)
        with suppress(Killed):
            tc.run(SCENES["none"], tmp_path)
    assert not (tmp_path / "unfinished").exists()
    assert tc.run(SCENES["none"], tmp_path).run.time[-1] == 0.5


def test_chunks_of_another_scene_are_refused(tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        _cut(patch, 1)
        with suppress(Killed):
            tc.run(SCENES["none"], tmp_path)
    kept = tmp_path / "unfinished" / "scene.toml"
    kept.write_text(kept.read_text().replace("mass = 1.0", "mass = 2.0"))
    from tensctl.pipeline import go_on

    with pytest.raises(SimulationError, match="recorded with other materials"):
        go_on(tmp_path)


@pytest.mark.parametrize("kind", [DaqpSolver, OsqpSolver])
def test_an_answer_does_not_know_what_was_solved_before(kind):
    """The same bits from a new solver and from one that has solved others, feasible or not."""
    rng = np.random.default_rng(3)
    half = rng.standard_normal((12, 12))
    H, A = half @ half.T + 1e-3 * np.eye(12), rng.standard_normal((20, 12))
    f = 10 * rng.standard_normal((5, 12))

    def problem(k, room):
        return QP(H, f[k], A, np.full(32, -room), np.full(32, room))

    used = kind(problem(0, 1.0))
    for k in range(1, 5):
        used.solve(QP(H, f[k], A, np.full(32, 1.0), np.full(32, 1.5)))
        used.solve(problem(0, 0.1 * k))
        fresh = kind(problem(0, 1.0)).solve(problem(k, 0.3))
        again = used.solve(problem(k, 0.3))
        assert fresh.z is not None
        np.testing.assert_array_equal(again.z, fresh.z)
        np.testing.assert_array_equal(again.y, fresh.y)


def test_mpc_remembers_its_plan_only():
    scene = SCENES["mpc with osqp"]
    linear = tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene))
    mpc, other = (MPC(linear, horizon=4, weights=Weights(input=2.0)) for _ in range(2))
    assert mpc.state() == {}
    start = (linear.equilibrium.nodes, np.zeros_like(linear.equilibrium.nodes))
    tc.simulate(linear.dynamics, start, controller=mpc, t_end=0.04)
    other.restore(mpc.state())
    np.testing.assert_array_equal(other.state()["plan"], mpc.state()["plan"])
    assert other.records == []
