"""Rigid-body motions that the pins allow, as nodal displacements.

v(p) = a + b x (p - centre) / size,   v = 0 at every pinned node
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.statics.prestress.rank import subspaces


def rigid_fields(
    nodes: Float[np.ndarray, "nodes 3"], pinned: Float[np.ndarray, " nodes"] | np.ndarray
) -> Float[np.ndarray, "coordinates r"]:
    """Orthonormal nodal displacements (3N, r) of the rigid-body motions that move no pinned node.

    Six for a free body in space, five when all nodes stand on one line (turning about it moves nothing).
    """
    centred = nodes - nodes.mean(axis=0)
    size = np.linalg.norm(centred, axis=1).max(initial=0.0) or 1.0
    motion = np.zeros((*nodes.shape, 6))
    motion[:, :, :3] = np.eye(3)
    for k in range(3):
        motion[:, :, 3 + k] = np.cross(np.eye(3)[k], centred / size)
    held = motion[pinned].reshape(-1, 6)
    allowed = subspaces(held).null if len(held) else np.eye(6)
    moved = motion.reshape(-1, 6) @ allowed
    moved.reshape(*nodes.shape, -1)[pinned] = 0.0
    return subspaces(moved).column_space if moved.shape[1] else moved
