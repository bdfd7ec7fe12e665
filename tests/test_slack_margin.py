"""Predicted and measured tensions: equal to second order, parted where the structure loses what the plan kept."""

import io
import json
from collections import namedtuple

import numpy as np
import pytest
import xarray as xr
from support import shell_scene, taylor_order

import tensctl as tc
from tensctl.progress import Progress
from tensctl.simulation.parted import parting_told
from tensctl.synthesis.slack_margin import parting

FLOOR = 1.0
Bare = namedtuple("Bare", "nodes velocities inputs")
PUSH = tc.Push("P4_1_1", (20.0, 0.0, 0.0), 0.1, 0.2)


@pytest.fixture(scope="module")
def pushed(mast):
    """A push that no plan knows of takes tendons slack."""
    dynamics, rest, linear = mast
    controller = tc.MPC(linear, horizon=6, tension_min=FLOOR)
    return controller, tc.simulate(dynamics, rest, controller=controller, t_end=0.5, pushes=[PUSH])


class TestPrediction:
    @pytest.mark.parametrize("delay", [0.0, 0.007, 0.02])
    def test_is_right_to_first_order(self, mast, delay):
        """From a start near rest, under commands and speed, the gap of the second sample shrinks with the square."""
        dynamics, rest, linear = mast
        manifold, rng = rest.potential.manifold, np.random.default_rng(4)
        way, speed = rng.standard_normal((2, manifold.size))

        def gaps(size):
            nodes = manifold.retract(rest.nodes, size * way)
            velocities = (manifold.tangent(nodes) @ (size * 10 * speed)).reshape(-1, 3)
            controller = tc.MPC(linear, horizon=4, delay=delay, rate_max=1e3)
            tc.simulate(dynamics, (nodes, velocities), controller=controller, t_end=0.06)
            found = [record.margin_gap for record in controller.records]
            assert np.isnan(found[0])
            return np.array(found[2])

        assert taylor_order(gaps, np.array([4e-4, 2e-4, 1e-4])) > 1.9

    def test_on_a_path_that_is_followed(self, mast):
        """Curvature is all that is left: a hundredth of what tensions change by."""
        dynamics, rest, linear = mast
        path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), {"height_scale": 1.05, "duration": 0.6})
        for delay in (0.0, 0.01):
            controller = tc.MPC(linear, horizon=5, path=path, delay=delay)
            run = tc.simulate(dynamics, rest, controller=controller, t_end=0.6)
            assert np.nanmax(np.abs(run.margin_gap)) < 1e-2
            assert (run.parted == -1).all()


class TestParting:
    def test_under_a_push(self, mast, pushed):
        """Steps that part are those where the structure has less than nine tenths of a floor that was to be kept."""
        controller, run = pushed
        steps = np.flatnonzero(run.parted >= 0)
        assert steps.size >= 2
        for k in steps:
            measured = run.tensions[run.time == run.sample_time[k], run.parted[k]].item()
            assert measured < 0.9 * FLOOR
            assert measured + run.margin_gap[k] >= FLOOR * (1 - 1e-6)
        assert (run.sample_time[steps] > PUSH.start).all()
        assert [r.parted for r in controller.records] == run.parted.tolist()
        told = parting_told(run)
        assert f"tendon {run.structure.tendon_labels[run.parted[steps[0]]]} has" in told
        assert f"at {steps.size} of {run.parted.size} steps" in told

    @pytest.mark.parametrize(
        ("predicted", "measured", "floor", "tendon"),
        [
            ([1.0, 5.0], [0.95, 5.0], 1.0, -1),  # a tenth may be missing
            ([1.0, 5.0], [0.85, 5.0], 1.0, 0),
            ([0.5, 5.0], [0.0, 5.0], 1.0, -1),  # the plan knew
            ([3.0, 5.0], [1.4, 5.0], 1.0, 0),  # half of it is gone
            ([3.0, 5.0], [1.6, 2.0], 1.0, 1),
            ([0.2, 5.0], [0.0, 5.0], 0.0, 0),  # slack, without a floor
            ([1e-12, 5.0], [0.0, 5.0], 0.0, -1),  # rounding
            ([2.0, 5.0], [9.0, 9.0], 1.0, -1),  # more than predicted is no harm
            ([np.nan, 5.0], [0.0, 5.0], 1.0, -1),
            ([-5.0, 1.0], [0.0, 1.0], -1e6, -1),
        ],
    )
    def test_what_counts(self, predicted, measured, floor, tendon):
        assert parting(np.array(predicted), np.array(measured), floor).tendon == tendon

    def test_noise_is_no_parting(self):
        assert parting(np.array([1.0]), np.array([0.8]), 1.0, 0.3).tendon == -1
        assert parting(np.array([1.0]), np.array([0.6]), 1.0, 0.3).tendon == 0

    def test_the_gap_is_of_the_tendon_nearest_to_slack(self):
        assert parting(np.array([4.0, 2.0]), np.array([3.0, 1.8]), 1.0).gap == pytest.approx(0.2)
        assert np.isnan(parting(np.array([np.nan]), np.array([1.0]), 1.0).gap)


