"""Guides and planar structures in motion: closed forms, what is kept, and the plane as a part of space."""

import numpy as np
import pytest
import scipy.special
from support import network_scene, random_motion, shell_scene
from test_joints_motion import jointed_accelerations

import tensctl as tc
from tensctl.simulation import total_energy


def ladder(angle=0.6, g=9.8):
    """A rod of 2 m, its foot on the ground (z), its head on a wall (x), both in the plane y = 0."""
    nodes = {"foot": [2 * np.sin(angle), 0, 0], "head": [0, 0, 2 * np.cos(angle)]}
    structure = {
        "kind": "network", "nodes": nodes, "rods": {"ladder": ["foot", "head"]}, "tendons": {},
        "pins": {"foot": "yz", "head": "xy"},
    }  # fmt: skip
    return tc.Scene(structure=structure, gravity={"g": g})


def test_a_ladder_slides_as_a_pendulum_turned_over():
    """Its angle from the wall obeys a'' = (3 g / 2 L) sin a: a quarter of the swing from the elliptic integral."""
    angle, g = 0.6, 9.8
    dynamics = tc.build_dynamics(ladder(angle, g))
    omega = np.sqrt(3 * g / (2 * 2.0))
    k = np.cos(angle / 2)
    # from the upright b = pi - a swings as a pendulum from b0 = pi - angle at rest
    times = np.linspace(0, 0.8 * scipy.special.ellipk(k**2) / omega, 9)
    run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=times)
    sn = scipy.special.ellipj(omega * times + scipy.special.ellipk(k**2), k**2)[0]
    found = np.arctan2(run.nodes[:, 0, 0], run.nodes[:, 1, 2])
    assert np.abs(found - (np.pi - 2 * np.arcsin(k * sn))).max() < 1e-9
    assert np.abs(run.nodes[:, 0, 1:]).max() < 1e-15
    assert np.abs(run.nodes[:, 1, :2]).max() < 1e-15


GUIDED = {
    "one height held": {"P1_1_1": "z", "P1_2_1": "z"},
    "base on a table": {"P1_*_1": "z", "P3_1_1": "xy"},
    "pins and guides": {"P1_1_1": "xyz", "P1_2_1": "z", "P4_3_1": "x"},
}


@pytest.mark.parametrize("pins", GUIDED.values(), ids=GUIDED)
def test_kernel_and_casadi_agree(pins):
    dynamics = tc.build_dynamics(shell_scene(pins=pins, gravity={"g": 3.0}, tendons={"damping": 0.5}))
    nodes, velocities = random_motion(dynamics.potential, np.random.default_rng(4), reach=0.05)
    _, _, a = jointed_accelerations(dynamics, nodes, velocities)
    x = dynamics.pack(nodes, velocities)
    rate = np.asarray(dynamics.f(x, np.zeros(len(dynamics.members.inputs)), np.zeros(0))).ravel()
    assert np.abs(rate[x.size // 2 :] - a[dynamics.state_mask]).max() < 1e-12 * np.abs(a).max()


@pytest.mark.parametrize("pins", GUIDED.values(), ids=GUIDED)
def test_guided_nodes_keep_their_directions_and_energy_is_kept(pins):
    dynamics = tc.build_dynamics(shell_scene(pins=pins, gravity={"g": 3.0}))
    run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.5)
    held = dynamics.structure.held
    assert np.abs(run.nodes[:, held] - dynamics.structure.nodes[held]).max() < 1e-15
    assert np.abs(run.velocities[:, held]).max() < 1e-13
    energy = total_energy(dynamics, run)
    assert np.abs(energy - energy[0]).max() < 1e-8 * np.abs(energy).max()
    assert np.abs(run.nodes[-1] - run.nodes[0])[~held].max() > 0.05


NODES = {"a": [0.0, 0.0], "b": [2.0, 0.1], "c": [0.3, 1.5], "d": [1.9, 1.4]}
RODS = {"r1": ["a", "d"], "r2": ["b", "c"]}
TENDONS = {"bottom": ["a", "b"], "top": ["c", "d"], "left": ["a", "c"], "right": ["b", "d"]}


def planar(pins=(), **sections):
    recipe = {"kind": "planar", "nodes": NODES, "rods": RODS, "tendons": TENDONS, "pins": pins}
    return tc.Scene(structure=recipe, tendons={"rest_ratio": 0.8}, **sections)


def spatial(pins=(), **sections):
    nodes = {name: [*p, 0.0] for name, p in NODES.items()}
    whole = {name: "".join(sorted({*dict(pins).get(name, ""), "z"})) for name in nodes}
    recipe = {"kind": "network", "nodes": nodes, "rods": RODS, "tendons": TENDONS, "pins": whole}
    return tc.Scene(structure=recipe, tendons={"rest_ratio": 0.8}, **sections)


@pytest.mark.parametrize("sections", [{}, {"gravity": {"g": [0, -2.0, 0]}}, {"drag": {"coefficient": 0.3}}], ids=str)
def test_the_plane_moves_as_a_part_of_space_held_in_it(sections):
    """A planar structure, and the same in space with every z held by multipliers."""
    pins = {"a": "xy", "b": "y"}
    flat, full = tc.build_dynamics(planar(pins, **sections)), tc.build_dynamics(spatial(pins, **sections))
    times = np.linspace(0, 1, 11)
    runs = [tc.simulate(dynamics, dynamics.structure.nodes, timepts=times) for dynamics in (flat, full)]
    assert np.abs(runs[0].nodes - runs[1].nodes).max() < 1e-8
    assert (runs[0].nodes[:, :, 2] == 0).all()
    assert np.abs(runs[0].nodes - runs[0].nodes[0]).max() > 0.05


def test_a_free_planar_structure_takes_the_splitting():
    dynamics = tc.build_dynamics(planar())
    run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=1.0)
    assert run.method == "splitting6"
    assert (run.nodes[:, :, 2] == 0).all()
    other = tc.simulate(dynamics, dynamics.structure.nodes, timepts=run.time, method="dopri5")
    assert np.abs(run.nodes - other.nodes).max() < 1e-8


