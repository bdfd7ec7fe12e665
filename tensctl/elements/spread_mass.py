"""Means over the mass of uniform rods, which is spread along them.

    mean a = sum m a_c / sum m,   int b a' dm = sum m (b_c a_c' + b_d a_d'/12)

a_c is the mean of a rod's two ends and a_d their difference.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from tensctl.jit import bare


def spread(
    rods: Int[np.ndarray, "rods 2"], mass: Float[np.ndarray, " rods"], reference: Float[np.ndarray, "nodes 3"],
    nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"],
) -> tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 3 3"]]:  # fmt: skip
    """Means of (reference, nodes, velocities), one a row, and products of nodes with each, all about these means."""
    means, products = np.zeros((3, 3)), np.zeros((3, 3, 3))
    fields = np.ascontiguousarray(reference), np.ascontiguousarray(nodes), np.ascontiguousarray(velocities)
    _spread(rods, mass, *fields, means, products)
    return means, products


@bare
def _spread(rods, mass, reference, nodes, velocities, means, products):
    """Fill means and products."""
    total = mass.sum()
    for r in range(rods.shape[0]):
        tail, head, share = rods[r, 0], rods[r, 1], 0.5 * mass[r] / total
        for i in range(3):
            means[0, i] += share * (reference[tail, i] + reference[head, i])
            means[1, i] += share * (nodes[tail, i] + nodes[head, i])
            means[2, i] += share * (velocities[tail, i] + velocities[head, i])
    for r in range(rods.shape[0]):
        tail, head = rods[r, 0], rods[r, 1]
        for k, field in enumerate((reference, nodes, velocities)):
            for j in range(3):
                middle = 0.5 * (field[tail, j] + field[head, j]) - means[k, j]
                along = (field[head, j] - field[tail, j]) / 12
                for i in range(3):
                    at = 0.5 * (nodes[tail, i] + nodes[head, i]) - means[1, i]
                    products[k, i, j] += mass[r] * (at * middle + (nodes[head, i] - nodes[tail, i]) * along)
