"""Disturbances: forces on nodes that come and go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tensctl.model import Dynamics
from tensctl.scene import PushRequest
from tensctl.structure import matches


@dataclass(frozen=True)
class Push:
    """A disturbance: a force on a node for a while.

    Attributes
    ----------
    node : str
        Label or pattern.
    force : (3,) N
    start, stop : float, s
    """

    node: str
    force: Sequence[float]
    start: float
    stop: float

    def __post_init__(self) -> None:
        """Check the push as a scene's `[[simulation.push]]` is.

        Raises
        ------
        SceneError
            A force that is no three finite numbers, or a time that does not come after the other.
        """
        PushRequest.checked(node=self.node, force=self.force, start=self.start, stop=self.stop)


class Disturbances:
    """Constant loads and pushes as nodal forces."""

    def __init__(self, dynamics: Dynamics, pushes: Sequence[Push]) -> None:
        self._constant = dynamics.members.forces
        labels = dynamics.structure.node_labels
        self._pushes = [(matches(labels, push.node, "push.node"), push) for push in pushes]
        self.edges = np.array([t for push in pushes for t in (push.start, push.stop) if t > 0], float)

    def at(self, t: float) -> np.ndarray:
        """Forces at time t, (N, 3) N."""
        forces = self._constant.copy()
        for nodes, push in self._pushes:
            if push.start <= t < push.stop:
                forces[nodes] += np.asarray(push.force, float)
        return forces
