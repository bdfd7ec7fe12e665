"""From nodes to the rods' state, checked: a run starts from nodes and velocities that the structure can have."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.model import Dynamics

# What a start may miss of rod lengths and pins, over their size: files with nine digits pass.
FITS = 1e-9


def state_at(
    dynamics: Dynamics, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
) -> tuple[np.ndarray, np.ndarray]:
    """Rod coordinates and rates, (nr, 6) each.

    Raises
    ------
    SimulationError
        Nodes that do not fit the structure: wrong shape, a rod of another length, a pinned node moved, or
        velocities that stretch a rod.
    """
    structure = dynamics.structure
    for name, array in (("nodes", nodes), ("velocities", velocities)):
        if array.shape != structure.nodes.shape or not np.isfinite(array).all():
            raise SimulationError(f"start {name} have shape {array.shape}; finite {structure.nodes.shape} is expected.")
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    stretch = np.abs(np.linalg.norm(q[:, 3:], axis=1) / structure.rod_lengths - 1)
    if stretch.max(initial=0.0) > FITS:
        worst = int(stretch.argmax())
        raise SimulationError(
            f"rod {structure.rod_labels[worst]} starts {stretch[worst]:.1e} of its length too long or short; "
            "rods are rigid, so start from nodes with the structure's rod lengths."
        )
    moved = np.abs(nodes - structure.nodes)[structure.held].max(initial=0.0)
    moved = max(moved, np.abs(velocities)[structure.held].max(initial=0.0))
    if moved > FITS * np.ptp(structure.nodes, axis=0).max():
        raise SimulationError(
            "a pinned node is moved at the start; pinned nodes stay where the structure has them, guided ones in the "
            "directions that are held."
        )
    if structure.planar and max(np.abs(nodes[:, 2]).max(), np.abs(velocities[:, 2]).max()) > 0:
        raise SimulationError("the start leaves the plane of a planar structure; give nodes and velocities with z = 0.")
    along = np.abs(np.einsum("ri,ri->r", q[:, 3:], v[:, 3:])) / structure.rod_lengths
    speed = np.linalg.norm(v[:, 3:], axis=1).max(initial=0.0)
    if along.max(initial=0.0) > FITS * max(speed, 1e-300) and speed > 0:
        raise SimulationError("the start velocities stretch a rod; give velocities of rigid rods.")
    return q, v
