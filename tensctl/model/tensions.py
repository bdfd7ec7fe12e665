"""Tensions of given states by the tendon's own law: no linear model, no slack that pushes.

T = max(0, k (l - L) + c dl/dt)   or with EA (l / L - 1),   0 while l <= L
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.model.dynamics import Dynamics
from tensctl.structure import Structure


def tensions_at(
    dynamics: Dynamics, nodes: np.ndarray, velocities: np.ndarray, length: np.ndarray, rest: np.ndarray
) -> Float[np.ndarray, "t tendons"]:
    """Tensions of states, (t, nt) N: the tendon's law with its damper."""
    structure, members = dynamics.structure, dynamics.members
    stiffness = members.stiffness if members.law == "k" else members.stiffness / rest
    tension = stiffness * (length - rest)
    if dynamics.damping.any():
        tension = tension + dynamics.damping * lengthening(structure, nodes, velocities)
    least = 0.0 if dynamics.clamped else -np.inf
    return np.where(length > rest, np.maximum(tension, least), 0.0)


def lengthening(structure: Structure, nodes: np.ndarray, velocities: np.ndarray) -> Float[np.ndarray, "t tendons"]:
    """How fast tendons grow longer in given states, (t, nt) m/s."""
    ends = structure.segments
    d, rate = (a[:, ends[:, 1]] - a[:, ends[:, 0]] for a in (nodes, velocities))
    apart = np.linalg.norm(d, axis=2)
    growing = np.einsum("tki,tki->tk", d, rate) / np.where(apart > 0, apart, 1.0)
    return structure.over_segments(np.add, growing)
