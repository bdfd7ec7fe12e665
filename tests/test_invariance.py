"""Nothing depends on where a structure stands, how it is turned, or in which order and by which names it is told."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import mast_scene, rotation, shell_scene

import tensctl as tc
from tensctl.statics import tension_influence

PLANE = tc.planar(
    {"o": [0, 0], "p": [0, 1], "q": [0.9, 1.0], "l": [-1, 0], "g": [2, 0]},
    {"lower": ["o", "p"], "upper": ["p", "q"]},
    {"back": ["l", "p", "q"], "lo": ["l", "o"], "og": ["o", "g"], "gp": ["g", "p"], "gq": ["g", "q"]},
    {"o": "y", "l": "xy", "g": "xy"},
)
SCENES = {
    "joints": shell_scene(3, 2, cls=2),
    "joints and guides": shell_scene(3, 2, cls=2, pins={"P1_1_1": "z", "P2_1_1": "x", "P4_1_1": "xyz"}),
    "cables": mast_scene(["P1_*_1"]),
    "plane, joint, guide, cable": tc.Scene(structure=PLANE),
}
# Structures that keep what they are when they are turned about z by any angle.
TURNED = {"joints": SCENES["joints"], "cables": SCENES["cables"], "guides": shell_scene(pins={"P1_*_1": "z"})}


def facts(rest):
    """Numbers by label that no change of view may touch; influences tell of stiffness and inputs."""
    tensions = dict(zip(rest.structure.tendon_labels, rest.tensions, strict=True))
    forces = dict(zip(rest.structure.rod_labels, rest.rod_forces, strict=True))
    labels = [rest.structure.tendon_labels[t] for t in rest.potential.members.inputs]
    influence = {
        (row, column): value
        for row, values in zip(rest.structure.tendon_labels, tension_influence(rest), strict=True)
        for column, value in zip(labels, values, strict=True)
    }
    return rest.energy, rest.omega2, tensions, forces, influence


def assert_same(one, other):
    (energy, omega2, *tables), (energy_, omega2_, *tables_) = facts(one), facts(other)
    assert energy_ == pytest.approx(energy, rel=1e-10)
    assert omega2_ == pytest.approx(omega2, rel=1e-8, abs=1e-9 * omega2.max())
    for table, table_ in zip(tables, tables_, strict=True):
        assert table_ == pytest.approx(table, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("name", SCENES)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_order_of_what_is_told(name, seed):
    """Nodes, rods and tendons in another order, members told from head to tail."""
    scene, rng = SCENES[name], np.random.default_rng(seed)
    recipe = tc.build_structure(scene).as_recipe()
    told = dict(recipe)
    for key in ("nodes", "rods", "tendons"):
        items = list(recipe[key].items())
        told[key] = dict(items[k] for k in rng.permutation(len(items)))
        if key != "nodes":
            told[key] = {label: way[:: rng.choice([1, -1])] for label, way in told[key].items()}
    again = scene.replaced(structure=told)
    assert_same(tc.find_equilibrium(scene.replaced(structure=recipe)), tc.find_equilibrium(again))


@pytest.mark.parametrize("name", TURNED)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_where_it_stands(name, seed):
    """Moved anywhere, and turned: about z where z is guided, any way otherwise."""
    scene, rng = TURNED[name], np.random.default_rng(seed)
    structure = tc.build_structure(scene)
    angle = rng.uniform(0, 2 * np.pi)
    about_z = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    shift = rng.uniform(-2, 2, 3)
    turn = about_z if structure.has_guides else rotation(rng)
    recipe = structure.as_recipe()
    moved = {label: turn @ place + shift for label, place in recipe["nodes"].items()}
    again = scene.replaced(structure=recipe | {"nodes": moved})
    assert_same(tc.find_equilibrium(scene.replaced(structure=recipe)), tc.find_equilibrium(again))
