"""The linear model whose inputs are commands: actuators with lag carry the rest lengths as states.

    x' = A x + B u,   tau u' = c - u,   y = C x + D u

    d/dt (x, u) = [A B; 0 -1/tau] (x, u) + [0; 1/tau] c,   y = [C D] (x, u)

Nothing that the tendons can do is lost by it, since a lag has no zeros; tensions no longer answer at once.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from tensctl.linear.lag import recast
from tensctl.linear.model import LinearModel


class ActuatedModel(LinearModel):
    """A linear model with the lag of its actuators; its last states are rest-length changes, its inputs commands."""

    @property
    def mechanics(self) -> LinearModel:
        """The same modes driven by the rest lengths themselves."""
        return self._mechanics

    @cached_property
    def _mechanics(self) -> LinearModel:
        return recast(self, LinearModel)

    @property
    def actuated(self) -> LinearModel:
        """Itself."""
        return self

    @property
    def lag(self) -> float:
        """Time constant tau of the actuators, s."""
        return self.dynamics.members.lag

    @cached_property
    def order(self) -> Int[np.ndarray, " nx"]:
        """Positions of (s eta, eta') in the first states, as the mechanics have them."""
        return self.mechanics.order

    @cached_property
    def A(self) -> Float[np.ndarray, "nx nx"]:
        """State matrix, 1/s."""
        inner = self.mechanics
        nx, nu = inner.B.shape
        return np.block([[inner.A, inner.B], [np.zeros((nu, nx)), -np.eye(nu) / self.lag]])

    @cached_property
    def B(self) -> Float[np.ndarray, "nx nu"]:
        """Input matrix: commanded rest-length shortening, m."""
        nx, nu = self.mechanics.B.shape
        return np.vstack([np.zeros((nx, nu)), np.eye(nu) / self.lag])

    @cached_property
    def E(self) -> Float[np.ndarray, "nx nw"]:
        """Disturbance matrix: forces on the chosen nodes, N, without z in a plane."""
        inner = self.mechanics
        return np.vstack([inner.E, np.zeros((len(inner.B.T), inner.E.shape[1]))])

    @cached_property
    def C(self) -> Float[np.ndarray, "ny nx"]:
        """Output matrix."""
        return np.hstack([self.mechanics.C, self.mechanics.D])

    @cached_property
    def D(self) -> Float[np.ndarray, "ny nu"]:
        """Feedthrough: nothing answers to a command at once."""
        return np.zeros_like(self.mechanics.D)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Labels of the mechanics' states, then `now_u_t5_1_1` and so on: rest lengths as they are."""
        return self.mechanics.states + tuple(f"now_{name}" for name in self.inputs)

    def seen(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"],
        inputs: Float[np.ndarray, " nu"],
    ) -> Float[np.ndarray, " nx"]:  # fmt: skip
        """State x of the nonlinear structure and the rest-length changes that it has now."""
        return np.concatenate([self.state_of(nodes, velocities), np.asarray(inputs) - self.equilibrium.inputs])
