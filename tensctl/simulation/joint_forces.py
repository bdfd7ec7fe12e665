"""What joints and guides do to rod ends along a recorded run: C' mu with S mu = -C p''_free at each recorded state."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.jit import jit
from tensctl.model import Dynamics
from tensctl.model.joint_kernel import constraint_forces
from tensctl.model.kernel import accelerations
from tensctl.simulation.run import Run


@jit
def _along(data, q, v, rest, external, values, mu):
    push = np.zeros_like(q[0])
    for t in range(q.shape[0]):
        accelerations(data, q[t], v[t], rest[t], external[t], push)
        constraint_forces(data, q[t], push, values, mu[t])


def forces_at_rod_ends(
    dynamics: Dynamics, run: Run, forces: Float[np.ndarray, "t nodes 3"], loads: Float[np.ndarray, "t nodes 3"]
) -> Float[np.ndarray, "t rods 2 3"]:
    """Forces on both ends of every rod, N: those of its nodes, and of joints and guides where there are any.

    Parameters
    ----------
    forces : (t, N, 3) N
        All forces on nodes but joints', guides' and weight, which is spread along rods.
    loads : (t, N, 3) N
        Those of them that neither tendons nor drag make.
    """
    structure, members = dynamics.structure, dynamics.members
    if not dynamics.tied:
        return forces[:, structure.rods]
    layout, rows = dynamics.layout, dynamics.constraints
    weight = np.zeros_like(layout.anchor)
    weight[layout.rods] = 0.5 * members.mass[:, None, None] * members.gravity
    external = np.stack([layout.spread(load) for load in loads]) + weight
    q, v = (np.stack([dynamics.rod_coordinates(p) for p in nodes]) for nodes in (run.nodes, run.velocities))
    mu = np.zeros((len(run.time), rows.first.size))
    _along(dynamics.kernel, q, v, run.rest_lengths, external, np.zeros(rows.place[-1]), mu)
    at_ends = np.stack([layout.spread(force) for force in forces])[:, layout.rods]
    joint = mu @ rows.matrix(2 * len(layout.rods)).toarray()
    return at_ends + joint.reshape(at_ends.shape)
