"""How far the top ring's plane leans: the angle between its normal and z, along x and y.

    a = sum p_k x p_(k+1) / 2,   s = |(a_x, a_y)|,   theta = atan2(s, a_z),   tilt = theta (a_x, a_y) / s

a is the ring's area vector, its plane's normal also where more than three nodes do not quite lie in a plane. theta / s
is smooth at s = 0, where both tilts vanish, and the tilt is no function of the shape where the ring is upside down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

# Below this s / a_z the first terms of the series in it are exact to rounding: their neglected ones are its 4th power.
_SMALL = 1e-4


@dataclass(frozen=True, eq=False)
class Tilt:
    """Lean of a ring's normal towards x (axis 0) or y (axis 1), rad.

    Attributes
    ----------
    ring : (n,) int
        Nodes in their order around the axis, counter-clockwise as seen from above at rest.
    axis : int
    lever : float, m
        Radius of the ring at rest: metres that a radian moves a node.
    """

    ring: Int[np.ndarray, " n"]
    axis: int
    lever: float

    @property
    def name(self) -> str:
        """Name and unit."""
        return f"tilt {'xy'[self.axis]}, rad"

    def of(self, nodes: Float[np.ndarray, "nodes 3"]) -> float:
        """Value at the given nodes, rad."""
        area = area_vector(nodes[self.ring])
        return float(_over_sine(area)[0] * area[self.axis])

    def slope(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """Gradient, rad/m."""
        places = nodes[self.ring]
        area = area_vector(places)
        ratio, bend = _over_sine(area)
        by_area = ratio * np.eye(3)[self.axis] + area[self.axis] * bend
        slope = np.zeros_like(nodes)
        slope[self.ring] = np.cross(np.roll(places, -1, axis=0) - np.roll(places, 1, axis=0), by_area) / 2
        return slope


def area_vector(places: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " 3"]:
    """Half the sum of p_k x p_(k+1) around a closed polygon, m^2."""
    return np.cross(places, np.roll(places, -1, axis=0)).sum(axis=0) / 2


def _over_sine(area: np.ndarray) -> tuple[float, np.ndarray]:
    """The ratio theta / s, and its gradient by a."""
    along, upward = area[:2], float(area[2])
    s, square = float(np.hypot(*along)), float(area @ area)
    if s < _SMALL * upward:
        ratio, bend = (1 - (s / upward) ** 2 / 3) / upward, -2 / (3 * upward**3)
    else:
        theta = np.arctan2(s, upward)
        ratio, bend = theta / s, (upward * s / square - theta) / s**3
    return float(ratio), np.array([*(bend * along), -1 / square])
