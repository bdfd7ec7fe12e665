"""Scenes with joints, guides, planes and cables go through every stage, from the file to the report."""

import json

import numpy as np
import pytest

import tensctl as tc

STAGES = """
[equilibrium]
[linearize]
[controllability]
[lqr]
[mpc]
horizon = 5
[simulation]
t_end = 0.4
controller = "CONTROLLER"
[[simulation.push]]
node = "NODE"
force = [1.0, 0.0, 0.0]
from = 0.1
to = 0.2
[report]
"""
CLASS_TWO = """
[structure]
kind = "shell"
n = 3
m = 2
class = 2
pins = { "P1_*_1" = "z", P1_1_1 = "xyz", P1_2_1 = "xz" }
"""
PLANE = """
[structure]
kind = "planar"
pins = { o = "y", l = "xy", g = "xy" }
nodes = { o = [0, 0], p = [0, 1], q = [0.9, 1.0], l = [-1, 0], g = [2, 0] }
rods = { lower = ["o", "p"], upper = ["p", "q"] }
tendons = { back = ["l", "p", "q"], lo = ["l", "o"], og = ["o", "g"], gp = ["g", "p"], gq = ["g", "q"] }
"""


@pytest.mark.parametrize(
    ("structure", "node", "controller", "modes"),
    [(CLASS_TWO, "P4_1_2", "lqr", 36), (PLANE, "q", "mpc", 3)],
    ids=["class 2 on guides", "plane"],
)
def test_all_stages(structure, node, controller, modes, tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(structure + STAGES.replace("CONTROLLER", controller).replace("NODE", node))
    scene = tc.load_scene(path)
    tc.run(scene, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    linear = tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene))
    assert len(linear.modes) == modes
    assert (tmp_path / "out" / "report.html").stat().st_size > 1e5
    assert summary["equilibrium"]["stable"] == "yes"
    run = tc.Run.load(tmp_path / "out" / "run.nc")
    held = linear.dynamics.structure.held
    assert np.abs(run.nodes - linear.dynamics.structure.nodes)[:, held].max() < 1e-12
