"""A scene's LQR by harmonics is its dense LQR; harmonics are taken where the scene is symmetric and large enough."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
from harmonic_support import DAMPED, relative
from support import shell_scene, solved

import tensctl as tc
from tensctl import cli
from tensctl.codegen import export_c
from tensctl.pipeline import design
from tensctl.pipeline.feedback import design_lqr
from tensctl.pipeline.way import WORTH_IT, lqr_of
from tensctl.scene import LqrStage
from tensctl.synthesis import HarmonicLQR, HarmonicSampledLQR
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.weights import Cost

SIZES = {"nodes": {"*": 0.02, "P4_*": 0.005}, "tensions": 5.0, "rest_lengths": {"*": 0.1, "t5_*": 0.05}}
WEIGHTS = [{}, {"energy_weight": 3.0, "input_weight": 0.2, "tensions": 2.0}, SIZES, {**SIZES, "dt": 0.01}]


def shell(n, m, **given):
    return solved(shell_scene(n, m, **given))[2]


@pytest.fixture(scope="module")
def free():
    return {(3, 1): shell(3, 1), (4, 2): shell(4, 2), (5, 2): shell(5, 2)}


class TestSameAnswers:
    @pytest.mark.parametrize("size", [(3, 1), (4, 2)], ids=str)
    @pytest.mark.parametrize("weights", WEIGHTS, ids=["default", "weighed", "sized", "sampled"])
    def test_gain_cost_and_poles(self, free, size, weights):
        wanted = design_lqr(LqrStage(**weights), free[size])
        found, _ = lqr_of(LqrStage(way="harmonics", **weights), free[size])
        assert isinstance(found, HarmonicSampledLQR if "dt" in weights else HarmonicLQR)
        K, P = found.dense(free[size])
        assert relative(K, wanted.K) < 1e-11
        assert relative(P, wanted.P) < 1e-11
        assert found.slowest == pytest.approx(wanted.slowest, rel=1e-10)
        assert found.dt == pytest.approx(wanted.dt, rel=1e-12)
        found.verify(1e-13)

    def test_pinned_damped_and_dragged(self):
        linear = shell(4, 1, pins=["P1_*_1"], **DAMPED)
        K, _ = lqr_of(LqrStage(way="harmonics", nodes=0.01), linear)[0].dense(linear)
        assert relative(K, design_lqr(LqrStage(nodes=0.01), linear).K) < 1e-11

    @pytest.mark.parametrize("dt", [None, 0.01])
    def test_doubt_is_that_of_the_block_diagonal_whole(self, free, dt):
        """The same changes of the same numbers, drawn anew: estimates of one size."""
        design = lqr_of(LqrStage(way="harmonics", dt=dt), free[4, 2])[0]
        if isinstance(design, HarmonicSampledLQR):
            data = [(*s.with_input_state(), c) for s, c in zip(design.sampled, design.period_costs, strict=True)]
        else:
            blocks = zip(design.linear.blocks, design.costs, strict=True)
            data = [(block.A, block.B, cost) for block, cost in blocks]
        copies = [block.copies for block in design.linear.blocks]

        def whole(matrices):
            parts = zip(matrices, copies, strict=True)
            return sla.block_diag(*(part for M, k in parts for part in (M, M.conj())[:k]))

        A, B, P, K = (whole(each) for each in ([d[0] for d in data], [d[1] for d in data], design.P, design.K))
        cost = Cost(*(whole([getattr(d[2], name) for d in data]) for name in "QRN"))
        wanted = gain_doubt(A, B, cost, P, K, sampled=dt is not None).relative
        assert wanted / 2 < design.gain_doubt < 2 * wanted


class TestWhichWay:
    def test_small_is_dense(self, free):
        found, way = lqr_of(LqrStage(), free[4, 2])
        assert isinstance(found, tc.LQR)
        assert str(way) == f"dense, since harmonics are taken from {WORTH_IT} degrees of freedom on, here are 80"

    def test_large_and_symmetric_is_harmonic(self, free):
        found, way = lqr_of(LqrStage(), free[5, 2])
        assert isinstance(found, HarmonicLQR)
        assert str(way).startswith("harmonic by harmonic, since 5 sectors are equal to ")
        assert found.linear.mismatch < 1e-14

    def test_as_the_scene_asks(self, free):
        found, way = lqr_of(LqrStage(way="dense"), free[5, 2])
        assert isinstance(found, tc.LQR)
        assert str(way) == "dense, since the scene asks for it"

    @pytest.mark.parametrize(
        ("weights", "why"),
        [
            ({"nodes": {"*": 0.01, "P4_1_2": 0.001}}, "allowed sizes of nodes are not the same in all sectors"),
            ({"tensions": {"t5_1_1": 1.0}}, "allowed sizes of tensions are not the same"),
            ({"rest_lengths": {"*": 0.1, "t5_1_1": 0.2}}, "allowed sizes of rest_lengths are not the same"),
            ({"stabilisable_only": True}, "stabilisable_only leaves modes out"),
        ],
    )
    def test_what_the_scene_asks_breaks_it(self, free, weights, why):
        found, way = lqr_of(LqrStage(**weights), free[5, 2])
        assert isinstance(found, tc.LQR)
        assert way.taken == "dense"
        assert why in way.why

    def test_one_tendon_breaks_it(self):
        linear = shell(5, 2, tendons={"stiffness": {"*": 100.0, "t5_1_1": 101.0}, "rest_ratio": 0.8})
        found, way = lqr_of(LqrStage(), linear)
        assert isinstance(found, tc.LQR)
        assert way.why.startswith("the scene has no cyclic symmetry")
        with pytest.raises(tc.SynthesisError, match=r'lqr.way is "harmonics", but the scene has no .*; take "auto"'):
            lqr_of(LqrStage(way="harmonics"), linear)

    def test_a_mode_out_of_reach_is_named(self):
        linear = shell(4, 1, actuators={"tendons": ["t4_*"]})
        with pytest.raises(tc.SynthesisError, match=r"harmonic 2: a mode at .* is neither damped nor driven"):
            lqr_of(LqrStage(way="harmonics"), linear)

    def test_no_mode_is_left_out_by_harmonics(self):
        with pytest.raises(tc.SceneError, match=r'lqr.way is "harmonics", which leave no mode out; expected "dense"'):
            shell_scene(3, 1, lqr={"way": "harmonics", "stabilisable_only": True})


class TestDownstream:
    @pytest.fixture(scope="class")
    @classmethod
    def runs(cls, tmp_path_factory):
        """Results and summary of one closed loop, either way."""
        push = {"node": "P4_1_1", "force": [2.0, 0.0, 1.0], "from": 0.05, "to": 0.1}
        found = {}
        for way in ("dense", "harmonics"):
            simulation = {"t_end": 0.3, "controller": "lqr", "push": [push]}
            scene = shell_scene(4, 2, lqr={"way": way, "dt": 0.01}, simulation=simulation, report={})
            folder: Path = tmp_path_factory.mktemp(way) / "out"
            results = tc.run(scene, folder)
            page = (folder / "report.html").read_text(encoding="utf-8")
            found[way] = results, json.loads((folder / "summary.json").read_text(encoding="utf-8")), page
        return found

    def test_closed_loops_are_one(self, runs):
        dense, harmonic = runs["dense"][0].run, runs["harmonics"][0].run
        assert np.abs(harmonic.inputs).max() > 1e-3
        assert np.abs(harmonic.nodes - dense.nodes).max() < 1e-11
        assert np.abs(harmonic.inputs - dense.inputs).max() < 1e-11

    def test_summaries_agree(self, runs):
        dense, harmonic = runs["dense"][1]["lqr"], runs["harmonics"][1]["lqr"]
        assert harmonic.keys() == dense.keys()
        assert (dense["way"], harmonic["way"]) == ("dense", "harmonics")
        assert harmonic["why"].startswith("4 sectors are equal to ")
        assert harmonic["slowest_pole"] == pytest.approx(dense["slowest_pole"], rel=1e-10)
        assert harmonic["riccati_residual"] < 1e-13
        assert harmonic["gain_doubt"] < 1e-11
        for margin in ("disk_margin", "disk_margin_of_one_input"):
            assert harmonic[margin] == pytest.approx(dense[margin], rel=1e-5)
        assert harmonic["weakest_input"][:2] == dense["weakest_input"][:2]

    def test_margins_that_cost_too_much_are_left_out_with_the_reason(self, runs, monkeypatch):
        from tensctl.pipeline.summary import summarise
        from tensctl.synthesis import harmonic_margins

        monkeypatch.setattr(harmonic_margins, "STATES", 50)
        monkeypatch.setattr(harmonic_margins, "_POLES", 100)
        found = summarise(runs["harmonics"][0], {})["lqr"]
        assert "harmonics of up to" in found["disk_margin_left_out"]
        assert "beyond 100 poles" in found["disk_margin_of_one_input_left_out"]
        assert not {"disk_margin", "disk_margin_of_one_input", "weakest_input"} & found.keys()

    def test_report_says_which(self, runs):
        assert "harmonic by harmonic, since 4 sectors are equal to" in runs["harmonics"][2]
        assert "dense, since the scene asks for it" in runs["dense"][2]

    def test_c_source_holds_the_dense_gain(self, tmp_path):
        designs = [design(shell_scene(3, 1, lqr={"way": way, "dt": 0.01})) for way in ("harmonics", "dense")]
        either = [export_c(one, tmp_path / "law.c").source for one in designs]
        assert either[0] == either[1]

    def test_explain(self, tmp_path, capsys):
        path = tmp_path / "scene.toml"
        path.write_text(shell_scene(3, 1, lqr={"way": "harmonics"}).to_toml(), encoding="utf-8")
        assert cli.main(["explain", str(path)]) == 0
        assert "LQR: harmonic by harmonic, since 3 sectors are equal to" in capsys.readouterr().out
