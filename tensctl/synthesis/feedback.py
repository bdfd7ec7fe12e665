"""What feedback is given at a sample, and what it may ask for: never a rest length below its floor."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from jaxtyping import Float

from tensctl.linear import HarmonicModel, LinearModel


class Measured(Protocol):
    """What a controller is shown at a sample."""

    @property
    def nodes(self) -> np.ndarray:
        """Node positions, (N, 3) m."""
        ...

    @property
    def velocities(self) -> np.ndarray:
        """Node velocities, (N, 3) m/s."""
        ...

    @property
    def inputs(self) -> np.ndarray:
        """Rest-length changes as they are now, (nu,) m."""
        ...


def command(linear: LinearModel | HarmonicModel, change: Float[np.ndarray, " nu"]) -> Float[np.ndarray, " nu"]:
    """Total rest-length change from L0, m, of a change from the equilibrium, kept above the rest-length floors."""
    return np.clip(linear.equilibrium.inputs + change, *linear.dynamics.members.input_bounds)
