"""Runs on disk: they grow by chunks, survive a kill at any moment, and go on from there to the same last bit."""

import signal
import subprocess
import sys
import tracemalloc
from dataclasses import fields
from pathlib import Path
from typing import get_args

import h5py
import numpy as np
import pytest
import xarray as xr
from support import shell_scene

import tensctl as tc
from tensctl.simulation import journal
from tensctl.simulation.integrators import Method, choose
from tensctl.simulation.journal import mend, staged
from tensctl.simulation.store import Store
from tensctl.synthesis import StepRecord

PINS = ["P1_*_1"]
LAGGED = {"lag": 0.03, "rate_max": 0.1}
METHODS = [method for method in get_args(Method) if method != "auto"]
# What acts: a ramp that outlasts chunks, a wave, a push and a history with edges of their own.
ACTING = {
    "schedule": [tc.Schedule("t3_1_1", [0.0, 0.11], [0.0, 0.004])],
    "pushes": [
        tc.Wave("P3_1_1", np.array([0.0, 0.0, 2.0]), frequency=7.0, phase=0.3),
        tc.Push("P3_2_1", (3.0, 0.0, 0.0), 0.013, 0.05),
        tc.History("P3_3_1", [0.02, 0.09], [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]),
    ],
}


class Counting:
    """A controller with a memory and records: each command is longer than the last."""

    dt = 0.01

    def __init__(self):
        self.count, self.records = 0, []

    def reset(self):
        self.count, self.records = 0, []

    def step(self, t, measurement):
        self.count += 1
        self.records.append(StepRecord(t, f"step {self.count}", 1e-3 * self.count, 0.0, 0.0))
        return np.full(measurement.inputs.size, 1e-5 * self.count**2) + 0.01 * measurement.inputs

    def state(self):
        return {"count": np.array(self.count)}

    def restore(self, state):
        self.count = int(state["count"])


class StoppedError(Exception):
    """What cuts runs short here."""


@pytest.fixture(scope="module")
def shell():
    scene = shell_scene(pins=PINS, actuators=LAGGED)
    return tc.build_dynamics(scene), tc.find_equilibrium(scene)


@pytest.fixture
def stop(monkeypatch):
    """Cut the run short after so many chunks."""

    def at(chunks):
        keep, kept = Store.keep, []

        def keep_or_stop(self, part, state):
            if len(kept) == chunks:
                raise StoppedError
            keep(self, part, state)
            kept.append(1)

        monkeypatch.setattr(Store, "keep", keep_or_stop)

    yield at
    monkeypatch.undo()


def contents(path):
    with xr.open_dataset(path, engine="h5netcdf") as data:
        return data.load()


def cut_and_resumed(stop, monkeypatch, dynamics, path, start, chunks, controller=None, **given):
    stop(chunks)
    with pytest.raises(StoppedError):
        tc.simulate(dynamics, start, store=path, controller=controller, **given)
    monkeypatch.undo()
    return tc.resume(dynamics, path, controller=None if controller is None else type(controller)())


def assert_same(run, other):
    for field in fields(tc.Run):
        if field.name != "structure":
            one, two = getattr(run, field.name), getattr(other, field.name)
            assert np.array_equal(one, two, equal_nan=np.asarray(one).dtype.kind == "f"), field.name
    for field in fields(tc.Structure):
        assert np.array_equal(getattr(run.structure, field.name), getattr(other.structure, field.name)), field.name


