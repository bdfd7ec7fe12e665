"""Losing a tendon or its motor: the same as a structure that never had it, and one of an orbit stands for all."""

import numpy as np
import pytest
from support import pendulum_scene, prism_scene, shell_scene, solved

import tensctl as tc
from tensctl.analysis import redundancy
from tensctl.analysis.losses import orbits, without
from tensctl.analysis.reach import Reach


@pytest.fixture(scope="module")
def lost(mast):
    return redundancy(mast[2])


def test_one_of_an_orbit_stands_for_all(mast, lost, monkeypatch):
    import tensctl.analysis.losses as module

    monkeypatch.setattr(module, "find_symmetry", lambda *_, **__: None)
    alone = {loss.tendons[0]: loss for loss in redundancy(mast[2]).losses}
    assert len(alone) == 21
    assert len(lost.losses) == 7
    for loss in lost.losses:
        for label in loss.tendons:
            other = alone[label]
            assert (other.rest, other.slack, other.driven_cut, other.held_cut) == (
                loss.rest, loss.slack, loss.driven_cut, loss.held_cut,
            )  # fmt: skip
            assert (other.driven_jammed, other.held_jammed) == (loss.driven_jammed, loss.held_jammed)
            assert other.moved == pytest.approx(loss.moved, rel=1e-6)
            assert other.frequency == pytest.approx(loss.frequency, rel=1e-6)


@pytest.mark.parametrize("label", ["t3_1_1", "t7_1_1"])
def test_a_cut_tendon_is_one_that_never_was(mast, lost, label):
    """A network built without it, started from the same nodes, rests there too."""
    _, rest, linear = mast
    recipe = rest.structure.as_recipe()
    lengths = dict(zip(rest.structure.tendon_labels, rest.rest_lengths.tolist(), strict=True))
    del recipe["tendons"][label], lengths[label]
    other = tc.find_equilibrium(tc.Scene(structure=recipe, tendons={"rest_length": lengths}), start=rest.nodes)
    found = without(linear, rest.structure.tendon_labels.index(label))
    assert np.abs(found.nodes - other.nodes).max() < 1e-8
    found.verify()
    loss = next(loss for loss in lost.losses if label in loss.tendons)
    assert loss.moved == pytest.approx(np.linalg.norm(other.nodes - rest.nodes, axis=1).max(), rel=1e-6)
    assert loss.frequency == pytest.approx(np.sqrt(other.omega2[0]) / (2 * np.pi), rel=1e-6)
    assert loss.rest == "stable"


@pytest.mark.parametrize("label", ["t3_1_1", "t7_1_1"])
def test_a_jammed_motor_is_a_tendon_without_one(lost, label):
    scene = shell_scene(pins=["P1_*_1"])
    others = [name for name in tc.build_structure(scene).tendon_labels if name != label]
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": others}))
    loss = next(loss for loss in lost.losses if label in loss.tendons)
    assert loss.driven_jammed == (len(tc.controllability(linear).controllable_modes), 21)
    assert loss.held_jammed == Reach(linear).rank


def test_the_only_motor():
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": ["t5_1_1"]}))
    assert len(orbits(linear)) == 21  # one motor is no symmetric set of motors
    table = {loss.tendons[0]: loss for loss in redundancy(linear).losses}
    assert table["t5_1_1"].held_jammed == 0
    assert table["t5_1_1"].worst[1] == 0
    assert table["t3_1_1"].driven_jammed == (14, 21)
    assert table["t3_1_1"].note == "no actuator"


def test_gangs_jam_as_one_and_move_as_one():
    """Two tendons on one motor: what one loses the other loses too, and a move pulls both by their ratios."""
    gangs = {"pair": {"t5_1_1": 1.0, "t5_2_1": -0.5}}
    _, rest, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"gangs": gangs}))
    table = {loss.tendons[0]: loss for loss in redundancy(linear).losses}
    assert len(table) == 21
    assert table["t5_1_1"].held_jammed == table["t5_2_1"].held_jammed
    others = [label for label in rest.structure.tendon_labels if label not in ("t5_1_1", "t5_2_1")]
    _, _, left = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": others}))
    assert table["t5_1_1"].held_jammed == Reach(left).rank
    found = tc.move(linear, "P4_1_1", (1e-3, 0, 0))
    found.verify()
    assert found.bend < 1e-5
    assert "pair" in dict(found.tendons)


def test_a_vital_tendon():
    """A pendulum's only tie."""
    _, _, linear = solved(pendulum_scene(head=(0.0, 0.0, 1.0), anchor=(0.0, 0.0, 3.0)))
    found = redundancy(linear)
    assert found.vital == ("tie",)
    assert "tie" in str(found)


def test_from_a_scene(tmp_path):
    scene = prism_scene(pins=["a*"], controllability={"redundancy": True}, linearize={"outputs": ["nodes"]}, report={})
    results = tc.run(scene, tmp_path / "out")
    assert results.study is not None
    assert results.study.redundancy is not None
    assert len(results.study.redundancy.losses) == 2
    assert "Without one tendon" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "what is lost without a tendon" in str(results.study)
    assert "redundancy = false" in prism_scene(controllability={}).to_toml()


def test_a_square_needs_all_its_sides():
    """Two crossed rods in the plane: any side away, and nothing is taut any more."""
    recipe = {
        "kind": "planar",
        "nodes": {"a": [0, 0], "b": [1, 0], "c": [0, 1], "d": [1, 1]},
        "rods": {"r": ["a", "d"], "s": ["b", "c"]},
        "tendons": {"ab": ["a", "b"], "bd": ["b", "d"], "dc": ["d", "c"], "ca": ["c", "a"]},
    }
    found = redundancy(solved(tc.Scene(structure=recipe))[2])
    assert found.vital == ("ab", "bd", "dc", "ca")
    assert {(loss.rest, loss.slack) for loss in found.losses} == {("nothing taut", 3)}
