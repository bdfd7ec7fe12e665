"""One disturbance of one amplitude: whether the structure comes back from it, and what it met on the way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.controller import Controller
from tensctl.simulation.disturb import Disturbance, over_at, pushes_of, velocities_of
from tensctl.simulation.simulate import simulate
from tensctl.simulation.watched import Over, Watched
from tensctl.statics import Equilibrium


@dataclass(frozen=True)
class Trial:
    """What became of it.

    Attributes
    ----------
    amplitude : float, N or m/s
    reason : str
        Why it did not come back; empty when it did.
    time : float, s
        When that was known.
    peak : float, m
        Farthest that a node was from its place.
    slack : tuple of str
        Tendons that went slack, of those that are taut at rest.
    slack_share, floor_share, rate_share : float
        Shares of the samples, 0 to 1, at which any tendon was slack, any rest length asked to go to its floor, any
        asked to go as fast as it can, or faster.
    """

    amplitude: float
    reason: str
    time: float
    peak: float
    slack: tuple[str, ...]
    slack_share: float
    floor_share: float
    rate_share: float

    @property
    def recovered(self) -> bool:
        """Whether it came back."""
        return not self.reason


@dataclass(frozen=True, eq=False)
class Experiment:
    """What all trials have in common.

    Attributes
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
    controller : optional
    t_end : float, s
    within : float, m
    hold, dt : float, s
    rate_max : float, m/s
    collide : bool
    tol : float
    """

    dynamics: Dynamics
    equilibrium: Equilibrium
    controller: Controller | None
    t_end: float
    within: float
    hold: float
    dt: float
    rate_max: float
    collide: bool
    tol: float

    def at(self, disturbance: Disturbance, amplitude: float, *, tol: float | None = None) -> Trial:
        """Try one amplitude, N or m/s, with another tolerance if one is given."""
        rest = self.equilibrium
        watched = Watched(
            self.controller, self.dynamics, rest, after=over_at(disturbance), within=self.within, hold=self.hold,
            t_end=self.t_end, dt=self.dt, rate_max=self.rate_max, collide=self.collide,
        )  # fmt: skip
        start, pushes = (rest, velocities_of(disturbance, amplitude, rest.nodes)), pushes_of(disturbance, amplitude)
        reason = "did not settle"
        try:
            simulate(
                self.dynamics, start, controller=watched, dt=self.dt, timepts=[self.t_end], rate_max=self.rate_max,
                pushes=pushes, tol=self.tol if tol is None else tol,
            )  # fmt: skip
        except Over as over:
            reason = str(over)
        except SimulationError as error:
            reason = f"simulation error: {error}"
        labels, samples = self.dynamics.structure.tendon_labels, max(watched.samples, 1)
        return Trial(
            amplitude, reason, watched.time, watched.peak, tuple(labels[k] for k in np.flatnonzero(watched.slack)),
            watched.slack_samples / samples, watched.floor_samples / samples, watched.rate_samples / samples,
        )  # fmt: skip
