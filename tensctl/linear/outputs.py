"""What a linear model shows: node positions, tendon lengths and tensions to first order ([S] 5.22).

dp = J xi,   dl = (dl/dp) dp,   dT = (dT/dl) dl + c dl' + (dT/du) u,   slack tendons: dT = 0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.model import Dynamics
from tensctl.statics import Equilibrium, stretch_map

Output = Literal["nodes", "lengths", "tensions"]


@dataclass(frozen=True, eq=False)
class OutputMap:
    """Outputs from tangent coordinates xi, their rates and the tendon shortenings u of all tendons.

    Attributes
    ----------
    labels : tuple of str
    position, rate : (ny, size)
    feedthrough : (ny, nt)
    """

    labels: tuple[str, ...]
    position: Float[np.ndarray, "ny size"]
    rate: Float[np.ndarray, "ny size"]
    feedthrough: Float[np.ndarray, "ny tendons"]


def output_map(dynamics: Dynamics, equilibrium: Equilibrium, outputs: tuple[Output, ...]) -> OutputMap:
    """Stack the maps of the outputs asked for."""
    maps = [_MAPS[kind](dynamics, equilibrium) for kind in outputs]
    size, count = equilibrium.potential.manifold.size, len(equilibrium.lengths)
    return OutputMap(
        labels=tuple(label for m in maps for label in m.labels),
        position=np.vstack([np.zeros((0, size)), *(m.position for m in maps)]),
        rate=np.vstack([np.zeros((0, size)), *(m.rate for m in maps)]),
        feedthrough=np.vstack([np.zeros((0, count)), *(m.feedthrough for m in maps)]),
    )


def safe_label(label: str) -> str:
    """A label that python-control takes: no dots."""
    return label.replace(".", "_")


def _nodes(dynamics: Dynamics, equilibrium: Equilibrium) -> OutputMap:
    structure = dynamics.structure
    rows = np.flatnonzero(structure.free)
    labels = tuple(f"{safe_label(structure.node_labels[k // 3])}_{'xyz'[k % 3]}" for k in rows)
    position = equilibrium.point.tangent[rows].toarray()
    return OutputMap(labels, position, 0 * position, np.zeros((rows.size, len(structure.tendons))))


def _lengths(dynamics: Dynamics, equilibrium: Equilibrium) -> OutputMap:
    labels = tuple(f"l_{safe_label(label)}" for label in dynamics.structure.tendon_labels)
    position = stretch_map(equilibrium).toarray()
    return OutputMap(labels, position, 0 * position, np.zeros((len(labels), len(labels))))


def _tensions(dynamics: Dynamics, equilibrium: Equilibrium) -> OutputMap:
    labels = tuple(f"T_{safe_label(label)}" for label in dynamics.structure.tendon_labels)
    stretch, taut = stretch_map(equilibrium).toarray(), equilibrium.tensions > 0
    rest, members = equilibrium.rest_lengths, dynamics.members
    slope = np.where(taut, members.stiffness if members.law == "k" else members.stiffness / rest, 0.0)
    # dT/du = -dT/dL: k for constant k, EA l / L^2 for constant EA.
    through = slope if members.law == "k" else slope * equilibrium.lengths / rest
    rate = (dynamics.damping * taut)[:, None] * stretch
    return OutputMap(labels, slope[:, None] * stretch, rate, np.diag(through))


_MAPS = {"nodes": _nodes, "lengths": _lengths, "tensions": _tensions}
