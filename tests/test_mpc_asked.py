"""What [mpc] of a scene asks for: largest changes of rest lengths, and weights by the size of outputs."""

import json
import re

import numpy as np
import pytest
from support import shell_scene, solved
from test_mpc import Overheard, Rough, keeps_hard_limits

import tensctl as tc
from tensctl.cli import main
from tensctl.pipeline.feedback import mpc_weights
from tensctl.synthesis.qp_cvxpy import reference_optimum
from tensctl.synthesis.qp_daqp import DaqpSolver

MAST = {"pins": ["P1_*_1"]}
SIZES = {"energy_weight": 0.5, "nodes": {"P4_*": 0.002}, "tensions": 2.0, "rest_lengths": {"*": 0.1, "t5_*": 0.02}}

COURSE = {"output": "P4_1_1_x", "size": 0.001, "times": [0.0, 1.0], "change": [0.0, 0.01]}


class TestLargestChange:
    def test_is_kept_by_each_command_whatever_is_wanted(self, mast):
        dynamics, rest, linear = mast
        table = {"*": 0.03, "t5_*": 0.01}
        controller = tc.MPC(linear, horizon=5, rate_max=0.5, u_max=table, path=Rough(rest, 0))
        heard = Overheard(controller)
        run = tc.simulate(dynamics, rest, controller=heard, t_end=0.4)
        keeps_hard_limits(controller, run, heard)
        most = np.array([0.01 if label.startswith("u_t5_") else 0.03 for label in linear.inputs])
        assert (np.abs(heard.commands) <= most).all()
        assert (np.abs(heard.commands) == most).sum() >= 10, "the limit never acted, so nothing is proven"

    def test_is_part_of_the_problem(self, mast, rng):
        """The plan knows it: condensed and in cvxpy, with limits from below and above acting."""
        controller = tc.MPC(mast[2], horizon=6, tension_min=0.0, u_max=0.0004)
        problem, limits, qp = controller.statement(0.0, shown(mast, rng, 0.002))
        found = DaqpSolver(qp).solve(qp)
        cost, inputs = reference_optimum(problem, limits)
        plan = found.z.reshape(6, -1)
        assert qp.objective(found.z) + problem.constant(limits.start) == pytest.approx(cost, rel=1e-7)
        assert np.abs(plan[0] - inputs[0]).max() < 1e-7
        assert (plan.max(), plan.min()) == pytest.approx((0.0004, -0.0004), abs=1e-12)

    def test_a_floor_below_which_tendons_push_is_refused(self, mast):
        dynamics, rest, linear = mast
        with pytest.raises(
            tc.SynthesisError,
            match=r"tension_min is -1.0; expected a finite number >= 0 .N; below 0 a tendon would push",
        ):
            tc.MPC(linear, horizon=2, tension_min=-1.0)
        with pytest.raises(
            tc.SynthesisError,
            match=r"tension_min is -1.0; expected a finite number >= 0 .N; below 0 a tendon would push",
        ):
            tc.NonlinearMPC(dynamics, rest, horizon=2, tension_min=-1.0)

    def test_of_a_motor_each_tendon_keeps_its_own(self):
        gangs = {"top": {"t6_*": 1.0, "t5_1_1": -2.0}}
        _, _, linear = solved(shell_scene(**MAST, actuators={"gangs": gangs}))
        controller = tc.MPC(linear, horizon=2, u_max={"*": 0.1, "t5_1_1": 0.05})
        lower, upper = controller.hard.range
        place = linear.inputs.index("u_top")
        assert (lower[place], upper[place]) == (-0.025, 0.025)

    def test_a_path_that_needs_more_is_refused(self, mast):
        path = tc.plan_shape(shell_scene(**MAST), {"height_scale": 1.05})
        with pytest.raises(tc.SynthesisError, match=r"planned shape \d needs u_t\w+ = .* raise u_max"):
            tc.MPC(mast[2], horizon=2, path=path, u_max=0.001)

    @pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan])
    def test_refused(self, mast, wrong):
        with pytest.raises(tc.TensctlError, match="u_max is"):
            tc.MPC(mast[2], horizon=2, u_max=wrong)


def shown(case, rng, reach=0.02):
    """A random disturbance as the controller sees it."""
    rest = case[1]
    nodes = rest.potential.manifold.retract(rest.nodes, reach * rng.standard_normal(21))
    return tc.Measurement(nodes, 0 * nodes, rest.lengths, rest.tensions, rest.inputs)