class TestMeasured:
    def test_tensions_follow_from_nodes_where_none_are_told(self, mast, pushed):
        """Gaps of the run again, from samples without tensions."""
        _, run = pushed
        controller = tc.MPC(mast[2], horizon=6, tension_min=FLOOR)
        for k, t in enumerate(run.time):
            controller.step(t, Bare(run.nodes[k], run.velocities[k], run.inputs[k]))
        gaps = np.array([record.margin_gap for record in controller.records])
        assert np.abs(gaps - run.margin_gap)[1:].max() < 1e-9
        assert [record.parted for record in controller.records] == run.parted.tolist()

    def test_measured_tensions_count(self, mast, pushed):
        """A gauge that reads 0.1 N less than there is."""
        _, run = pushed
        controller = tc.MPC(mast[2], horizon=6, tension_min=FLOOR)
        for k, t in enumerate(run.time[:4]):
            read = run.tensions[k] - 0.1
            controller.step(t, tc.Measurement(run.nodes[k], run.velocities[k], run.lengths[k], read, run.inputs[k]))
        gaps = np.array([record.margin_gap for record in controller.records])
        assert np.abs(gaps - run.margin_gap[:4] - 0.1)[1:].max() < 1e-9


class TestFromSensors:
    def test_only_where_tensions_are_read(self, mast):
        dynamics, rest, linear = mast
        for noise, known in (({"lengths": 1e-4}, False), ({"lengths": 1e-4, "tensions": 1e-2}, True)):
            controller = tc.OutputMPC(linear, tc.sensors(dynamics.structure, **noise), horizon=4, tension_min=FLOOR)
            run = tc.simulate(dynamics, rest, controller=controller, t_end=0.3)
            assert np.isfinite(run.margin_gap[1:]).all() == known
            assert (run.parted == -1).all()
            if known:
                assert np.abs(run.margin_gap[1:]).max() < 0.1

    def test_a_push_is_told(self, mast):
        dynamics, rest, linear = mast
        eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2)
        controller = tc.OutputMPC(linear, eyes, horizon=4, tension_min=FLOOR)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=0.3, pushes=[PUSH])
        assert (run.parted >= 0).sum() >= 2


class TestKept:
    def test_a_restored_controller_says_the_same(self, mast, pushed):
        _, run = pushed
        first, second = (tc.MPC(mast[2], horizon=6, tension_min=FLOOR) for _ in range(2))
        for k, t in enumerate(run.time[:10]):
            shown = tc.Measurement(run.nodes[k], run.velocities[k], run.lengths[k], run.tensions[k], run.inputs[k])
            if k == 6:
                second.restore({name: value.copy() for name, value in first.state().items()})
            first.step(t, shown)
            if k >= 6:
                second.step(t, shown)
                assert second.records[-1].margin_gap == first.records[-1].margin_gap
                assert second.records[-1].parted == first.records[-1].parted

    def test_after_a_missing_sample_there_is_nothing_to_compare(self, mast):
        rest = mast[1]
        shown = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
        controller = tc.MPC(mast[2], horizon=3)
        for k, seen in enumerate((shown, shown, None, shown, shown)):
            controller.step(0.02 * k, seen)
        assert [bool(np.isnan(r.margin_gap)) for r in controller.records] == [True, False, True, True, False]

    def test_files(self, pushed, tmp_path):
        """As written; files of earlier versions know nothing of it."""
        run = pushed[1]
        loaded = tc.Run.load(run.save(tmp_path / "run.nc"))
        assert np.array_equal(loaded.margin_gap, run.margin_gap, equal_nan=True)
        assert (loaded.parted == run.parted).all()
        with xr.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as data:
            data.drop_vars(["margin_gap", "parted"]).to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
        old = tc.Run.load(tmp_path / "old.nc")
        assert np.isnan(old.margin_gap).all()
        assert old.margin_gap.size == run.kkt.size
        assert (old.parted == -1).all()


def test_from_a_scene_it_is_warned_of_once_and_counted(tmp_path):
    push = {"node": "P4_1_1", "force": [20.0, 0.0, 0.0], "from": 0.1, "to": 0.2}
    scene = shell_scene(
        pins=["P1_*_1"], mpc={"horizon": 5, "tension_min": FLOOR}, report={},
        simulation={"t_end": 0.3, "controller": "mpc", "push": [push]},
    )  # fmt: skip
    said = io.StringIO()
    tc.run(scene, tmp_path / "out", progress=Progress(stream=said))
    assert said.getvalue().count("part company") == 1
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["mpc"]
    assert summary["parted_steps"] >= 1
    assert summary["largest_margin_gap_N"] > 0.1
    assert "part company" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
