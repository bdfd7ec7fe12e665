"""Paths of structures whose rods meet in joints: charts that interpolate, a class 2 shell that deploys."""

from pathlib import Path

import numpy as np
import pytest
from support import random_motion, shell_scene

import tensctl as tc
from tensctl.elements import Potential

EXAMPLE = Path(__file__).parents[1] / "examples" / "class2_deploys.toml"


@pytest.fixture(scope="module")
def path():
    return tc.plan_shape(tc.load_scene(EXAMPLE))


@pytest.mark.parametrize("scene", [shell_scene(3, 2, cls=2), shell_scene(3, 2, cls=2, pins=["P1_*_1"]), shell_scene()])
def test_charts_come_back(scene):
    """Rods' own coordinates of nodes far away lead to those nodes, joints or not."""
    potential = Potential.of(scene)
    manifold, reference = potential.manifold, potential.structure.nodes
    nodes, _ = random_motion(potential, np.random.default_rng(2), reach=0.3)
    assert np.abs(nodes - reference).max() > 0.1
    back = manifold.retraction(reference)(manifold.untied(reference, nodes))
    assert np.abs(back - nodes).max() < 1e-13


def test_deploys_to_more_than_twice_its_height(path):
    first, last = (feature.of(e.nodes) for feature in path.features for e in (path.equilibria[0], path.target))
    assert last == pytest.approx(2.2 * first, rel=1e-10)
    path.verify(0.1)
    assert (path.equilibria[0].tensions[~path.target.structure.grounded_tendons] > 0.1).all()


def test_the_reference_meets_the_planned_shapes(path):
    """Exactly at each, with rods of their lengths between them: joints share nodes, so they are closed."""
    structure = path.target.structure
    for k, equilibrium in enumerate(path.equilibria):
        assert np.abs(path.nodes_of(k) - equilibrium.nodes).max() < 1e-12
    for place in (0.5, 3.3, 7.7):
        ends = path.nodes_of(place)[structure.rods]
        assert np.abs(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / structure.rod_lengths - 1).max() < 1e-13


def test_spline_between_shapes_is_nearly_balanced(path):
    potential, members = path.target.potential, path.target.potential.members
    for t in 0.5 * (path.time[1:] + path.time[:-1]):
        rest = members.rest_lengths.copy()
        rest[members.inputs] -= path.balanced_inputs_at(t)
        assert np.abs(potential.at(path.nodes_at(t), rest).gradient).max() < 0.05


def test_predictive_control_follows(tmp_path):
    """A short way, cut short for the test: joints and all, the run ends where it should."""
    scene = tc.load_scene(EXAMPLE).replaced(
        target={"height_scale": 1.1, "duration": 1.0}, simulation={"t_end": 1.2, "controller": "mpc"}, report=None
    )
    results = tc.run(scene, out=tmp_path)
    assert results.shape_error[0] > 0.1
    assert results.shape_error[-1] < 2e-4
    assert results.run.relaxed.max() == 0.0
    assert not results.sanity.warnings