class TestGoingOn:
    @pytest.mark.parametrize("method", METHODS)
    def test_to_the_last_bit(self, shell, tmp_path, stop, monkeypatch, method):
        given = ACTING | {"timepts": np.linspace(0, 0.12, 101), "method": method, "chunk": 24}
        tc.simulate(*shell, store=tmp_path / "whole.nc", **given)
        run = cut_and_resumed(stop, monkeypatch, shell[0], tmp_path / "cut.nc", shell[1], 2, **given)
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))
        assert np.ptp(contents(tmp_path / "cut.nc").nodes.values, axis=0).max() > 1e-4
        assert np.array_equal(run.time, tc.Run.load(tmp_path / "whole.nc").time[96:])

    def test_with_dampers(self, tmp_path, stop, monkeypatch):
        scene = shell_scene(pins=PINS, tendons={"damping": 2.0})
        dynamics, start = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        given = ACTING | {"t_end": 0.12, "chunk": 77}
        tc.simulate(dynamics, start, store=tmp_path / "whole.nc", **given)
        cut_and_resumed(stop, monkeypatch, dynamics, tmp_path / "cut.nc", start, 2, **given)
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))

    @pytest.mark.parametrize("chunk", [1, 4, 100])
    def test_under_a_controller_that_remembers(self, shell, tmp_path, stop, monkeypatch, chunk):
        given = {"t_end": 0.1, "chunk": chunk}
        tc.simulate(*shell, store=tmp_path / "whole.nc", controller=Counting(), **given)
        if chunk < 11:
            cut_and_resumed(stop, monkeypatch, shell[0], tmp_path / "cut.nc", shell[1], 1, Counting(), **given)
            xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))
        whole = contents(tmp_path / "whole.nc")
        assert whole.status.values.tolist() == [f"step {k}" for k in range(1, 12)]
        assert np.array_equal(whole.sample, whole.time)

    def test_under_lqr(self, mast, tmp_path, stop, monkeypatch):
        dynamics, start, linear = mast
        lqr = tc.lqr(linear)
        given = {"t_end": 10 * lqr.dt, "chunk": 4, "pushes": [tc.Push("P3_1_1", (1.0, 0.0, 0.0), 0.0, 1.0)]}
        tc.simulate(dynamics, start, controller=lqr, store=tmp_path / "whole.nc", **given)
        stop(1)
        with pytest.raises(StoppedError):
            tc.simulate(dynamics, start, controller=lqr, store=tmp_path / "cut.nc", **given)
        monkeypatch.undo()
        tc.resume(dynamics, tmp_path / "cut.nc", controller=lqr)
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))

    def test_from_times_that_begin_later(self, shell, tmp_path, stop, monkeypatch):
        given = {"timepts": [0.003, 0.004, 0.0055, 0.02, 0.03], "chunk": 2}
        tc.simulate(*shell, store=tmp_path / "whole.nc", **given)
        cut_and_resumed(stop, monkeypatch, shell[0], tmp_path / "cut.nc", shell[1], 2, **given)
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))

    def test_of_an_adaptive_method_needs_its_step(self, shell, tmp_path, stop, monkeypatch):
        """Without the step that is kept the bits differ: the comparison can fail."""
        given = {"t_end": 0.12, "method": "dopri5", "chunk": 200} | ACTING
        tc.simulate(*shell, store=tmp_path / "whole.nc", **given)
        stop(1)
        with pytest.raises(StoppedError):
            tc.simulate(*shell, store=tmp_path / "cut.nc", **given)
        monkeypatch.undo()
        with h5py.File(tmp_path / "cut.nc", "r+") as file:
            file["resume/state/integrator.step"][()] *= 0.5
        tc.resume(shell[0], tmp_path / "cut.nc")
        difference = contents(tmp_path / "cut.nc").nodes - contents(tmp_path / "whole.nc").nodes
        assert np.abs(difference[:200]).max() == 0 < np.abs(difference[200:]).max()

    def test_with_the_method_that_it_began_with(self, shell, tmp_path, stop, monkeypatch):
        """Should "auto" take another one by then, that changes nothing."""
        given = {"t_end": 0.02, "chunk": 200}
        tc.simulate(*shell, store=tmp_path / "whole.nc", **given)
        stop(1)
        with pytest.raises(StoppedError):
            tc.simulate(*shell, store=tmp_path / "cut.nc", **given)
        monkeypatch.undo()
        monkeypatch.setattr(choose, "fitting", lambda *_: ("dopri5", "another time"))
        assert tc.resume(shell[0], tmp_path / "cut.nc").method == "splitting6"
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))


