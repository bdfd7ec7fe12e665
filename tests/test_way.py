"""A scene's LQR by harmonics is its dense LQR; harmonics are taken where the scene is symmetric and large enough."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
from harmonic_support import DAMPED, relative
from support import replaced, shell_scene, solved

import tensctl as tc
from tensctl import cli
from tensctl.codegen import export_c
from tensctl.pipeline import design
from tensctl.pipeline.case import checks
from tensctl.pipeline.feedback import design_lqg, design_lqr
from tensctl.pipeline.way import WORTH_IT, lqg_of, lqr_of, way_of_lqg
from tensctl.scene import LqgStage, LqrStage, SensorsStage
from tensctl.synthesis import HarmonicLQG, HarmonicLQR, HarmonicSampledLQR
from tensctl.synthesis.condensed import stiffness_spread
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.qp_solvers import order_of
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

    def test_at_a_target(self):
        """At the end of a path, with rest lengths that are not the structure's own."""
        scene = shell_scene(3, 1, pins=["P1_*_1"], target={"height_scale": 1.1})
        target = tc.plan_shape(scene).target
        linear = tc.linearize(tc.build_dynamics(scene), target, outputs=())
        assert np.abs(target.inputs).max() > 0.01
        K, _ = lqr_of(LqrStage(way="harmonics"), linear)[0].dense(linear)
        assert relative(K, design_lqr(LqrStage(), linear).K) < 1e-11

    def test_pinned_damped_and_dragged(self):
        linear = shell(4, 1, pins=["P1_*_1"], **DAMPED)
        K, _ = lqr_of(LqrStage(way="harmonics", nodes=0.01), linear)[0].dense(linear)
        assert relative(K, design_lqr(LqrStage(nodes=0.01), linear).K) < 1e-11

    @pytest.mark.parametrize("size", [(3, 1), (4, 2)], ids=str)
    def test_output_feedback(self, free, size):
        """Gains, and what is told of the loop: each dense number comes from matrices of full size."""
        seen = SensorsStage(lengths={"*": 1e-3, "t5_*": 2e-3}, tensions={"t1_*": 0.05})
        given = {"tensions": 5.0, "force_noise": {"*": 0.1, "P4_*": 0.2}, "dt": 0.01}
        wanted = design_lqg(LqgStage(**given), seen, free[size])
        found, way = lqg_of(LqgStage(way="harmonics", **given), seen, free[size])
        assert isinstance(found, HarmonicLQG)
        assert way.taken == "harmonics"
        assert relative(found.regulator.dense(free[size])[0], wanted.regulator.K) < 1e-11
        assert relative(found.filter.dense(free[size])[0], wanted.filter.gain) < 1e-11
        assert found.order == wanted.order
        assert found.slowest == pytest.approx(wanted.slowest, rel=1e-8)
        assert found.expected_cost == pytest.approx(wanted.expected_cost, rel=1e-10)
        assert found.shake == pytest.approx(wanted.shake, rel=1e-9)
        assert found.separation < 1e-8
        assert found.covariance_residual < 1e-13

    def test_a_wrong_loop_shows_in_its_separation(self, free):
        design = lqg_of(LqgStage(way="harmonics"), SensorsStage(lengths=1e-3), free[3, 1])[0]
        first, second = design.estimators
        wrong = replaced(design, estimators=(first, replaced(second, C=1.01 * second.C)))
        assert wrong.separation > 1e-4

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
        assert (
            str(way) == f"dense, since harmonics are taken from {WORTH_IT[LqrStage]} degrees of freedom on, here are 80"
        )
        assert way_of_lqg(LqgStage(), SensorsStage(lengths=1e-3), free[4, 2])[0].taken == "harmonics"

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

    @pytest.mark.parametrize(
        ("seen", "given", "why"),
        [
            ({"lengths": {"*": 1e-3, "t5_1_1": 2e-3}}, {}, "the noises of sensors are not the same in all sectors"),
            ({"lengths": {"t5_1_1": 1e-3, "t6_*": 1e-3}}, {}, "outputs lengths leave out images of what they show"),
            ({"lengths": 1e-3}, {"force_noise": {"*": 0.1, "P4_1_1": 0.2}}, "the noises of forces are not the same"),
            ({"lengths": 1e-3}, {"order": 20}, "order asks for fewer states, and harmonics keep all"),
        ],
    )
    def test_sensors_and_noise_break_it(self, free, seen, given, why):
        way, symmetric = way_of_lqg(LqgStage(**given), SensorsStage(**seen), free[5, 2])
        assert way.taken == "dense"
        assert symmetric is None
        assert why in way.why

    def test_sensors_that_break_it_are_refused(self, free):
        seen = SensorsStage(lengths={"*": 1e-3, "t5_1_1": 2e-3})
        with pytest.raises(
            tc.SynthesisError, match=r'lqg.way is "harmonics", but the noises of sensors are not .*; take'
        ):
            lqg_of(LqgStage(way="harmonics"), seen, free[5, 2])

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
        with pytest.raises(tc.SceneError, match=r'lqg.way is "harmonics", which keep all states; expected "dense"'):
            shell_scene(3, 1, lqg={"way": "harmonics", "order": 20}, sensors={"lengths": 1e-3})


