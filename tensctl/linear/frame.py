"""The co-moving frame: how a free structure has moved as a whole, by its distributed mass.

The rotation Q and centre that best fit the moved rods to the reference minimise int |Q (r_ref - c_ref) - (r - c)|^2 dm;
for uniform rods the integral of the outer products is sum m (c c_ref' + q2 q2_ref'/12). Fitting nodes as points instead
would show flexible modes as rotation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential, spread


@dataclass(frozen=True, eq=False)
class Frame:
    """Pose and rates of the co-moving frame.

    Attributes
    ----------
    rotation : (3, 3), from the reference to the world
    centre, reference_centre : (3,) m
    velocity : (3,) m/s
    spin : (3,) rad/s, in the world
    """

    rotation: Float[np.ndarray, "3 3"]
    centre: Float[np.ndarray, " 3"]
    reference_centre: Float[np.ndarray, " 3"]
    velocity: Float[np.ndarray, " 3"]
    spin: Float[np.ndarray, " 3"]

    @property
    def angle(self) -> float:
        """How far the structure is turned from the reference, rad, 0 to pi."""
        sine = np.linalg.norm(self.rotation - self.rotation.T) / np.sqrt(8)
        return float(np.arctan2(sine, 0.5 * (np.trace(self.rotation) - 1)))

    def nodes(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """Nodes as seen from the frame, beside the reference, m."""
        return (nodes - self.centre) @ self.rotation + self.reference_centre

    def velocities(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Node velocities as seen from the frame, m/s."""
        x, y, z = self.spin
        turning = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # r turning = spin x r
        return (velocities - self.velocity - (nodes - self.centre) @ turning) @ self.rotation


def best_fit(
    potential: Potential,
    reference: Float[np.ndarray, "nodes 3"],
    nodes: Float[np.ndarray, "nodes 3"],
    velocities: Float[np.ndarray, "nodes 3"],
) -> Frame:
    """Frame that moves with a free structure: Kabsch fit of the mass, mean velocity and mean spin."""
    structure = potential.structure
    means, (turned, shape, moving) = spread(structure.rods, potential.members.mass, reference, nodes, velocities)
    inertia = np.trace(shape) * np.eye(3) - shape
    momentum = np.array([moving[1, 2] - moving[2, 1], moving[2, 0] - moving[0, 2], moving[0, 1] - moving[1, 0]])
    spin = momentum / inertia[2, 2] if structure.planar else np.linalg.solve(inertia, momentum)
    return Frame(fitted(turned, structure.planar), means[1], means[0], means[2], spin)


def fitted(moments: Float[np.ndarray, "*k 3 3"], flat: bool) -> Float[np.ndarray, "*k 3 3"]:
    """The rotation that makes R' moments symmetric and largest; `flat`, the best turn within the plane z = 0.

    A fit in space could turn a plane over.
    """
    if not flat:
        left, _, right = np.linalg.svd(moments)
        left[..., 2] *= np.linalg.det(left @ right)[..., None]
        return left @ right
    (a, b), (c, d) = np.moveaxis(moments[..., :2, :2], (-2, -1), (0, 1))
    angle, rotation = np.arctan2(c - b, a + d), np.zeros_like(moments)
    rotation[..., 0, 0] = rotation[..., 1, 1] = np.cos(angle)
    rotation[..., 1, 0] = np.sin(angle)
    rotation[..., 0, 1] = -rotation[..., 1, 0]
    rotation[..., 2, 2] = 1.0
    return rotation
