"""The rods' manifold: exact charts, exact tangents, and the Hessian that Newton and modes rely on."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import MIXED_PINS, random_motion, shell_scene, taylor_order

import tensctl as tc
from tensctl.elements import Hold, Potential

PINS = {"free": (), "mixed": MIXED_PINS}
STEPS = np.array([1e-1, 3e-2, 1e-2, 3e-3])


@pytest.fixture(scope="module", params=PINS)
def potential(request):
    loads = {"P4_2_1": [0.3, -0.2, 0.7], "P2_1_1": [1.0, 0.5, 0.0]}
    return Potential.of(shell_scene(pins=PINS[request.param], loads=loads))


@pytest.fixture
def reference(potential, rng):
    return random_motion(potential, rng)[0]


def rod_lengths(potential, nodes):
    ends = nodes[potential.structure.rods]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def tangent_step(potential, seed):
    return np.random.default_rng(seed).standard_normal(potential.manifold.size)


def test_degrees_of_freedom():
    free = Potential.of(shell_scene()).manifold
    mixed = Potential.of(shell_scene(pins=MIXED_PINS)).manifold
    assert free.size == 10 * 3 * 1
    assert mixed.hold.tolist() == [Hold.TAIL, Hold.FREE, Hold.HEAD, Hold.FREE, Hold.FREE, Hold.FIXED]
    assert mixed.size == 3 * 5 + 2 * 2


@given(seed=st.integers(0, 10**6), reach=st.floats(1e-8, 0.5))
def test_logarithm_undoes_retract(seed, reach):
    """Steps of up to 0.5 m on rods of 1.63 m: far from small, less than half a turn."""
    potential = Potential.of(shell_scene(pins=MIXED_PINS))
    manifold, nodes = potential.manifold, potential.structure.nodes
    step = np.clip(reach * tangent_step(potential, seed), -1, 1)
    moved = manifold.retract(nodes, step)
    assert np.abs(manifold.logarithm(nodes, moved) - step).max() < 1e-14 + 1e-13 * np.abs(step).max()
    assert np.abs(manifold.retract(nodes, manifold.logarithm(nodes, moved)) - moved).max() < 1e-14


def joined_and_planar():
    """A class 2 shell, whose rods share nodes, and a cross in its plane."""
    cross = tc.planar(
        {"a": [0, 0], "b": [1, 1], "c": [1, 0], "d": [0, 1]}, {"one": ["a", "b"], "two": ["c", "d"]}, {"t": ["a", "c"]}
    )
    return {
        "joined": shell_scene(3, 2, cls=2),
        "planar": tc.Scene(structure=cross),
        "mixed": shell_scene(pins=MIXED_PINS),
    }


@pytest.mark.parametrize("kind", ["joined", "planar", "mixed"])
@pytest.mark.parametrize("reach", [0.0, 1e-9, 0.1])
def test_a_compiled_retraction_is_retract(kind, reach):
    """Two statements of one chart, compiled and not, agree to rounding."""
    potential = Potential.of(joined_and_planar()[kind])
    manifold, nodes = potential.manifold, potential.structure.nodes
    step = reach * tangent_step(potential, 3)
    own = manifold.basis(nodes) @ step if kind == "joined" else step
    assert np.abs(manifold.retraction(nodes)(own) - manifold.retract(nodes, step)).max() < 1e-14


def test_a_chart_at_hand_tells_what_logarithm_and_velocity_tell(potential, reference, rng):
    manifold = potential.manifold
    nodes, velocities = (
        manifold.retract(reference, 0.1 * rng.standard_normal(manifold.size)),
        random_motion(potential, rng)[1],
    )
    xi, rate = manifold.chart(reference).at(nodes, velocities)
    assert (xi == manifold.logarithm(reference, nodes)).all()
    assert (rate == manifold.velocity(reference, nodes, velocities)).all()


def test_rods_keep_their_lengths_and_pins_their_places(potential):
    manifold, structure = potential.manifold, potential.structure
    nodes = structure.nodes
    for seed in range(200):
        nodes = manifold.retract(nodes, 0.3 * tangent_step(potential, seed))
    assert np.abs(rod_lengths(potential, nodes) / structure.rod_lengths - 1).max() < 1e-15 * 8
    assert (nodes[structure.pinned] == structure.nodes[structure.pinned]).all()


def test_tangent_is_the_derivative_of_retract(potential, reference):
    manifold, s = potential.manifold, tangent_step(potential, 1)
    moved = (manifold.tangent(reference) @ s).reshape(-1, 3)
    order = taylor_order(lambda h: manifold.retract(reference, h * s) - reference - h * moved, STEPS)
    assert 1.95 < order < 2.05


def test_bend_of_retract(potential, reference):
    """To second order nodes move by J xi - |tau|^2/(2 rho) s e, along each rod."""
    manifold, s = potential.manifold, tangent_step(potential, 2)
    straight = (manifold.tangent(reference) @ s).reshape(-1, 3)
    turning = np.zeros(len(manifold.rods))
    turning[manifold.moving] = (s[manifold.direction_columns] ** 2).sum(axis=1)
    bend = np.zeros_like(reference)
    for side in (0, 1):
        size = -turning / (2 * manifold.lever) * manifold.sign[:, side]
        bend[manifold.rods[:, side]] = size[:, None] * manifold.directions(reference)
    order = taylor_order(lambda h: manifold.retract(reference, h * s) - reference - h * straight - h**2 * bend, STEPS)
    assert 2.95 < order < 3.05


def test_frames_are_square_to_the_rods(potential, reference):
    manifold = potential.manifold
    triads = np.concatenate([manifold.directions(reference)[:, None], manifold.frames(reference)], axis=1)
    gram = triads @ triads.transpose(0, 2, 1)
    assert np.abs(gram - np.eye(3)).max() < 1e-15 * 4


@pytest.mark.parametrize("reach", [0.0, 0.2], ids=["at the reference", "away from it"])
def test_velocity_is_the_rate_of_the_logarithm(potential, reference, rng, reach):
    """Central differences of the logarithm along a motion approach it with order 2."""
    manifold = potential.manifold
    nodes = manifold.retract(reference, reach * rng.standard_normal(manifold.size))
    s = rng.standard_normal(manifold.size)
    rate = manifold.velocity(reference, nodes, (manifold.tangent(nodes) @ s).reshape(-1, 3))

    def difference(h):
        ends = [manifold.logarithm(reference, manifold.retract(nodes, sign * h * s)) for sign in (1, -1)]
        return (ends[0] - ends[1]) / (2 * h) - rate

    if reach == 0:
        assert np.abs(rate - s).max() < 1e-14
        assert np.abs(difference(1e-2)).max() < 1e-13
    else:
        assert 1.95 < taylor_order(difference, STEPS) < 2.05


def test_velocity_is_right_very_near_the_reference(potential, reference, rng):
    """No loss where the turn is too small for its direction to be known."""
    manifold, s = potential.manifold, rng.standard_normal(potential.manifold.size)
    for reach in (1e-6, 1e-9, 1e-12, 1e-15):
        nodes = manifold.retract(reference, reach * rng.standard_normal(manifold.size))
        rate = manifold.velocity(reference, nodes, (manifold.tangent(nodes) @ s).reshape(-1, 3))
        small = manifold.velocity(reference, reference, (manifold.tangent(reference) @ s).reshape(-1, 3))
        assert np.abs(rate - small).max() < 20 * reach + 1e-13


@pytest.mark.parametrize("law", [{"stiffness": 80.0}, {"EA": 120.0}], ids=["k", "EA"])
@pytest.mark.parametrize("pins", PINS.values(), ids=PINS)
def test_gradient_and_hessian_by_taylor_remainder(law, pins, rng):
    loads = {"P4_2_1": [3.0, -2.0, 7.0], "P2_1_1": [1.0, 5.0, 0.0]}
    taut = shell_scene(pins=pins, loads=loads, tendons=law | {"rest_ratio": 0.4}, gravity={"g": 9.8})
    potential = Potential.of(taut)
    nodes, _ = random_motion(potential, rng, reach=0.05)
    point, manifold = potential.at(nodes), potential.manifold
    s = rng.standard_normal(manifold.size)
    s /= np.linalg.norm(s)

    def change(h):
        return potential.at(manifold.retract(nodes, h * s)).energy - point.energy

    slope, curve = point.gradient @ s, s @ (point.hessian @ s)
    assert 1.9 < taylor_order(lambda h: change(h) - h * slope, STEPS) < 2.1
    assert 2.9 < taylor_order(lambda h: change(h) - h * slope - h**2 / 2 * curve, STEPS) < 3.1


def test_hessian_is_symmetric(potential, reference):
    hessian = potential.at(reference).hessian
    assert abs(hessian - hessian.T).max() < 1e-13 * abs(hessian).max()


def test_input_map_by_differences(potential, reference):
    """The gradient is linear in the rest lengths of taut tendons with constant k."""
    members = potential.members
    rest = 0.5 * members.rest_lengths
    point, du = potential.at(reference, rest), 1e-2 * np.linspace(-1, 1, rest.size)
    force = -(potential.at(reference, rest - du).gradient - point.gradient)
    assert np.abs(force - point.input_map @ du).max() < 1e-12 * np.abs(force).max()


def test_mass_matrix_is_the_kinetic_energy(potential, rng):
    """Half the mass metric is sum m (|v1|^2 + v1.v2 + |v2|^2)/6 over rods, the integral along each."""
    structure, manifold = potential.structure, potential.manifold
    mass = rng.uniform(0.5, 2, len(structure.rods))
    nodes, velocities = random_motion(potential, rng)
    rate = manifold.velocity(nodes, nodes, velocities)
    a, b = velocities[structure.rods[:, 0]], velocities[structure.rods[:, 1]]
    wanted = (mass / 6 * (a * a + a * b + b * b).sum(axis=1)).sum()
    assert 0.5 * rate @ (manifold.mass(mass) * rate) == pytest.approx(wanted, rel=1e-13)
