"""What many tests share: scenes in one line, random states on the rods' manifold, orders of convergence."""

from dataclasses import fields
from itertools import pairwise
from pathlib import Path

import numpy as np

import tensctl as tc
from tensctl.elements import Potential

REFERENCE = Path(__file__).parent / "reference"
_OF_STRUCTURE = ("primal", "radius", "height", "overlap", "twist", "pins", "cls")


def shell_scene(n=3, m=1, **given):
    """A shell of n x m elements; keywords go to its structure or are sections of the scene."""
    structure = {key: given.pop(key) for key in _OF_STRUCTURE if key in given}
    return tc.Scene(structure={"kind": "shell", "n": n, "m": m} | structure, **given)


def prism_scene(n=3, **given):
    structure = {key: given.pop(key) for key in _OF_STRUCTURE if key in given}
    return tc.Scene(structure={"kind": "prism", "n": n} | structure, **given)


def network_scene(nodes, rods, tendons, pins=(), /, **sections):
    recipe = {"kind": "network", "nodes": nodes, "rods": rods, "tendons": tendons, "pins": list(pins)}
    return tc.Scene(structure=recipe, **sections)


def pendulum_scene(head=(1.0, 0.0, 0.0), anchor=(-1.0, 0.0, 0.0), **sections):
    """A rod that turns about its pinned tail at the origin, its head tied to a pinned node."""
    nodes = {"o": [0, 0, 0], "head": list(head), "anchor": list(anchor)}
    return network_scene(nodes, {"rod": ["o", "head"]}, {"tie": ["head", "anchor"]}, ["o", "anchor"], **sections)


def reference_prism(pins=(), **sections):
    """The prestressed prism of `prism_pinned_linear.npz`: nodes a to f, tendons s0 to s8, base s0 to s2."""
    with np.load(REFERENCE / "prism_pinned_linear.npz", allow_pickle=False) as data:
        nodes, members, rest, stiffness = data["N"].T, data["C"], data["l0"][3:], data["kst"][3:]
    ends = [(int(np.flatnonzero(row < 0)[0]), int(np.flatnonzero(row > 0)[0])) for row in members]
    names = dict(zip("abcdef", nodes.tolist(), strict=True))
    labels = [f"s{k}" for k in range(9)]
    recipe = {
        "kind": "network",
        "nodes": names,
        "rods": {f"b{k}": ["abcdef"[a], "abcdef"[b]] for k, (a, b) in enumerate(ends[:3])},
        "tendons": {label: ["abcdef"[a], "abcdef"[b]] for label, (a, b) in zip(labels, ends[3:], strict=True)},
        "pins": list(pins),
    }
    tendons = {
        "stiffness": dict(zip(labels, stiffness.tolist(), strict=True)),
        "rest_length": dict(zip(labels, rest.tolist(), strict=True)),
    }
    return tc.Scene(structure=recipe, tendons=tendons, **sections)


MIXED_PINS = ("P1_1_1", "P2_2_1", "P3_3_1", "P4_3_1")
"""On the (3,1) shell: a rod held at its tail, one at its head, one at both ends, three free ones."""


def solved(scene, outputs=("nodes", "tensions")):
    """Dynamics, equilibrium and linear model of a scene."""
    dynamics, equilibrium = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    return dynamics, equilibrium, tc.linearize(dynamics, equilibrium, outputs=outputs)


def random_motion(potential: Potential, rng, reach=0.1, speed=1.0):
    """Nodes and velocities of rigid rods, near the structure's own nodes, pins at rest."""
    manifold = potential.manifold
    nodes = manifold.retract(potential.structure.nodes, reach * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (speed * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return nodes, velocities


def lively_plan(dynamics, rng, periods, reach=0.05, speed=0.5, *, lags=False):
    """A motion, inputs as they are, commands (elsewhere where actuators lag), and a plan that departs from these."""
    nodes, velocities = random_motion(dynamics.potential, rng, reach, speed)
    now, *asked = 0.02 * rng.standard_normal((1 + lags, dynamics.members.gearing.size))
    commands = asked[0] if lags else now
    plan = commands + np.cumsum(0.003 * rng.standard_normal((periods, now.size)), axis=0)
    return nodes, velocities, now, commands, plan


def order_of(steps, errors):
    """Slope of log error against log step: the order of convergence."""
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def taylor_order(remainder, steps):
    """Order at which a remainder (a function of the step) vanishes."""
    return order_of(steps, [np.abs(remainder(step)).max() for step in steps])


def rotation(rng):
    """A random proper rotation."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def replaced(record, **changes):
    """A frozen dataclass with some fields changed and nothing cached."""
    return type(record)(**{f.name: getattr(record, f.name) for f in fields(record)} | changes)


# The (3,2) shell with both end rings, a zigzag between the stages and a line along the side as cables.
MAST = {
    "bottom": ["P1_1_1", "P1_2_1", "P1_3_1", "P1_1_1"],
    "top": ["P4_1_2", "P4_2_2", "P4_3_2", "P4_1_2"],
    "girdle": ["P4_1_1", "P1_2_2", "P3_1_1", "P4_2_1", "P1_3_2", "P3_2_1", "P4_3_1", "P1_1_2", "P3_3_1", "P4_1_1"],
    "side": ["P3_1_2", "P2_1_2", "P1_2_2", "P4_2_1"],
}


def clustered(structure, cables, pins=()):
    """The structure with cables in place of the tendons that join the same nodes."""
    recipe = structure.as_recipe()
    gone = {frozenset(piece) for path in cables.values() for piece in pairwise(path)}
    kept = {label: ends for label, ends in recipe["tendons"].items() if frozenset(ends) not in gone}
    return recipe | {"tendons": kept | cables, "pins": pins if isinstance(pins, dict) else list(pins)}


def mast_scene(pins=(), **sections):
    return tc.Scene(structure=clustered(tc.shell(3, 2), MAST, pins), **sections)


def disturbed(rest, size, seed=1):
    """A random deviation from rest, always the same but for its size."""
    rng, manifold = np.random.default_rng(seed), rest.potential.manifold
    nodes = manifold.retract(rest.nodes, 0.01 * size * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (0.1 * size * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return tc.Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs)
