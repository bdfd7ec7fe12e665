"""A controller that is looked at while it works, and the run that ends as soon as its outcome is known.

    e(t) = max over nodes |p - p*|,     in the co-moving frame of a structure that nothing holds

back        e <= within for the time `hold` on end, the disturbance being over
elsewhere   e > within for that time, while no node moves by more than a tenth of `within`
met         two rods touch: thin ones pass through each other between two samples
"""

from __future__ import annotations

from collections import deque

import numpy as np

from tensctl.linear import best_fit
from tensctl.model import Dynamics
from tensctl.simulation.clearance import Segments, clearance
from tensctl.simulation.controller import Controller, Measurement, ask
from tensctl.statics import Equilibrium

# What stays within this part of `within` rests; twice the filter's shake of a millimetre passes on a structure of a
# metre, a beat of two modes does not.
_STILL = 0.1
# What turns by more than this, rad, while it is looked at, does not rest. A slower turn deforms by less than a
# ten-thousandth.
_TURNED = 0.1
# A command this near to a limit, as a part of it, is at the limit.
_AT = 1e-9


class Over(Exception):  # noqa: N818 - an outcome, and no error
    """The outcome is known; its text says which."""


class Watched:
    """Stands between simulation and controller; without one, rest lengths stay as they are.

    Parameters
    ----------
    after : float, s
        When the disturbance is over.
    within : float, m
    hold, t_end : float, s
    rate_max : float, m/s
    collide : bool
        Whether rods that touch end the run.
    """

    def __init__(
        self, controller: Controller | None, dynamics: Dynamics, rest: Equilibrium, *, after: float, within: float,
        hold: float, t_end: float, dt: float, rate_max: float, collide: bool,
    ) -> None:  # fmt: skip
        self._controller, self._dynamics, self._rest = controller, dynamics, rest
        self._after, self._within, self._hold, self._t_end, self._collide = after, within, hold, t_end, collide
        self.dt, self.delay = dt, float(getattr(controller, "delay", 0.0))
        lower, upper = dynamics.members.input_bounds
        self._bounds = (lower * (1 + _AT * np.sign(lower)), upper * (1 - _AT * np.sign(upper)))
        self._reach = rate_max * dt / dynamics.members.gearing.largest
        structure = dynamics.structure
        self._rods = Segments(structure.rods, dynamics.members.radius, np.zeros(len(structure.rods)))
        self._taut = (rest.tensions > 0) & ~structure.grounded_tendons
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self.time, self.peak, self.samples = 0.0, 0.0, 0
        self.slack = np.zeros(self._taut.size, bool)
        self._turning = 0.0
        self.slack_samples = self.floor_samples = self.rate_samples = 0
        self._seen: deque[tuple[float, float, np.ndarray]] = deque()
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None
        if self._controller is not None:
            self._controller.reset()

    def step(self, t: float, measurement: Measurement) -> np.ndarray:
        """The controller's answer.

        Raises
        ------
        Over
            When the outcome is known.
        """
        self._look(t, measurement)
        if self._controller is None:
            u = self._rest.inputs
        else:
            u = np.asarray(ask(self._controller, t, self.dt, measurement), float)
        self._count(u, measurement.inputs)
        return u

    def _look(self, t: float, measurement: Measurement) -> None:
        nodes, rest = measurement.nodes, self._rest
        if not self._dynamics.structure.held.any():
            frame = best_fit(rest.potential, rest.nodes, nodes, measurement.velocities)
            nodes, self._turning = frame.nodes(nodes), float(np.linalg.norm(frame.spin))
        error = float(np.linalg.norm(nodes - rest.nodes, axis=1).max())
        slack = self._taut & (measurement.tensions <= 0)
        self.time, self.peak = t, max(self.peak, error)
        self.slack |= slack
        self.slack_samples += bool(slack.any())
        self.samples += 1
        if self._collide and self._met(t, measurement):
            raise Over("rods meet")
        if t >= self._after * (1 - 1e-12):
            self._seen.append((t, error, nodes))
            self._judge(t, slack)

    def _judge(self, t: float, slack: np.ndarray) -> None:
        """Whether what was seen since the disturbance ended, for the last `hold` s, decides."""
        begun = self._seen[0][0]
        while t - self._seen[0][0] > self._hold * (1 + 1e-9):
            self._seen.popleft()
        if t - begun < self._hold * (1 - 1e-9):
            return
        errors = [error for _, error, _ in self._seen]
        if max(errors) <= self._within:
            raise Over("")
        if min(errors) > self._within:
            places = np.array([nodes for _, _, nodes in self._seen])
            moved = np.linalg.norm(np.ptp(places, axis=0), axis=1).max()
            still_to_move = moved * (self._t_end - t) / self._hold
            if moved <= _STILL * self._within and still_to_move < min(errors) - self._within:
                raise Over(self._elsewhere(slack))

    def _elsewhere(self, slack: np.ndarray) -> str:
        """What keeps it away."""
        if self._turning * self._hold > _TURNED:
            return "deformed by its spin"
        return "rests elsewhere, slack" if slack.any() else "another equilibrium"

    def _met(self, t: float, now: Measurement) -> bool:
        before, self._before = self._before, (t, now.nodes, now.velocities)
        if before is None or len(self._rods.ends) < 2:
            return False
        time, nodes, velocities = (np.array(pair) for pair in zip(before, self._before, strict=True))
        found = clearance(time, nodes, velocities, self._rods)
        return bool(found.passings) or found.least < 0

    def _count(self, u: np.ndarray, now: np.ndarray) -> None:
        """Whether any input is at a limit: its rest length at the floor, or its speed at the largest."""
        if u.shape != now.shape:
            return  # the simulation says so
        lower, upper = self._bounds
        self.floor_samples += bool(((u <= lower) | (u >= upper)).any())
        self.rate_samples += bool((np.abs(u - now) >= self._reach * (1 - _AT)).any())
