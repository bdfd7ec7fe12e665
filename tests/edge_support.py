"""States at the edge of what tension floors allow, which a linear programme finds."""

import numpy as np
from scipy.optimize import linprog
from support import disturbed, random_motion, shell_scene, solved

import tensctl as tc


def forced(forces, **given):
    """The (3,1) shell with forces so many times as large and motions the same."""
    tendons = {"stiffness": 100.0 * forces, "rest_ratio": 0.8}
    return solved(shell_scene(tendons=tendons, rods={"mass": forces}, **given))


def largest(still, moved, most):
    """The largest part of the way from one QP's limits to another's with a solution: they are linear in plan and part.

    Both have the same rows; `most` bounds the part.
    """
    rows = np.vstack([np.eye(still.f.size), still.A])
    above, below = np.isfinite(still.lower), np.isfinite(still.upper)
    sides = [
        np.column_stack([-rows[above], moved.lower[above] - still.lower[above]]),
        np.column_stack([rows[below], still.upper[below] - moved.upper[below]]),
    ]
    limits = np.concatenate([-still.lower[above], still.upper[below]])
    cost = -np.eye(still.f.size + 1)[-1]
    ranges = [(None, None)] * still.f.size + [(0.0, most)]
    fine = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    return linprog(cost, np.vstack(sides), limits, bounds=ranges, method="highs-ds", options=fine).x[-1]


class Thrown:
    """The free (3,1) shell in a motion of one direction, and the speed up to which its floors can be kept.

    With `reach` its nodes are off by so many metres in a direction of its own; forces are so many times as large; other
    options are those of `MPC`.
    """

    def __init__(self, seed, horizon=6, floor=2.0, reach=0.0, forces=1.0, **options):
        _, rest, linear = forced(forces)
        self.rest = rest
        self.mpc = tc.MPC(linear, horizon=horizon, tension_min=forces * floor, **options)
        rng, manifold = np.random.default_rng(seed), rest.potential.manifold
        velocities = random_motion(rest.potential, rng, reach=0.0)[1]
        self.nodes = manifold.retract(rest.nodes, reach * rng.standard_normal(manifold.size))
        self.velocities = velocities / np.abs(velocities).max()
        still, fast = (self.mpc.statement(0.0, self._look(speed))[2] for speed in (0.0, 1.0))
        self.edge = largest(still, fast, 100.0)

    def look(self, part):
        """What is measured at the edge's speed and a part of it more."""
        return self._look((1 + part) * self.edge)

    def _look(self, speed):
        rest = self.rest
        return tc.Measurement(self.nodes, speed * self.velocities, rest.lengths, rest.tensions, rest.inputs)


class Asked:
    """A pinned (3,1) mast away from rest that is asked to be 30 % taller at once, and the highest floor it can keep.

    The floor is that of the first plan of nonlinear MPC; where it is asked for so much, rates are at their limits.
    """

    def __init__(self, seed, size, horizon=8):
        scene = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.3, "duration": 60.0}, mpc={})
        self.dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        self.target = tc.plan_shape(scene, start=rest).target
        self.horizon, self.look = horizon, disturbed(rest, size, seed)
        none, one = (self.controller(floor).linearised(0.0, self.look).qp() for floor in (0.0, 1.0))
        self.edge = largest(none, one, 100.0)

    def controller(self, floor):
        """A controller with so high a floor, N."""
        return tc.NonlinearMPC(self.dynamics, self.target, horizon=self.horizon, tension_min=floor)