class TestDownstream:
    @pytest.fixture(scope="class")
    @classmethod
    def runs(cls, tmp_path_factory):
        """Results and summary of one closed loop, either way."""
        push = {"node": "P4_1_1", "force": [2.0, 0.0, 1.0], "from": 0.05, "to": 0.1}
        found = {}
        for way in ("dense", "harmonics"):
            simulation = {"t_end": 0.2, "controller": "lqr", "push": [push]}
            asked = {"lqr": {"way": way, "dt": 0.02}, "lqg": {"way": way}, "sensors": {"lengths": 1e-3}}
            folder: Path = tmp_path_factory.mktemp(way) / "out"
            results = tc.run(shell_scene(3, 1, **asked, simulation=simulation, report={}), folder)
            page = (folder / "report.html").read_text(encoding="utf-8")
            found[way] = results, json.loads((folder / "summary.json").read_text(encoding="utf-8")), page
        return found

    def test_closed_loops_are_one(self, runs):
        dense, harmonic = runs["dense"][0].run, runs["harmonics"][0].run
        assert np.abs(harmonic.inputs).max() > 1e-3
        assert np.abs(harmonic.nodes - dense.nodes).max() < 1e-11
        assert np.abs(harmonic.inputs - dense.inputs).max() < 1e-11

    def test_closed_loops_from_sensors_are_one(self, runs):
        either = [runs[way][0] for way in ("dense", "harmonics")]
        start = tc.build_structure(either[0].scene).nodes
        dense, harmonic = (tc.simulate(r.dynamics, start, controller=r.lqg, t_end=0.1) for r in either)
        assert np.abs(harmonic.inputs).max() > 1e-2
        assert np.abs(harmonic.nodes - dense.nodes).max() < 1e-10

    def test_summaries_agree(self, runs):
        dense, harmonic = runs["dense"][1]["lqr"], runs["harmonics"][1]["lqr"]
        assert harmonic.keys() == dense.keys()
        assert (dense["way"], harmonic["way"]) == ("dense", "harmonics")
        assert harmonic["why"].startswith("3 sectors are equal to ")
        assert harmonic["slowest_pole"] == pytest.approx(dense["slowest_pole"], rel=1e-10)
        assert harmonic["riccati_residual"] < 1e-13
        assert harmonic["gain_doubt"] < 1e-11
        for margin in ("disk_margin", "disk_margin_of_one_input"):
            assert harmonic[margin] == pytest.approx(dense[margin], rel=1e-5)
        own = runs["dense"][0]  # of tendons with one margin either may be named
        named = own.linear.inputs.index(f"u_{harmonic['weakest_input']}")
        assert own.lqr.sensitivity.each_input[named].alpha == pytest.approx(dense["disk_margin_of_one_input"], rel=1e-5)

    def test_summaries_of_output_feedback_agree(self, runs):
        dense, harmonic = runs["dense"][1]["lqg"], runs["harmonics"][1]["lqg"]
        assert harmonic.keys() == dense.keys()
        assert (dense["way"], harmonic["way"]) == ("dense", "harmonics")
        for key in ("slowest_pole", "expected_cost_of_a_period", "node_deviation_from_sensor_noise_m"):
            assert harmonic[key] == pytest.approx(dense[key], rel=1e-8)
        for margin in ("disk_margin", "disk_margin_of_one_input"):
            assert harmonic[margin] == pytest.approx(dense[margin], rel=1e-5)
        assert all(check.ok for check in checks(runs["harmonics"][0]))

    def test_margins_that_cost_too_much_are_left_out_with_the_reason(self, runs, monkeypatch):
        from tensctl.pipeline.summary import summarise
        from tensctl.synthesis import harmonic_margins

        monkeypatch.setattr(harmonic_margins, "STATES", 30)
        monkeypatch.setattr(harmonic_margins, "_POLES", 60)
        found = summarise(runs["harmonics"][0], {})["lqr"]
        assert "harmonics of up to" in found["disk_margin_left_out"]
        assert "beyond 60 poles" in found["disk_margin_of_one_input_left_out"]
        assert not {"disk_margin", "disk_margin_of_one_input", "weakest_input"} & found.keys()

    def test_report_says_which(self, runs):
        assert runs["harmonics"][2].count("harmonic by harmonic, since 3 sectors are equal to") == 2
        assert runs["dense"][2].count("dense, since the scene asks for it") == 2

    def test_c_source_holds_the_dense_gain(self, tmp_path):
        ways = ("harmonics", "dense")
        designs = [design(shell_scene(3, 1, lqg={"way": way}, sensors={"lengths": 1e-3})) for way in ways]
        either = [export_c(one, tmp_path / "law.c").source for one in designs]
        assert either[0] == either[1]

    def test_explain(self, tmp_path, capsys):
        path, both = tmp_path / "scene.toml", {"lqr": {"way": "harmonics"}, "lqg": {}, "sensors": {"lengths": 1e-3}}
        path.write_text(shell_scene(3, 1, **both).to_toml(), encoding="utf-8")
        assert cli.main(["explain", str(path)]) == 0
        said = capsys.readouterr().out
        assert "LQR: harmonic by harmonic, since 3 sectors are equal to" in said
        assert "LQG: dense, since harmonics are taken from" in said


