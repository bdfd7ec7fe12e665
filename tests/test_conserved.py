"""Momenta of a structure on which nothing acts: what rounding takes is given back, and nothing else is changed."""

from __future__ import annotations

import numpy as np
import pytest
from support import MIXED_PINS, network_scene, random_motion, shell_scene

import tensctl as tc
from tensctl.elements import Potential
from tensctl.simulation import momenta
from tensctl.simulation.integrators.conserved import alone, give_back, momenta_of
from tensctl.simulation.integrators.leap import moment
from tensctl.simulation.integrators.rows import fill, rows_of, take

SHELLS = pytest.mark.parametrize(
    "scene",
    [shell_scene(), shell_scene(3, 2, rods={"mass": {"*": 1.0, "r1_1_1": 50.0, "r2_1_2": 0.02}})],
    ids=["3_1", "3_2, masses apart"],
)


class Sides:
    """A structure's momenta by matrices over rates (q1', q2') of all its rods, and by the kernels."""

    def __init__(self, scene, seed=0):
        self.dynamics = tc.build_dynamics(scene)
        self.rows, self.now = rows_of(self.dynamics), moment(rows_of(self.dynamics))
        nodes, velocities = random_motion(Potential.of(scene), np.random.default_rng(seed))
        self.q, self.v = self.dynamics.rod_coordinates(nodes), self.dynamics.rod_coordinates(velocities)

    def mass(self):
        """Diagonal of the mass matrix: m/4 for q1', m/12 for q2'."""
        m = self.dynamics.members.mass
        return np.repeat(np.column_stack([m / 4, m / 12]), 3, axis=1).ravel()

    def momenta(self):
        """(6, 6 rods) matrix that takes rates to p and l about the mass centre."""
        m = self.dynamics.members.mass
        centres = self.q[:, :3] / 2
        centre = m @ centres / m.sum()
        blocks = []
        for k in range(len(m)):
            about, along = centres[k] - centre, self.q[k, 3:]
            top = np.hstack([m[k] / 2 * np.eye(3), np.zeros((3, 3))])
            blocks.append(np.vstack([top, np.hstack([m[k] / 2 * crossing(about), m[k] / 12 * crossing(along)])]))
        return np.hstack(blocks)

    def after(self, v, wanted):
        """Rates to which `give_back` changes v."""
        fill(self.rows, self.q, self.now.q)
        fill(self.rows, v, self.now.v)
        give_back(self.rows, self.now.q, self.now.v, tuple(wanted))
        found = np.zeros_like(v)
        take(self.rows, self.now.v, found)
        return found


def crossing(a):
    """a x as a matrix."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


@SHELLS
def test_momenta_are_those_of_the_matrices(scene):
    sides = Sides(scene)
    wanted = sides.momenta() @ sides.v.ravel()
    fill(sides.rows, sides.q, sides.now.q)
    fill(sides.rows, sides.v, sides.now.v)
    found = momenta_of(sides.rows, sides.now.q, sides.now.v)
    assert np.allclose(found, wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())


@SHELLS
def test_what_is_given_back_has_the_least_kinetic_energy(scene):
    """The rates dv of least dv' M dv with H dv = d are M^-1 H' (H M^-1 H')^-1 d; rigid-body rates are among them."""
    sides = Sides(scene)
    lost = np.random.default_rng(1).standard_normal(6)
    H, M = sides.momenta(), sides.mass()
    least = (H.T / M[:, None]) @ np.linalg.solve((H / M) @ H.T, lost)
    found = sides.after(sides.v, H @ sides.v.ravel() + lost)
    assert np.allclose((found - sides.v).ravel(), least, rtol=0, atol=1e-12 * np.abs(least).max())
    assert np.allclose(H @ found.ravel(), H @ sides.v.ravel() + lost, rtol=0, atol=1e-12 * np.abs(H @ M).max())
    along = np.einsum("ri,ri->r", (found - sides.v)[:, 3:], sides.q[:, 3:])
    assert np.abs(along).max() < 1e-14 * np.abs(found).max()


def test_rods_in_one_line_get_no_rate_about_it():
    """Their inertia has no inverse; the momentum is given back all the same."""
    nodes = {"a": [0, 0, 0], "b": [1, 0, 0], "c": [1.5, 0, 0], "d": [2.5, 0, 0]}
    sides = Sides(network_scene(nodes, {"r1": ["a", "b"], "r2": ["c", "d"]}, {"t1": ["b", "c"], "t2": ["a", "d"]}))
    sides.q = sides.dynamics.rod_coordinates(sides.dynamics.structure.nodes)
    sides.v[:] = 0
    found = sides.after(sides.v, [1.0, 2.0, 3.0, 1.0, 1.0, 1.0])
    p = sides.momenta()[:3] @ found.ravel()
    assert p == pytest.approx([1.0, 2.0, 3.0], abs=1e-14)
    assert not found[:, 3:].any()


@pytest.mark.parametrize(
    ("scene", "free"),
    [
        (shell_scene(), True),
        (shell_scene(pins=["P1_1_1"]), False),
        (shell_scene(pins=list(MIXED_PINS)), False),
        (
            network_scene(
                {"a": [0, 0, 0], "b": [1, 0, 0], "g": [2, 0, 0]}, {"r": ["a", "b"]}, {"t": ["b", "g"]}, ["g"]
            ),
            False,
        ),
    ],
    ids=["free", "one pin", "pins of all kinds", "tied to the ground"],
)
def test_alone(scene, free):
    rows = rows_of(tc.build_dynamics(scene))
    load = np.zeros(rows.size)
    assert alone(rows, load) == free
    load[1] = 1e-300
    assert not alone(rows, load)


def test_momenta_do_not_walk():
    """Of 2e5 steps: without giving back, 3e-14 to 8e-14 of the terms are lost."""
    scene = shell_scene()
    rest = tc.find_equilibrium(scene)
    kick = 0.05 * np.random.default_rng(1).standard_normal(rest.potential.manifold.size)
    dynamics, velocities = tc.build_dynamics(scene), (rest.point.tangent @ kick).reshape(-1, 3)
    mass = dynamics.members.mass
    velocities -= np.einsum("r,rni->i", mass, velocities[dynamics.structure.rods]) / (2 * mass.sum())
    run = tc.simulate(
        dynamics, (rest.nodes, velocities), timepts=np.linspace(0, 5e3, 11), tol=1e-6, method="splitting4"
    )
    assert run.evaluations > 1.5e6
    assert run.switches == 0
    size = mass.sum() * np.linalg.norm(velocities, axis=1).max()
    for momentum in momenta(dynamics, run):
        assert np.abs(momentum - momentum[0]).max() < 1e-14 * size
