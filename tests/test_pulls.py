"""The splitting's tendon forces in three sweeps against the gradient of the potential."""

from __future__ import annotations

import numpy as np
import pytest
from support import MIXED_PINS, network_scene, random_motion, shell_scene

import tensctl as tc
from tensctl.elements import Potential
from tensctl.simulation.integrators.pulls import tendon_forces
from tensctl.simulation.integrators.rows import rows_of

HALF_SLACK = {"rest_ratio": 1.0}
TIED = {"a": [0, 0, 0], "b": [1, 0, 0], "g": [2, 0, 0], "h": [0, 1, 0], "i": [0, -1, 0]}
SCENES = {
    "shell": shell_scene(tendons=HALF_SLACK),
    "pins of all kinds": shell_scene(pins=list(MIXED_PINS), tendons={"EA": 300.0} | HALF_SLACK),
    "(4,2)": shell_scene(4, 2, tendons=HALF_SLACK),
    "ties to the ground": network_scene(
        TIED,
        {"rod": ["a", "b"]},
        {"t1": ["b", "g"], "t2": ["h", "a"], "t3": ["i", "a"], "t4": ["b", "h"]},
        ["g", "h", "i"],
        tendons=HALF_SLACK,
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_forces_are_those_of_the_potential(name):
    potential = Potential.of(SCENES[name])
    dynamics, rng = tc.build_dynamics(SCENES[name]), np.random.default_rng(3)
    rows, count = rows_of(dynamics), len(potential.structure.tendons)
    nodes, _ = random_motion(potential, rng)
    load = rng.standard_normal(nodes.shape)
    members = potential.members
    spring = members.stiffness / members.rest_lengths if members.law == "EA" else members.stiffness
    force, gap, span = np.zeros(rows.size), np.zeros(count), np.zeros(3 * count)
    tendon_forces(rows, rows.nodal(nodes), members.rest_lengths, spring, 0.0, rows.nodal(load), span, force, gap)
    point = potential.at(nodes)
    wanted = load - point.terms.gradient
    found = np.column_stack([force[rows.where + i * rows.row] for i in range(3)])
    ends = np.unique(potential.structure.rods)
    assert 0 < (gap < 0).sum() < count
    assert np.allclose(found[ends], wanted[ends], rtol=0, atol=1e-13 * np.abs(wanted).max())
    lengths = np.linalg.norm(np.diff(nodes[potential.structure.tendons], axis=1)[:, 0], axis=1)
    assert np.allclose(gap, lengths - members.rest_lengths, rtol=0, atol=1e-15 * lengths.max())