class TestScene:
    def test_weights_are_those_of_lqr(self, mast):
        """The same keys mean the same cost: x'Q x + 2 x'N u + u'R u of [lqr] is that of a stage."""
        from tensctl.pipeline.feedback import cost_of
        from tensctl.scene import LqrStage, MpcStage
        from tensctl.synthesis.condensed import stage_weights

        linear = mast[2].flexible
        continuous = cost_of(LqrStage(**SIZES), linear)
        Q, R = stage_weights(linear, 1.0, mpc_weights(MpcStage(**SIZES), mast[0].structure))
        Q[42:, 42:] += R
        assert np.abs(Q - continuous.matrix).max() < 1e-12 * np.abs(Q).max()

    def test_from_a_scene_to_its_report(self, tmp_path):
        push = {"node": "P4_1_1", "force": [8.0, 0.0, 0.0], "from": 0.05, "to": 0.15}
        asked = {"horizon": 5, "u_max": {"*": 0.01}, "solver": "daqp"} | SIZES
        simulation = {"t_end": 0.4, "controller": "mpc", "push": [push]}
        scene = shell_scene(**MAST, mpc=asked, simulation=simulation, report={})
        assert tc.load_scene(written(tmp_path, scene)) == scene
        results = tc.run(scene, tmp_path / "out")
        summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["mpc"]
        assert summary["hard_limit_violations"] == 0
        assert summary["largest_share_of_u_max"] == pytest.approx(1.0, abs=1e-9)
        assert np.abs(results.run.inputs).max() == pytest.approx(0.01, abs=1e-11)
        report = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
        assert "energy of motion, nodes, tensions, rest lengths by size" in report
        assert "of what it may" in report

    def test_outputs_follow_their_courses(self, tmp_path):
        """A node goes aside and a tension up, and the report says how far they were off."""
        courses = [
            {"output": "P4_1_1_x", "size": 0.001, "times": [0.1, 0.4, 0.7], "change": [0.0, 0.01, 0.0]},
            {"output": "T_t5_1_1", "size": 0.01, "times": [0.1, 0.4], "change": [0.0, 1.0]},
        ]
        scene = shell_scene(
            **MAST, mpc={"horizon": 10, "follow": courses}, simulation={"t_end": 1.2, "controller": "mpc"}, report={}
        )
        assert tc.load_scene(written(tmp_path, scene)) == scene
        results = tc.run(scene, tmp_path / "out")
        summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["mpc"]
        assert summary["followed"].keys() == {"P4_1_1_x", "T_t5_1_1"}
        structure, run = results.structure, results.run
        x = run.nodes[:, structure.node_labels.index("P4_1_1"), 0]
        tension = run.tensions[:, structure.tendon_labels.index("t5_1_1")]
        missed = x - x[0] - np.interp(run.time, [0.1, 0.4, 0.7], [0.0, 0.01, 0.0])
        assert summary["followed"]["P4_1_1_x"]["worst"] == pytest.approx(np.abs(missed).max(), rel=1e-6)
        assert np.abs(missed).max() < 1e-3
        assert tension[-1] - tension[0] == pytest.approx(1.0, abs=0.02)
        assert "P4_1_1_x follows" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")

    @pytest.mark.parametrize(
        ("key", "value", "sentence"),
        [
            ("follow", [COURSE | {"change": [0.0]}], r"mpc.follow.*change is .* one number for each of 2 times"),
            ("follow", [COURSE | {"size": 0.0}], "size is 0"),
            ("preview", 1, "mpc.preview is 1"),
            ("u_max", -0.1, "mpc.u_max is -0.1; expected .* > 0"),
            ("nodes", 0, "mpc.nodes is 0"),
            ("u_mx", 0.1, "did you mean u_max"),
            ("stabilisable_only", True, "mpc.stabilisable_only is no key"),
        ],
    )
    def test_refused(self, key, value, sentence):
        with pytest.raises(tc.SceneError, match=sentence):
            shell_scene(mpc={key: value})


def written(folder, scene):
    path = folder / "scene.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    return path


class TestLabels:
    """What [mpc] names is there before anything is computed."""

    @pytest.mark.parametrize(
        ("asked", "sentence"),
        [
            (
                {"follow": [COURSE | {"output": "P9_1_1_x"}]},
                'mpc.follow[0].output is "P9_1_1_x"; expected the label of',
            ),
            ({"feedback": "outputs", "track": ["q_*"]}, 'mpc.track: "q_*" names nothing in this structure'),
            ({"u_max": {"q_*": 0.1}}, 'mpc.u_max: "q_*" names nothing in this structure'),
            ({"rest_lengths": {"q_*": 0.1}}, 'mpc.rest_lengths: "q_*" names nothing in this structure'),
            ({"nodes": {"q_*": 0.1}}, 'mpc.nodes: "q_*" names nothing in this structure'),
            ({"delay": 0.03}, "mpc.delay is 0.03 s; a time from 0 to dt = 0.02 s is expected"),
        ],
    )
    def test_check_and_run_refuse_what_names_nothing(self, tmp_path, capsys, asked, sentence):
        target = {"height_scale": 1.05}
        scene = shell_scene(**MAST, sensors={"lengths": 1e-4}, mpc=asked, target=target)
        path = written(tmp_path, scene)
        for command in ("check", "explain"):
            assert main([command, str(path)]) == 2
            assert sentence in capsys.readouterr().err
        with pytest.raises(tc.TensctlError, match=re.escape(sentence)):
            tc.run(scene, tmp_path / "out")

    def test_times_that_descend_are_no_course(self):
        with pytest.raises(tc.SceneError, match=r"mpc.follow\[0\].times is \[1.0, 0.0\]; expected times that ascend"):
            shell_scene(**MAST, mpc={"follow": [COURSE | {"times": [1.0, 0.0]}]})

    def test_a_followed_output_has_its_own_size(self, mast):
        """Its node's other coordinates keep theirs, and so do other tensions."""
        from tensctl.scene import MpcStage

        tension = COURSE | {"output": "T_t5_1_1", "size": 0.01}
        asked = MpcStage(nodes={"P4_1_1": 0.05}, tensions={"t5_*": 2.0}, follow=[COURSE, tension])
        weighed = mpc_weights(asked, mast[0].structure).of_outputs(mast[2])
        sizes = dict(zip(weighed.linear.outputs, weighed.sizes.tolist(), strict=True))
        assert {k: v for k, v in sizes.items() if k.startswith("P")} == {
            "P4_1_1_x": 0.001, "P4_1_1_y": 0.05, "P4_1_1_z": 0.05,
        }  # fmt: skip
        tensions = {k: v for k, v in sizes.items() if k.startswith("T")}
        assert tensions.pop("T_t5_1_1") == 0.01
        assert len(tensions) == 2
        assert set(tensions.values()) == {2.0}
