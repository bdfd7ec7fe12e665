"""Harmonics whose inputs are commands: as `linear.actuated` has the whole structure, one harmonic at a time.

d/dt (x_k, u_k) = [A_k B_k; 0 -1/tau] (x_k, u_k) + [0; 1/tau] c_k
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Inexact

from tensctl.linear.harmonic_block import Harmonic, Shown


class ActuatedHarmonic(Harmonic):
    """A harmonic with the lag of its actuators; its last states are rest-length changes, its inputs commands."""

    @property
    def lag(self) -> float:
        """Time constant tau of the actuators, s."""
        return self.dynamics.members.lag

    @property
    def nx(self) -> int:
        """Number of states: those of the motion, and one rest length an input."""
        return self.motion + self.gear.shape[1]

    @property
    def A(self) -> Inexact[np.ndarray, "nx nx"]:
        """State matrix, 1/s."""
        drive = super().B
        n, p = drive.shape
        return np.block([[super().A, drive], [np.zeros((p, n)), -np.eye(p) / self.lag]])

    @property
    def B(self) -> Inexact[np.ndarray, "nx p"]:
        """Input matrix: commanded rest-length shortening, m."""
        p = self.gear.shape[1]
        return np.vstack([np.zeros((self.motion, p)), np.eye(p) / self.lag])

    @property
    def E(self) -> Inexact[np.ndarray, "nx components"]:
        """Disturbance matrix: forces on the sector's free node components, N, in axes that turn with the sectors."""
        return np.pad(super().E, ((0, self.gear.shape[1]), (0, 0)))

    def C(self, kind: Shown) -> Inexact[np.ndarray, "y nx"]:
        """Output matrix of the sector's free node components, tendon lengths or tensions."""
        return np.hstack([super().C(kind), super().D(kind)])

    def D(self, kind: Shown) -> Inexact[np.ndarray, "y p"]:
        """Feedthrough: nothing answers to a command at once."""
        return np.zeros_like(super().D(kind))