class TestTheFile:
    def test_is_what_save_writes(self, shell, tmp_path):
        tc.simulate(*shell, t_end=0.02, store=tmp_path / "stored.nc", chunk=200)
        tc.Run.load(tmp_path / "stored.nc").save(tmp_path / "saved.nc")
        xr.testing.assert_identical(contents(tmp_path / "stored.nc"), contents(tmp_path / "saved.nc"))

    def test_one_chunk_is_the_run_itself(self, shell, tmp_path):
        run = tc.simulate(*shell, t_end=0.02, store=tmp_path / "run.nc")
        assert_same(run, tc.simulate(*shell, t_end=0.02))
        assert_same(tc.Run.load(tmp_path / "run.nc"), run)

    def test_is_readable_after_every_chunk(self, shell, tmp_path, monkeypatch):
        keep, seen = Store.keep, []

        def keep_and_look(self, part, state):
            keep(self, part, state)
            seen.append(contents(tmp_path / "run.nc").sizes["time"])

        monkeypatch.setattr(Store, "keep", keep_and_look)
        run = tc.simulate(*shell, t_end=0.02, store=tmp_path / "run.nc", chunk=200)
        assert seen == [200, 400, 501]
        assert len(run.time) == 101
        assert sorted(entry.name for entry in tmp_path.iterdir()) == ["run.nc"]

    def test_replaces_an_earlier_one(self, shell, tmp_path):
        for t_end in (0.02, 0.01):
            tc.simulate(*shell, t_end=t_end, store=tmp_path / "run.nc", chunk=300)
        assert tc.Run.load(tmp_path / "run.nc").time[-1] == 0.01

    def test_memory_does_not_grow_with_the_run(self, shell, tmp_path):
        def peak(records):
            tracemalloc.start()
            times = np.linspace(0, 0.01, records)
            tc.simulate(*shell, timepts=times, store=tmp_path / f"{records}.nc", chunk=500)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            return peak

        peak(1000)
        short, long = peak(1000), peak(8000)
        grown = (tmp_path / "8000.nc").stat().st_size - (tmp_path / "1000.nc").stat().st_size
        assert grown > 5e6
        assert long - short < 0.1 * grown

    def test_saved_runs_are_loaded(self, shell, mast, tmp_path):
        controlled = tc.simulate(*shell, controller=Counting(), t_end=0.1)
        for run in (tc.simulate(*mast[:2], t_end=0.01), controlled):
            assert_same(tc.Run.load(run.save(tmp_path / "run.nc")), run)

    @pytest.mark.parametrize("method", ["splitting6", "dopri5"])
    def test_other_recorded_times_are_the_same_motion(self, shell, method):
        few, many = (
            np.linspace(0, 0.1, 11),
            np.sort(np.append(np.linspace(0, 0.1, 11), np.linspace(0.0003, 0.0997, 83))),
        )
        given = ACTING | {"method": method}
        run, other = tc.simulate(*shell, timepts=few, **given), tc.simulate(*shell, timepts=many, **given)
        common = np.isin(other.time, few)
        assert common.sum() == 11
        assert np.array_equal(other.nodes[common], run.nodes)
        assert np.array_equal(other.velocities[common], run.velocities)


class TestKills:
    """A file of 60,000 bytes, of which some change and some are added: any moment of a change leaves old or new."""

    @pytest.fixture
    def files(self, tmp_path, rng):
        old = rng.bytes(60_000)
        added = rng.bytes(9_000)
        new = old[:100] + b"changed" + old[107:50_000] + added + old[59_000:] + added
        path = tmp_path / "file"
        path.write_bytes(old)
        return path, old, new, added

    def change(self, files):
        path, _, _, added = files
        with staged(path) as file:
            file.seek(100)
            file.write(b"changed")
            file.seek(50_000)
            file.write(added)
            file.seek(0, 2)
            file.write(added)

    def test_a_change(self, files):
        self.change(files)
        assert files[0].read_bytes() == files[2]
        assert sorted(entry.name for entry in files[0].parent.iterdir()) == ["file"]

    def test_what_is_staged_is_read(self, files):
        path, _, new, added = files
        with staged(path) as file:
            file.seek(50_000)
            file.write(added)
            file.seek(49_990)
            assert file.read(100) == new[49_990:50_090]
            file.truncate(50_040)
            file.seek(49_990)
            assert file.read(100) == new[49_990:50_040]
        assert path.stat().st_size == 50_040

    def test_a_raise_changes_nothing(self, files):
        def lose():
            with staged(files[0]) as file:
                file.write(b"lost")
                raise StoppedError

        with pytest.raises(StoppedError):
            lose()
        assert files[0].read_bytes() == files[1]

    def test_in_the_journal(self, files, monkeypatch):
        path, old, new, _ = files
        monkeypatch.setattr(journal, "_carry_out", lambda *_: None)
        self.change(files)
        monkeypatch.undo()
        whole = path.with_name("file.journal").read_bytes()
        for size in [*range(0, len(whole), 997), len(whole) - 1]:
            path.with_name("file.journal").write_bytes(whole[:size])
            mend(path)
            assert path.read_bytes() == old
        path.with_name("file.journal").write_bytes(whole)
        mend(path)
        assert path.read_bytes() == new

    @pytest.mark.parametrize("bytes_done", [0, 150, 5000, 55_000, 65_000])
    def test_in_the_file(self, files, monkeypatch, bytes_done):
        path, old, new, _ = files
        monkeypatch.setattr(journal, "_carry_out", lambda *_: None)
        self.change(files)
        monkeypatch.undo()
        path.write_bytes(new[:bytes_done] + old[bytes_done:])
        mend(path)
        assert path.read_bytes() == new

    @pytest.mark.parametrize("syncs", [3, 4])
    def test_of_a_process(self, shell, tmp_path, syncs):
        """Killed with the second change (of five) whole in the journal, or in the file with the journal still there."""
        dead = subprocess.run(
            [sys.executable, "-c", KILLED, str(tmp_path / "cut.nc"), str(syncs)], cwd=Path(__file__).parent
        )
        assert dead.returncode == -signal.SIGKILL
        assert (tmp_path / "cut.nc.journal").exists()
        whole = tc.simulate(*shell, t_end=0.01, store=tmp_path / "whole.nc", chunk=100)
        tc.resume(shell[0], tmp_path / "cut.nc")
        xr.testing.assert_identical(contents(tmp_path / "cut.nc"), contents(tmp_path / "whole.nc"))
        assert len(whole.time) == 1


