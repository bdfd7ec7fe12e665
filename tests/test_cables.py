"""Cables: tendons that run through several nodes with one tension."""

import json

import numpy as np
import pytest

import tensctl as tc
from tensctl.errors import StructureError
from tensctl.statics.algebra import Network
from tensctl.statics.prestress import cyclic_orbits, equilibrium_matrix, stress_matrix

NODES = {"a": [0, 0, 0], "b": [0, 0, 3], "c": [4, 0, 0], "d": [4, 0, 3]}
RODS = {"r": ["a", "b"], "s": ["c", "d"]}


def built(tendons, **parts):
    return tc.network(parts.get("nodes", NODES), parts.get("rods", RODS), tendons, parts.get("pins", ()))


def test_a_cable_is_as_long_as_its_segments():
    structure = built({"t": ["a", "c"], "loop": ["a", "b", "d", "c", "a"], "u": ["b", "c", "b", "d"]})
    assert structure.tendon_lengths.tolist() == [4, 14, 14]
    assert structure.segments[structure.segment_tendon == 1].tolist() == [[0, 1], [1, 3], [3, 2], [2, 0]]
    assert structure.has_cables
    assert structure.tendons.tolist() == [[0, 2], [0, 0], [1, 3]]
    moved = np.stack([structure.nodes, 2 * structure.nodes])
    assert structure.lengths_at(moved).tolist() == [[4, 14, 14], [8, 28, 28]]


def test_without_cables_segments_are_the_tendons():
    structure = tc.prism(3)
    assert structure.segments is structure.tendons
    assert not structure.has_cables
    assert structure.segment_tendon.tolist() == list(range(9))


def test_a_cable_is_on_the_ground_when_all_its_nodes_are():
    structure = built({"t": ["a", "b", "c"], "u": ["a", "d", "b"], "v": ["a", "b"]}, pins=["a", "b", "c"])
    assert structure.grounded_tendons.tolist() == [True, False, True]


def test_a_cable_goes_into_a_scene_and_back():
    structure = built({"t": ["a", "c", "d"], "u": ["a", "b", "d", "c", "a"], "v": ["b", "c"]})
    again = tc.build_structure(tc.Scene(structure=json.loads(json.dumps(structure.as_recipe()))))
    assert again.vias == structure.vias == ((2,), (1, 3, 2), ())
    assert again.paths == structure.paths


@pytest.mark.parametrize("room", [equilibrium_matrix, Network.of, cyclic_orbits, lambda s: stress_matrix(s, 1, 1)])
def test_rooms_for_tendons_of_two_nodes_refuse_cables(room):
    with pytest.raises(StructureError, match=r"^tendon t is a cable of 3 nodes, and .*; give .*\.$"):
        room(built({"v": ["b", "c"], "t": ["a", "c", "d"]}))
