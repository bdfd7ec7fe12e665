"""What a controller is shown, and what it must answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a controller is shown.

    Attributes
    ----------
    nodes, velocities : (N, 3) m, m/s
    lengths, tensions : (nt,) m, N
    inputs : (nu,) m
        Rest-length changes u as they are now.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    velocities: Float[np.ndarray, "nodes 3"]
    lengths: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    inputs: Float[np.ndarray, " inputs"]


class Controller(Protocol):
    """Anything that turns measurements into the total rest-length change u."""

    def step(self, t: float, measurement: Measurement) -> np.ndarray:
        """Total rest-length change u from L0, (nu,) m, to be reached at the end of the period."""
        ...

    def reset(self) -> None:
        """Forget what earlier runs left behind."""
        ...