def test_starts_that_break_a_guide_are_refused():
    dynamics = tc.build_dynamics(shell_scene(pins={"P1_1_1": "z"}))
    nodes = dynamics.structure.nodes + np.array([0, 0, 0.1])
    with pytest.raises(tc.SimulationError, match="guided ones in the directions that are held"):
        tc.simulate(dynamics, nodes, t_end=0.1)
    tc.simulate(dynamics, dynamics.structure.nodes + np.array([0.1, 0, 0]), t_end=0.01)
    flat = tc.build_dynamics(planar())
    with pytest.raises(tc.SimulationError, match="leaves the plane"):
        tc.simulate(flat, flat.structure.nodes + np.array([0, 0, 0.1]), t_end=0.1)


@pytest.mark.parametrize("order", [("left", "tail", "head"), ("tail", "head", "left"), ("head", "left", "tail")])
def test_forces_act_on_the_nodes_that_they_name_in_any_order(order):
    """A rod of 1 kg on a rail, its tie still slack: a push of 3 N, weight or both move it by a t^2/2."""
    places = {"left": [-2, 0, 0], "tail": [0, 0, 0], "head": [1, 0, 0]}
    pins = {"left": "xyz", "tail": "yz", "head": "yz"}
    structure = tc.network(
        {name: places[name] for name in order}, {"r": ["tail", "head"]}, {"t": ["left", "tail"]}, pins=pins
    )
    tie = {"rest_length": 10.0}
    for gravity, pushed, a in ((None, "head", 3.0), (None, "tail", 3.0), ({"g": [2.0, 0, 0]}, None, 2.0)):
        scene = tc.Scene(structure=structure, rods={"mass": 1.0}, tendons=tie, gravity=gravity)
        dynamics = tc.build_dynamics(scene)
        pushes = [] if pushed is None else [tc.Push(pushed, (3.0, 0.0, 0.0), 0.0, 1.0)]
        for method in ("dopri5", "cvodes"):
            run = tc.simulate(dynamics, structure.nodes, timepts=[0.5], pushes=pushes, method=method)
            assert run.nodes[0, order.index("head"), 0] == pytest.approx(1 + a * 0.125, abs=1e-8)


def test_a_flat_network_needs_no_plane():
    """The same numbers as a network: nothing leaves the plane, but stability is judged in space."""
    nodes = {name: [*p, 0.0] for name, p in NODES.items()}
    dynamics = tc.build_dynamics(network_scene(nodes, RODS, TENDONS, tendons={"rest_ratio": 0.8}))
    run = tc.simulate(dynamics, dynamics.structure.nodes, t_end=0.3)
    flat = tc.build_dynamics(planar())
    other = tc.simulate(flat, flat.structure.nodes, timepts=run.time)
    assert np.abs(run.nodes - other.nodes).max() < 1e-11
