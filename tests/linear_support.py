"""Scenes of every kind that the linear model must be right for, and states of it put on the nonlinear structure."""

import numpy as np
from support import MIXED_PINS, mast_scene, network_scene, prism_scene, shell_scene

import tensctl as tc

GUIDES = {"P1_1_1": "xyz", "P1_2_1": "z", "P1_3_1": "xz", "P4_1_1": "y"}
# On a free end, on a node where two rods meet, and a pin where two rods meet.
GUIDED_JOINTS = {"P1_1_1": "z", "P2_1_1": "x", "P4_1_1": "xyz"}
KITE = tc.planar(
    {"a": [0, 0], "b": [1.1, 1], "c": [0, 1], "d": [1, 0]},
    {"r": ["a", "b"], "s": ["c", "d"]},
    {"ac": ["a", "c"], "cb": ["c", "b"], "bd": ["b", "d"], "da": ["d", "a"]},
)
# Two rods in a joint, the lower one on a guide; one cable runs from the ground over the joint to the tip.
ARM = tc.planar(
    {"o": [0, 0], "p": [0, 1], "q": [0.9, 1.0], "l": [-1, 0], "g": [2, 0]},
    {"lower": ["o", "p"], "upper": ["p", "q"]},
    {"back": ["l", "p", "q"], "lo": ["l", "o"], "og": ["o", "g"], "gp": ["g", "p"], "gq": ["g", "q"]},
    {"o": "y", "l": "xy", "g": "xy"},
)
DAMPED = {"tendons": {"damping": 1.5}, "drag": {"coefficient": 0.3}}
# Three rods in one joint at the foot, held apart by a pinned ring of tendons: class 3.
TRIPOD = network_scene(
    {
        "foot": [0, 0, 0], "a": [1, 0, 1], "b": [-0.5, 0.9, 1.1], "c": [-0.5, -0.9, 0.9],
        "g1": [2, 0, -0.2], "g2": [-1, 1.8, 0], "g3": [-1, -1.8, 0.1], "g4": [0, 0, -1.0],
    },
    {"ra": ["foot", "a"], "rb": ["foot", "b"], "rc": ["foot", "c"]},
    {
        "ab": ["a", "b"], "bc": ["b", "c"], "ca": ["c", "a"], "ag": ["a", "g1"], "bg": ["b", "g2"], "cg": ["c", "g3"],
        "down": ["foot", "g4"], "f1": ["foot", "g1"], "f2": ["foot", "g2"], "f3": ["foot", "g3"],
    },
    ["g1", "g2", "g3", "g4"],
    tendons={"EA": {"*": 150.0, "down": 40.0}, "damping": 0.5},
    gravity={"g": 2.0},
)  # fmt: skip
SCENES = {
    "free": shell_scene(),
    "pinned": shell_scene(pins=["P1_*_1"]),
    "mixed pins": shell_scene(pins=MIXED_PINS),
    "free EA": shell_scene(tendons={"EA": 150.0}),
    "free damped": shell_scene(**DAMPED),
    "pinned damped EA": shell_scene(pins=["P1_*_1"], tendons={"EA": 150.0, "damping": 1.5}),
    "weight": shell_scene(pins=["P1_*_1"], gravity={"g": 9.8}, loads={"P4_1_1": [1, 2, 3]}, tendons={"stiffness": 300}),
    "cables": mast_scene(),
    "cables, pinned damped EA": mast_scene(["P1_*_1"], tendons={"EA": 150.0, "damping": 1.5}),
    "joints": shell_scene(3, 2, cls=2),
    "guides, damped EA": shell_scene(pins=GUIDES, tendons={"EA": 150.0, "damping": 1.5}),
    "joints, guides, weight": shell_scene(
        3, 2, cls=2, pins=GUIDED_JOINTS, gravity={"g": 2.0}, drag={"coefficient": 0.3}
    ),
    "plane": tc.Scene(structure=KITE),
    "plane, joint, guide, cable": tc.Scene(structure=ARM, tendons={"damping": 1.5}, loads={"q": [0.3, -1.0, 0.0]}),
    "three rods in a joint, EA, damped, weight": TRIPOD,
    "masses apart": shell_scene(pins=["P1_*_1"], rods={"mass": {"*": 1.0, "r2_*": 1e4}}, drag={"coefficient": 0.1}),
    "prism, two actuators": prism_scene(actuators={"tendons": ["top1", "side2"]}),
}
STEPS = np.array([2e-2, 1e-2, 5e-3, 2.5e-3])


class Neighbour:
    """States x and inputs u of the linear model put on the nonlinear structure."""

    def __init__(self, case):
        self.dynamics, self.rest, self.linear = case
        self.manifold, self.mass = self.rest.potential.manifold, self.dynamics.members.mass

    def placed(self, x):
        """Nodes and velocities: position by the exact chart, velocity with `state_of` equal to x to second order."""
        unsorted = np.empty_like(x)
        unsorted[self.linear.order] = x
        half = x.size // 2
        step = self.linear.shapes @ (unsorted[:half] / self.linear.scales)
        rate = self.linear.shapes @ unsorted[half:]
        nodes = self.manifold.retract(self.rest.nodes, step)
        along = [self.manifold.retract(self.rest.nodes, step + h * rate) for h in (1e-6, -1e-6)]
        velocities = (along[0] - along[1]) / 2e-6
        tangent = self.manifold.tangent(nodes).toarray()
        velocities = tangent @ np.linalg.lstsq(tangent, velocities.ravel(), rcond=None)[0]
        return nodes, velocities.reshape(-1, 3)

    def rate(self, x, u, linear=None):
        """dx/dt of the nonlinear structure, by central differences of `state_of` along its own motion.

        Another linear model, such as the flexible one, gives the rates of its own states.
        """
        linear = self.linear if linear is None else linear
        nodes, velocities = self.placed(x)
        w = np.zeros(3 * self.dynamics.members.pushed.size)
        state = self.dynamics.pack(nodes, velocities)
        dx, half = np.asarray(self.dynamics.f(state, u, w)).ravel(), state.size // 2
        _, acceleration = self.dynamics.unpack(np.concatenate([state[:half], dx[half:]]))
        h = 2e-5
        ends = [
            linear.state_of(nodes + s * h * velocities + h**2 / 2 * acceleration, velocities + s * h * acceleration)
            for s in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * h)

    def outputs(self, x, u):
        nodes, velocities = self.placed(x)
        state = self.dynamics.pack(nodes, velocities)
        free = self.dynamics.structure.free
        placed = np.asarray(self.dynamics.y_p(state)).reshape(-1, 3)[free]
        parts = placed, self.dynamics.y_l(state), self.dynamics.y_f(state, u)
        return np.concatenate([np.asarray(part).ravel() for part in parts])


def directions(linear, rng):
    x, u = rng.standard_normal(linear.A.shape[0]), rng.standard_normal(linear.B.shape[1])
    return x / np.linalg.norm(x), 0.1 * u / np.linalg.norm(u)
