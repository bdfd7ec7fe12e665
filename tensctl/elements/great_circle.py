"""The great-circle chart about a reference shape, compiled: coordinates of a shape near it, and their rates.

    e = cos a e0 + sin a n,   tau = rho a n,   tau' = rho (a' n + a n')
    a' = cos a (n.e') - sin a (e0.e'),   sin a n' = (I - n n' - e0 e0') e'

A rod's direction e has turned from e0 by the angle a towards the unit vector n; tau is told on axes across e0, two in
space and one in a plane. The point that a rod turns about moves straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.jit import bare

# Below this sine the chart is its own tangent, to rounding.
_NO_TURN = 1e-12


@dataclass(frozen=True, eq=False)
class GreatCircles:
    """The chart about one shape.

    Attributes
    ----------
    rods : (nr, 2) int
    hold : (nr,) int, values of `Hold`
    lengths, lever : (nr,) m
        Of each rod, and from the point that it turns about to its free end.
    first : (nr,) int
        First coordinate of each rod.
    middle : (nr, 2 or 3) m
        Its centre in the reference.
    e0 : (nr, 3)
    axes : (nr, 1 or 2, 3)
    size : int
        Number of coordinates.
    """

    rods: Int[np.ndarray, "rods 2"]
    hold: Int[np.ndarray, " rods"]
    lengths: Float[np.ndarray, " rods"]
    lever: Float[np.ndarray, " rods"]
    first: Int[np.ndarray, " rods"]
    middle: Float[np.ndarray, "rods dimension"]
    e0: Float[np.ndarray, "rods 3"]
    axes: Float[np.ndarray, "rods turns 3"]
    size: int

    def at(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> tuple[Float[np.ndarray, " size"], Float[np.ndarray, " size"]]:
        """Coordinates of nodes, m, and their rates when the nodes move, m/s; rods less than half a turn away."""
        xi, rate, room = np.zeros(self.size), np.zeros(self.size), np.empty((2, 3))
        _chart(
            self.rods, self.hold, self.lengths, self.lever, self.first, self.middle, self.e0, self.axes,
            np.ascontiguousarray(nodes), np.ascontiguousarray(velocities), xi, rate, room[0], room[1],
        )  # fmt: skip
        return xi, rate

    def place(
        self, nodes: Float[np.ndarray, "nodes 3"], step: Float[np.ndarray, " size"]
    ) -> Float[np.ndarray, "nodes 3"]:
        """Nodes at given coordinates, m, exactly on the manifold; `nodes` are those of the reference."""
        moved = nodes.copy()
        _place(
            self.rods, self.hold, self.lever, self.first, self.middle, self.e0, self.axes, step, moved, np.empty((2, 3))
        )  # fmt: skip
        return moved


@dataclass(frozen=True, eq=False)
class JoinedCircles:
    """The chart of rods that joints and guides tie: the rods' own, projected square to the mass metric.

    Attributes
    ----------
    ends : GreatCircles
    end_node : (2 nr,) int
        Node of each rod end.
    down : (size, ends.size), sparse
    """

    ends: GreatCircles
    end_node: Int[np.ndarray, " ends"]
    down: sp.csr_array

    def at(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> tuple[Float[np.ndarray, " size"], Float[np.ndarray, " size"]]:
        """Coordinates of nodes, m, and their rates when the nodes move, m/s."""
        xi, rate = self.ends.at(nodes[self.end_node], velocities[self.end_node])
        return self.down @ xi, self.down @ rate


@bare
def _chart(rods, hold, lengths, lever, first, middle, e0, axes, nodes, velocities, xi, rate, across, moving):
    """Fill coordinates and rates; across and moving, (3,) each, are room for the parts of e and e' square to e0."""
    for r in range(rods.shape[0]):
        if hold[r] == 3:
            continue
        tail, head, column = rods[r, 0], rods[r, 1], first[r]
        if hold[r] == 0:
            for i in range(middle.shape[1]):
                xi[column] = 0.5 * (nodes[tail, i] + nodes[head, i]) - middle[r, i]
                rate[column] = 0.5 * (velocities[tail, i] + velocities[head, i])
                column += 1
        square, cosine, cosine_rate, sine, sine_rate = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            across[i] = nodes[head, i] - nodes[tail, i]
            moving[i] = (velocities[head, i] - velocities[tail, i]) / lengths[r]
            square += across[i] ** 2
            cosine_rate += e0[r, i] * moving[i]
        for i in range(3):
            across[i] /= np.sqrt(square)
            cosine += e0[r, i] * across[i]
        for i in range(3):
            across[i] -= cosine * e0[r, i]
            moving[i] -= cosine_rate * e0[r, i]
            sine += across[i] ** 2
            sine_rate += across[i] * moving[i]
        sine = np.sqrt(sine)
        stretch, growth = 1.0, 0.0
        if sine > 0:
            stretch = np.arctan2(sine, cosine) / sine
        if sine > _NO_TURN:
            sine_rate /= sine
            growth = (cosine * sine_rate - sine * cosine_rate - stretch * sine_rate) / sine
        for k in range(axes.shape[1]):
            for i in range(3):
                xi[column + k] += lever[r] * stretch * across[i] * axes[r, k, i]
                rate[column + k] += lever[r] * (stretch * moving[i] + growth * across[i]) * axes[r, k, i]


@bare
def _place(rods, hold, lever, first, middle, e0, axes, step, nodes, room):
    """Move the free ends; room, (2, 3), holds tau and e."""
    tau, e = room
    for r in range(rods.shape[0]):
        if hold[r] == 3:
            continue
        tail, head, column, sides = rods[r, 0], rods[r, 1], first[r], middle.shape[1]
        tau[:] = 0.0
        for k in range(axes.shape[1]):
            for i in range(3):
                tau[i] += step[column + (sides if hold[r] == 0 else 0) + k] * axes[r, k, i]
        angle = np.sqrt(tau[0] ** 2 + tau[1] ** 2 + tau[2] ** 2) / lever[r]
        share = (np.sin(angle) / angle if angle > 0 else 1.0) / lever[r]
        square = 0.0
        for i in range(3):
            e[i] = np.cos(angle) * e0[r, i] + share * tau[i]
            square += e[i] ** 2
        for i in range(3):
            reach = lever[r] * e[i] / np.sqrt(square)
            if hold[r] == 0:
                moved = step[column + i] if i < sides else 0.0
                base = 0.5 * (nodes[tail, i] + nodes[head, i]) + moved
                nodes[tail, i], nodes[head, i] = base - reach, base + reach
            elif hold[r] == 1:
                nodes[head, i] = nodes[tail, i] + reach
            else:
                nodes[tail, i] = nodes[head, i] - reach
