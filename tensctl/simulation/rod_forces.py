"""What rods carry in motion: the axial force varies along a uniform rod that accelerates or has weight.

With forces f on its ends (tendons, loads, drag; e from tail to head), s from 0 at the tail to 1 at the head, and weight
and inertia spread along the rod, the compression is

    C(s) = (1 - s) C(0) + s C(1) - kappa/2 s (1 - s),   kappa = m |q2'|^2 / L

    free rod            C(0) = e . f_tail                              C(1) = -e . f_head
    held at its tail    C(0) = C(1) - m e . g - kappa/2                C(1) = -e . f_head
    held at its head    C(0) = e . f_tail                              C(1) = C(0) + m e . g - kappa/2

from the balance of a piece of rod whose points accelerate with q1'' and e . q2'' = -|q2'|^2/L ([S] A.17). Turning pulls
a rod apart, so its largest compression is at an end. A free rod falls with its weight and does not feel it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold
from tensctl.model import Dynamics
from tensctl.simulation.joint_forces import forces_at_rod_ends
from tensctl.simulation.loads import Load, Loads
from tensctl.simulation.run import Run
from tensctl.structure import nodal_weight


@dataclass(frozen=True, eq=False)
class RodForces:
    """Axial force in every rod at every recorded time, > 0 in compression; 0 in rods with both ends on the ground.

    Attributes
    ----------
    tail, head : (t, nr) N
        At the two ends.
    bow : (t, nr) N
        kappa, the second derivative along the rod.
    """

    tail: Float[np.ndarray, "t rods"]
    head: Float[np.ndarray, "t rods"]
    bow: Float[np.ndarray, "t rods"]

    @property
    def largest(self) -> Float[np.ndarray, "t rods"]:
        """Largest compression along each rod, N."""
        return np.maximum(self.tail, self.head)

    @property
    def least(self) -> Float[np.ndarray, "t rods"]:
        """Least compression along each rod, N; below 0 the rod is pulled."""
        bow = np.where(self.bow > 0, self.bow, 1.0)
        place = np.where(self.bow > 0, np.clip(0.5 - (self.head - self.tail) / bow, 0.0, 1.0), 0.0)
        return np.minimum(self.at(place), np.minimum(self.tail, self.head))

    def at(self, place: float | np.ndarray) -> Float[np.ndarray, "t rods"]:
        """Compression at a place from 0 (tail) to 1 (head), N."""
        return (1 - place) * self.tail + place * self.head - 0.5 * self.bow * place * (1 - place)


def rod_forces_along(dynamics: Dynamics, run: Run, pushes: Sequence[Load] = ()) -> RodForces:
    """Axial force along each rod at each recorded time of a run.

    Parameters
    ----------
    dynamics : Dynamics
    run : Run
    pushes : sequence of Push, Wave or History
        Those of the run; they are not among what it records.
    """
    structure, members, manifold = dynamics.structure, dynamics.members, dynamics.potential.manifold
    forces = forces_at_rod_ends(dynamics, run, *end_forces(dynamics, run, pushes))
    along = run.nodes[:, structure.rods[:, 1]] - run.nodes[:, structure.rods[:, 0]]
    turning = run.velocities[:, structure.rods[:, 1]] - run.velocities[:, structure.rods[:, 0]]
    length = np.linalg.norm(along, axis=2)
    e = along / length[:, :, None]
    bow = members.mass * (turning**2).sum(axis=2) / length
    weight = members.mass * (e @ members.gravity)
    tail = np.einsum("tri,tri->tr", e, forces[:, :, 0])
    head = -np.einsum("tri,tri->tr", e, forces[:, :, 1])
    hold = manifold.hold
    by_head, by_tail = head - weight - 0.5 * bow, tail + weight - 0.5 * bow
    tail, head = np.where(hold == Hold.TAIL, by_head, tail), np.where(hold == Hold.HEAD, by_tail, head)
    moves = hold != Hold.FIXED
    return RodForces(tail * moves, head * moves, bow)


def end_forces(
    dynamics: Dynamics, run: Run, pushes: Sequence[Load] = ()
) -> tuple[Float[np.ndarray, "t nodes 3"], Float[np.ndarray, "t nodes 3"]]:
    """What tendons, loads and drag do on each node at each recorded time, N, and the loads among it.

    Weight is in neither: it is spread along rods.
    """
    structure, members = dynamics.structure, dynamics.members
    acting = Loads(dynamics, pushes)
    loads = np.stack([acting.at(t) for t in run.time]) - nodal_weight(structure, members.mass, members.gravity)
    ends = np.bincount(structure.rods.ravel(), minlength=len(structure.nodes))
    forces = loads - (dynamics.drag * ends)[:, None] * run.velocities
    vectors = run.nodes[:, structure.segments[:, 1]] - run.nodes[:, structure.segments[:, 0]]
    length = np.linalg.norm(vectors, axis=2)
    density = run.tensions[:, structure.segment_tendon] / np.where(length > 0, length, 1.0)
    pull = (density[:, :, None] * vectors).swapaxes(0, 1)
    for side, sign in ((0, 1.0), (1, -1.0)):
        np.add.at(forces.swapaxes(0, 1), structure.segments[:, side], sign * pull)
    return forces, loads
