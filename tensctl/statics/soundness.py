"""What is checked before any search: that the structure hangs together, and that something takes its loads.

A rest needs sum w . v = 0 for every translation v that the ground allows: along each axis in which it holds no node.
The moment of the loads, sum (p - c) x w, may vanish at one attitude and not at another, so it is named only when a
search has failed.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from tensctl.elements import Potential
from tensctl.errors import EquilibriumError
from tensctl.statics.rigid import mass_centre
from tensctl.structure import Structure

# Loads in decimal numbers add up to zero to rounding only.
_BALANCED = 1e-12
_SHOWN = 4


def check_sound(potential: Potential) -> None:
    """Refuse what can have no rest, by name.

    Raises
    ------
    EquilibriumError
        Parts that nothing joins, or loads whose sum nothing takes.
    """
    _check_connected(potential.structure)
    forces = potential.members.forces
    loose = ~potential.structure.held.any(axis=0)
    total, largest = forces.sum(axis=0)[loose], np.linalg.norm(forces, axis=1).sum()
    if np.linalg.norm(total) > _BALANCED * largest:
        share = np.linalg.norm(total) / np.linalg.norm(forces, axis=1).max()
        raise EquilibriumError(
            f"nothing takes the sum of the loads, {unheld(potential, potential.structure.nodes)}: "
            f"{share:.1e} of the largest force is left over; check that loads are held by pins, or add loads that "
            "balance them."
        )


def unheld(potential: Potential, nodes: np.ndarray) -> str:
    """The loads' sum and moment about the mass centre, in words."""
    forces = potential.members.forces
    moment = np.cross(nodes - mass_centre(potential, nodes), forces).sum(axis=0)
    return f"a force of {_vector(forces.sum(axis=0))} N and a moment of {_vector(moment)} N m about the mass centre"


def _vector(values: np.ndarray) -> str:
    return "[" + ", ".join(f"{0.0 if abs(x) < 1e-12 * np.abs(values).max() else x:.4g}" for x in values) + "]"


def _check_connected(structure: Structure) -> None:
    """Every node hangs together with every other one, the ground being one body; lone nodes on it do not count."""
    count = len(structure.nodes)
    ground = np.flatnonzero(structure.pinned)
    edges = np.vstack([structure.rods, structure.segments, np.column_stack([ground[:-1], ground[1:]])])
    graph = sp.coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    if parts > 1:
        first = [structure.node_labels[i] for i in np.flatnonzero(part == part[-1])]
        raise EquilibriumError(
            f"the structure falls into {parts} parts that nothing joins: one is {_some(first)}; "
            "join them with tendons, hold each by a pin, or make a scene of each."
        )


def _some(labels: list[str]) -> str:
    more = f" and {len(labels) - _SHOWN} more" if len(labels) > _SHOWN else ""
    return ", ".join(labels[:_SHOWN]) + more