KILLED = f"""
import os, signal, sys
import tensctl as tc
from support import shell_scene
settle, left = os.fsync, [int(sys.argv[2])]
def sync_or_die(number):
    settle(number)
    left[0] -= 1
    if not left[0]:
        os.kill(os.getpid(), signal.SIGKILL)
os.fsync = sync_or_die
scene = shell_scene(pins={PINS}, actuators={LAGGED})
tc.simulate(tc.build_dynamics(scene), tc.find_equilibrium(scene), t_end=0.01, store=sys.argv[1], chunk=100)
"""


class TestRefusals:
    @pytest.fixture
    def cut(self, shell, tmp_path, stop, monkeypatch):
        stop(1)
        with pytest.raises(StoppedError):
            tc.simulate(*shell, t_end=0.01, store=tmp_path / "run.nc", chunk=100)
        monkeypatch.undo()
        return tmp_path / "run.nc"

    @pytest.mark.parametrize(
        ("sections", "what"),
        [
            ({"pins": PINS, "tendons": {"damping": 1.0}}, "materials"),
            ({"pins": PINS, "actuators": {"lag": 0.02}}, "materials"),
            ({"pins": PINS, "actuators": LAGGED, "loads": {"P3_1_1": [0, 0, 1]}}, "loads"),
            ({"pins": PINS, "actuators": LAGGED, "radius": 0.7}, "nodes and members"),
            ({"actuators": LAGGED}, "nodes and members"),
        ],
    )
    def test_another_model(self, cut, sections, what):
        with pytest.raises(tc.SimulationError, match=f"other {what}; resume with the scene"):
            tc.resume(tc.build_dynamics(shell_scene(**sections)), cut)

    def test_no_run(self, shell, tmp_path):
        (tmp_path / "text.nc").write_text("no run")
        tc.simulate(*shell, t_end=0.01).save(tmp_path / "saved.nc")
        xr.Dataset({"a": 1}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
        for name, sentence in [
            ("text", "is no run"),
            ("saved", "is no run"),
            ("other", "is no run"),
            ("no", "no file"),
        ]:
            with pytest.raises(tc.SimulationError, match=sentence):
                tc.resume(shell[0], tmp_path / f"{name}.nc")
        for name, sentence in [("text", "holds no run"), ("other", "holds no run"), ("no", "no file")]:
            with pytest.raises(tc.SimulationError, match=sentence):
                tc.Run.load(tmp_path / f"{name}.nc")

    def test_a_complete_run(self, shell, cut):
        tc.resume(shell[0], cut)
        with pytest.raises(tc.SimulationError, match="complete: all 501 records"):
            tc.resume(shell[0], cut)

    def test_a_damaged_file(self, shell, cut):
        cut.write_bytes(cut.read_bytes()[:20_000])
        with pytest.raises(tc.SimulationError, match="is no run that can go on"):
            tc.resume(shell[0], cut)

    def test_another_version_of_the_integrator(self, shell, cut):
        with h5py.File(cut, "r+") as file:
            del file["resume/state/integrator.step"]
        with pytest.raises(tc.SimulationError, match="another version of splitting6"):
            tc.resume(shell[0], cut)

    def test_controllers(self, shell, cut, tmp_path):
        with pytest.raises(tc.SimulationError, match="recorded with no controller"):
            tc.resume(shell[0], cut, controller=Counting())

        class Forgetful:
            dt = 0.01

            def reset(self):
                pass

            def step(self, t, measurement):
                if t > 0.05:
                    raise StoppedError
                return measurement.inputs

        with pytest.raises(StoppedError):
            tc.simulate(*shell, t_end=0.1, store=tmp_path / "led.nc", chunk=2, controller=Forgetful())
        with pytest.raises(tc.SimulationError, match="recorded with a controller"):
            tc.resume(shell[0], tmp_path / "led.nc")
        with pytest.raises(tc.SimulationError, match=r"no state\(\) and restore\(\)"):
            tc.resume(shell[0], tmp_path / "led.nc", controller=Forgetful())

    @pytest.mark.parametrize("chunk", [0, -3, 1.5])
    def test_chunks(self, shell, tmp_path, chunk):
        with pytest.raises(tc.SimulationError, match="chunk is"):
            tc.simulate(*shell, t_end=0.01, store=tmp_path / "run.nc", chunk=chunk)

    def test_no_folder(self, shell, tmp_path):
        with pytest.raises(tc.OutputError, match="there is no folder"):
            tc.simulate(*shell, t_end=0.01, store=tmp_path / "no" / "run.nc")
