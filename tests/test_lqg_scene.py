"""Scenes with sensors: what they ask for is designed, run, summarised and reported."""

import json

import numpy as np
import pytest
from support import shell_scene

import tensctl as tc

ASKED = {
    "lqr": {"dt": 0.02, "nodes": {"P4_*": 0.01}},
    "sensors": {"lengths": 1e-3, "tensions": {"t5_*": 0.05}, "seed": 3},
    "lqg": {"order": 30},
    "simulation": {"t_end": 5.0, "controller": "lqg", "push": [
        {"node": "P4_1_1", "force": [2.0, 0.0, 0.0], "from": 0.2, "to": 0.3}
    ]},
    "report": {},
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("lqg") / "out"
    tc.run(shell_scene(pins=["P1_*_1"], **ASKED), out)
    return out


def test_summary(folder):
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert found["lqg"]["states"] == 30
    assert found["lqg"]["measured"] == 27
    assert found["lqg"]["slowest_pole"] < 0
    assert found["lqg"]["filter_riccati_residual"] < 1e-9
    assert found["lqr"]["sample_time_s"] == 0.02
    for name in ("lqr", "lqg"):
        for margin in ("disk_margin", "disk_margin_of_one_input"):
            alpha, most = found[name][margin], found[name][f"{margin}_at_most"]
            assert 0 < alpha <= most < alpha * (1 + 1e-5)
            assert found[name][f"{margin}_gain"][1] == pytest.approx((2 + alpha) / (2 - alpha))
        assert found[name]["disk_margin"] < found[name]["disk_margin_of_one_input"]
        assert found[name]["weakest_input"].startswith("t")
    assert found["simulation"]["final_shape_error_m"] < found["simulation"]["largest_shape_error_m"] / 2


def test_report_says_what_was_checked(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    for words in ("<h3>LQG</h3>", "Node motion from sensor noise", "30 of 42", "Poles with and without LQG"):
        assert words in page
    assert "LQG: residual of the loop" in page


def test_gains_that_are_hardly_known_are_told(folder, tmp_path):
    """One motor, one sensor and a symmetry broken by 1e-6: residuals are at rounding, the filter's gain is not."""
    assert "known only to" not in (folder / "report.html").read_text(encoding="utf-8")
    scene = tc.Scene(
        structure={"kind": "prism", "n": 3, "pins": ["a*"]},
        tendons={"stiffness": {"*": 100.0, "top2": 100.0 * (1 + 1e-6)}},
        actuators={"tendons": ["side1"]},
        sensors={"lengths": {"side1": 1e-3}},
        lqg={"stabilisable_only": True},
        report={},
    )
    tc.run(scene, tmp_path / "out")
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["lqg"]
    assert found["filter_riccati_residual"] < 1e-9
    assert found["filter_gain_doubt"] > 1e-3
    assert "known only to" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_spelled_scene_is_the_same():
    scene = shell_scene(pins=["P1_*_1"], **ASKED)
    text = scene.to_toml()
    assert "order = 30" in text
    assert "[sensors]" in text


def test_sizes_and_weights_add_up(mast):
    from tensctl.pipeline.feedback import cost_of

    linear = mast[2]
    asked = shell_scene(lqr={"energy_weight": 2.0, "tensions": 0.5}).lqr
    cost, sized = cost_of(asked, linear), tc.weights(linear, tensions=0.5, rest_lengths=1.0)
    assert np.abs(cost.Q - sized.Q - 2 * np.eye(42)).max() < 1e-12 * np.abs(cost.Q).max()
    assert np.abs(cost.R - sized.R - 99 * np.eye(21)).max() < 1e-12 * np.abs(cost.R).max()
    assert np.abs(cost.N - sized.N).max() == 0


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        ({"lqg": {}}, r"lqg is there, but nothing is measured; expected a section \[sensors\]"),
        ({"sensors": {}}, "sensors measures nothing; expected lengths, tensions or nodes"),
        ({"sensors": {"lengths": 0.0}}, "sensors.lengths is 0.0; expected a finite number > 0"),
        ({"sensors": {"lengths": 1e-3}, "lqg": {"order": 0}}, "lqg.order is 0; expected a whole number >= 1"),
        ({"simulation": {"t_end": 1, "controller": "lqg"}}, r"expected a section \[lqg\]"),
    ],
)
def test_refused(sections, sentence):
    with pytest.raises(tc.SceneError, match=sentence):
        shell_scene(**sections)