class TestForetold:
    """What `tensctl explain` says of controllers that are not designed yet is what the designs then say."""

    def told(self, tmp_path, capsys, **sections):
        path = tmp_path / "scene.toml"
        path.write_text(shell_scene(3, 1, pins=["P1_*_1"], **sections).to_toml(), encoding="utf-8")
        assert cli.main(["explain", str(path)]) == 0
        return capsys.readouterr().out

    def test_what_runs_with_a_target(self, tmp_path, capsys):
        plan = {"lqr": {}, "mpc": {"horizon": 4}, "target": {"height_scale": 1.02}}
        said = self.told(tmp_path, capsys, **plan, simulation={"t_end": 0.1, "controller": "mpc"})
        assert "LQR: about the target's shape, dense, since harmonics are taken from 100" in said
        assert 'designed and judged, not run: simulation.controller is "mpc"' in said
        assert "stages gone through for these: equilibrium, linearize\n" in said
        assert "stages left out at no cost: controllability, lqg, accuracy, report\n" in said
        said = self.told(tmp_path, capsys, lqr={"way": "harmonics"}, target=plan["target"])
        assert "LQR: about the target's shape, harmonic by harmonic where that and the weights" in said
        assert said.count("nothing is simulated") == 1
        said = self.told(tmp_path, capsys, **plan, simulation={"t_end": 0.1, "controller": "lqr"})
        assert "in the run dense about every second shape of the path\n" in said
        assert "MPC: linear model, 4 periods of 0.02 s, 84 variables, from the state; designed and judged" in said

    @pytest.mark.parametrize(
        "sections",
        [{"mpc": {"horizon": 4}}, {"mpc": {"horizon": 4}, "tendons": {"stiffness": {"*": 1.0, "t5_*": 1e6}}}],
        ids=["even", "stiff"],
    )
    def test_solvers_are_those_of_the_controller(self, tmp_path, capsys, sections):
        """The stiff mast's modes are too fast for the period: slow ones are kept, in both."""
        sections["mpc"] |= {"modes": "truncate"}
        said = self.told(tmp_path, capsys, **sections)
        controller = design(shell_scene(3, 1, pins=["P1_*_1"], **sections))
        spread = stiffness_spread(controller.linear)
        order = order_of(controller.solver, 84, spread)
        after = ", ".join(list(dict.fromkeys(name for name, _ in order))[1:])
        assert f"solver: {controller.solver} first, then {after}; {controller.why}\n" in said

    def test_limits(self, tmp_path, capsys):
        limits = {"force_max": {"t5_*": 20.0}, "power_max": 2.0, "lag": 0.1}
        said = self.told(tmp_path, capsys, actuators=limits, mpc={"u_max": 0.3, "delay": 0.01, "solver": "piqp"})
        assert "solver: piqp first, then dual, primal, daqp, osqp; asked for\n" in said
        kept = said[said.index("keeps") : said.index("leaves out")]
        for words in (
            "u_max, ",
            "force_max of 3 tendons",
            "delay of 0.01 s",
            "lag of 0.1 s",
            "power_max = 2 W of 3 motors",
        ):
            assert words in kept
        assert "leaves out followed outputs, power_max = 2 W of 18 motors, which have no force_max" in said

    def test_a_period_that_is_too_long_or_too_short(self, tmp_path, capsys):
        assert "solver: none, since mpc.dt = 0.5 s is too long for mode" in self.told(tmp_path, capsys, mpc={"dt": 0.5})
        assert "solver: none, since dt = 1e-15 s is so short" in self.told(tmp_path, capsys, mpc={"dt": 1e-15})
