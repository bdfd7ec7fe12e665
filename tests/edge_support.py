"""States at the edge of what tension floors allow, which a linear programme finds."""

import numpy as np
from scipy.optimize import linprog
from support import random_motion, shell_scene, solved

import tensctl as tc


def forced(forces, **given):
    """The (3,1) shell with forces so many times as large and motions the same."""
    tendons = {"stiffness": 100.0 * forces, "rest_ratio": 0.8}
    return solved(shell_scene(tendons=tendons, rods={"mass": forces}, **given))


class Thrown:
    """The free (3,1) shell in a motion of one direction, and the speed up to which its floors can be kept."""

    def __init__(self, seed, horizon=6, floor=2.0, forces=1.0):
        _, rest, linear = forced(forces)
        self.rest = rest
        self.mpc = tc.MPC(linear, horizon=horizon, tension_min=forces * floor)
        velocities = random_motion(rest.potential, np.random.default_rng(seed), reach=0.0)[1]
        self.velocities = velocities / np.abs(velocities).max()
        self.edge = self._edge()

    def look(self, part):
        """What is measured at the edge's speed and a part of it more."""
        return self._look((1 + part) * self.edge)

    def _look(self, speed):
        rest = self.rest
        return tc.Measurement(rest.nodes, speed * self.velocities, rest.lengths, rest.tensions, rest.inputs)

    def _edge(self):
        """The largest speed for which some plan keeps all limits: they are linear in plan and speed."""
        still, fast = (self.mpc.statement(0.0, self._look(speed))[2] for speed in (0.0, 1.0))
        rows = np.vstack([np.eye(still.f.size), still.A])
        above, below = np.isfinite(still.lower), np.isfinite(still.upper)
        sides = [
            np.column_stack([-rows[above], fast.lower[above] - still.lower[above]]),
            np.column_stack([rows[below], still.upper[below] - fast.upper[below]]),
        ]
        limits = np.concatenate([-still.lower[above], still.upper[below]])
        cost = -np.eye(still.f.size + 1)[-1]
        ranges = [(None, None)] * still.f.size + [(0.0, 100.0)]
        fine = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
        return linprog(cost, np.vstack(sides), limits, bounds=ranges, method="highs-ds", options=fine).x[-1]
