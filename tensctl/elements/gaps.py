"""How far rods are from each other, and how that changes with the nodes.

    d = min |x - y| - r_a - r_b,   x = a + s u,   y = b + t v,   s and t from 0 to 1
    dd = n . ((1 - s) da_tail + s da_head - (1 - t) db_tail - t db_head),   n = (x - y) / |x - y|

The nearest points are stationary or at an end, so s and t need no derivative. d is smooth except where the nearest
points jump from an end to another; its gradient is undefined where the axes meet, and n is then square to both rods.
Rods that share a node are no pair.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

# Axes nearer than this part of the rods' lengths meet.
_MEET = 1e-12


@dataclass(frozen=True, eq=False)
class RodGaps:
    """Every pair of rods that share no node.

    Attributes
    ----------
    rods : (nr, 2) int
        Nodes.
    pairs : (k, 2) int
    distance : (k,) m
        Between surfaces.
    shares : (k, 2)
        s and t.
    normals : (k, 3)
        n, from the second rod to the first.
    """

    rods: Int[np.ndarray, "rods 2"]
    pairs: Int[np.ndarray, "k 2"]
    distance: Float[np.ndarray, " k"]
    shares: Float[np.ndarray, "k 2"]
    normals: Float[np.ndarray, "k 3"]

    @property
    def least(self) -> float:
        """Least distance, m; infinite without a pair."""
        return float(self.distance.min(initial=np.inf))

    def slope(self, some: Int[np.ndarray, " r"], count: int) -> sp.csr_array:
        """Gradients of some distances by the coordinates of so many nodes, (r, 3 count)."""
        s, t = self.shares[some].T
        weights = np.stack([1 - s, s, t - 1, -t], axis=1)
        nodes = self.rods[self.pairs[some]].reshape(-1, 4)
        columns = 3 * nodes[:, :, None] + np.arange(3)
        values = weights[:, :, None] * self.normals[some][:, None, :]
        rows = np.broadcast_to(np.arange(len(some))[:, None, None], columns.shape)
        entries = (values.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_array(sp.coo_array(entries, shape=(len(some), 3 * count)))


def rod_gaps(
    rods: Int[np.ndarray, "rods 2"], radius: Float[np.ndarray, " rods"], nodes: Float[np.ndarray, "nodes 3"]
) -> RodGaps:
    """Distances of all pairs of rods at the given nodes."""
    first, second = np.triu_indices(len(rods), 1)
    apart = ~(rods[first][:, :, None] == rods[second][:, None, :]).any(axis=(1, 2))
    first, second = first[apart], second[apart]
    a, b = nodes[rods[first, 0]], nodes[rods[second, 0]]
    u, v = nodes[rods[first, 1]] - a, nodes[rods[second, 1]] - b
    s, t = _nearest(a - b, u, v)
    between = a - b + s[:, None] * u - t[:, None] * v
    length = np.linalg.norm(between, axis=1)
    square = np.cross(u, v)
    meet = length <= _MEET * np.sqrt((u * u).sum(axis=1) + (v * v).sum(axis=1))
    normals = np.where(meet[:, None], square, between)
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    distance = length - radius[first] - radius[second]
    return RodGaps(rods, np.stack([first, second], axis=1), distance, np.stack([s, t], axis=1), normals)


def _nearest(w: np.ndarray, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The s and t of the nearest points of w + s u and t v: stationary where that is inside, else on an edge."""
    uu, uv, vv, uw, vw = ((x * y).sum(axis=1) for x, y in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = (uv * vw - vv * uw) / (uu * vv - uv**2)
    inside = np.isfinite(inner) & (inner >= 0) & (inner <= 1)
    s0 = np.where(inside, inner, 0.0)
    zero, one = np.zeros(len(w)), np.ones(len(w))
    tries = [(s, np.clip((vw + s * uv) / vv, 0, 1)) for s in (s0, zero, one)]
    tries += [(np.clip((t * uv - uw) / uu, 0, 1), t) for t in (zero, one)]
    s, t = (np.stack(parts) for parts in zip(*tries, strict=True))
    gaps = np.linalg.norm(w + s[:, :, None] * u - t[:, :, None] * v, axis=2)
    best = gaps.argmin(axis=0), np.arange(len(w))
    return s[best], t[best]
