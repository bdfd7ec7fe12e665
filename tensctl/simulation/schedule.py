"""Rest-length changes planned ahead: straight lines between given times, followed no faster than the rate limit.

u(t) interpolated linearly, held after the last time;   |dc/dt| <= rate_max moves the corners, and adds new ones
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.given import argument, real
from tensctl.scene.values import Text
from tensctl.simulation.actuators import Actuators
from tensctl.simulation.times import ascends
from tensctl.structure import matches


@dataclass(frozen=True)
class Schedule:
    """Planned rest-length change of a tendon.

    Attributes
    ----------
    tendon : str
        Label or pattern.
    times : (k,) s, ascending
    change : (k,) m
        u at these times, > 0 shortens.
    """

    tendon: str
    times: Sequence[float]
    change: Sequence[float]

    def __post_init__(self) -> None:
        """Check the table.

        Raises
        ------
        SimulationError
            Times that do not ascend, another number of changes, or what is no number.
        """
        argument("tendon", self.tendon, Text("a label or pattern"), SimulationError)
        of = f"of the schedule of {self.tendon}"
        times = real(f"times {of}", self.times, "a list of finite times, s,", SimulationError)
        change = real(f"change {of}", self.change, "a list of rest-length changes, m,", SimulationError)
        if not ascends(times):
            raise SimulationError(f"the times of the schedule of {self.tendon} must be finite and ascending, in s.")
        if change.shape != times.shape or not np.isfinite(change).all():
            raise SimulationError(
                f"the schedule of {self.tendon} has {times.size} times and changes of shape {change.shape}; "
                "one finite change a time is expected."
            )


@dataclass(frozen=True, eq=False)
class Plan:
    """Corners of every scheduled input, rate limit and floor kept.

    Attributes
    ----------
    corners : list of (input, times, change)
    """

    corners: tuple[tuple[int, np.ndarray, np.ndarray], ...]

    @property
    def edges(self) -> np.ndarray:
        """Times at which an input changes its speed, s."""
        return np.array([t for _, times, _ in self.corners for t in times if t > 0], float)

    def follow(self, actuators: Actuators, t0: float, t1: float) -> None:
        """Ask for the change at the end of an interval without a corner inside."""
        if not self.corners:
            return
        u = actuators.asked_inputs
        for place, times, change in self.corners:
            u[place] = np.interp(t1, times, change)
        actuators.command(u, t1 - t0)


def planned(dynamics: Dynamics, schedule: Sequence[Schedule], actuators: Actuators, controlled: bool) -> Plan:
    """The plan of a run.

    Raises
    ------
    SimulationError
        A schedule beside a controller, for a tendon without an actuator, or two for one tendon.
    """
    if schedule and controlled:
        raise SimulationError("a run has a schedule or a controller, not both; let the controller add the schedule.")
    members, inputs = dynamics.members, dynamics.input_labels
    names = list(dict.fromkeys([*dynamics.structure.tendon_labels, *inputs]))
    lower, upper = members.input_bounds
    corners: dict[int, tuple[int, np.ndarray, np.ndarray]] = {}
    start = actuators.asked_inputs
    for entry in schedule:
        for name in (names[k] for k in matches(names, entry.tendon, "schedule.tendon")):
            if name not in inputs:
                raise SimulationError(f"tendon {name} has no acting actuator of its own, so it takes no schedule.")
            place = inputs.index(name)
            if place in corners:
                raise SimulationError(f"tendon {name} has two schedules; give one.")
            change = np.clip(np.asarray(entry.change, float), lower[place], upper[place])
            rate_max = actuators.rate_max / members.gearing.largest[place]
            path = limited(np.asarray(entry.times, float), change, float(start[place]), rate_max)
            corners[place] = (place, *path)
    return Plan(tuple(corners.values()))


def limited(times: np.ndarray, change: np.ndarray, start: float, rate_max: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners of what follows a line of straight pieces from a start at time 0, no faster than a limit.

    Raises
    ------
    SimulationError
        A jump at the start without a rate limit to follow it.
    """
    if times[0] == 0 and change[0] != start and not np.isfinite(rate_max):
        raise SimulationError(
            f"a schedule begins with a change of {change[0]:g} m at 0 s where the tendon stands at {start:g} m; "
            "begin with that, or give a rate_max."
        )
    if times[0] > 0:
        times, change = np.concatenate([[0.0], times]), np.concatenate([[start], change])
    t, u = [0.0], [start]
    for k in range(times.size):
        ahead = times[k + 1] if k + 1 < times.size else np.inf
        slope = (change[k + 1] - change[k]) / (ahead - times[k]) if np.isfinite(ahead) else 0.0
        while t[-1] < ahead:
            gap = change[k] + slope * (t[-1] - times[k]) - u[-1]
            if gap == 0.0 and abs(slope) <= rate_max:
                if not np.isfinite(ahead):
                    break
                t.append(ahead)
                u.append(change[k + 1])
                continue
            speed = np.sign(gap) * rate_max if gap != 0.0 else np.sign(slope) * rate_max
            closing = speed - slope
            met = t[-1] + gap / closing if gap * closing > 0 else np.inf
            until = min(met, ahead)
            if not np.isfinite(until):
                break
            t.append(until)
            u.append(change[k] + slope * (until - times[k]) if until == met else u[-1] + speed * (until - t[-2]))
    return np.array(t), np.array(u)
