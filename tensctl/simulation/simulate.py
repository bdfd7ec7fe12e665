"""What then happens: the nonlinear structure over time, alone or under a controller.

The controller is asked every `dt`; rest lengths ramp from where they are to its command, which they reach at the end of
the period, no faster than `rate_max` and never below their floors; with actuator lag they follow that ramp.

Integrators stop at edges only: control samples, and times at which a load begins, bends or ends. Recorded times in
between are filled in, so recording does not change the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, get_args

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.actuators import Actuators
from tensctl.simulation.controller import Controller
from tensctl.simulation.integrators import Method, choose_integrator
from tensctl.simulation.loads import Load, Loads
from tensctl.simulation.moving import Moving, Start, started
from tensctl.simulation.run import Run
from tensctl.simulation.schedule import Schedule, planned
from tensctl.simulation.state import state_at

# Control period, s, of a controller that names none: the scene's own default.
_PERIOD = 0.02


class Counter(Protocol):
    """What shows the progress of a run."""

    def advance(self, n: int = 1) -> None:
        """Count n more steps as done."""
        ...


def simulate(
    dynamics: Dynamics,
    start: Start,
    *,
    controller: Controller | None = None,
    t_end: float | None = None,
    timepts: Sequence[float] | np.ndarray | None = None,
    dt: float | None = None,
    rate_max: float | None = None,
    pushes: Sequence[Load] = (),
    schedule: Sequence[Schedule] = (),
    method: Method = "auto",
    tol: float = 1e-10,
    progress: Counter | None = None,
) -> Run:
    """Run the nonlinear structure.

    Parameters
    ----------
    dynamics : Dynamics
    start : Equilibrium, (N, 3) nodes at rest, or (nodes, velocities)
        An equilibrium brings its rest lengths along.
    controller : optional
        An object with `step(t, measurement) -> u` and `reset()`.
    t_end : float, s
        End of the run; the last of `timepts` by default.
    timepts : (t,) s, optional
        Times to record; every control sample, or 500 steps without a controller, by default.
    dt : float, s, optional
        Control period; the controller's own `dt` by default, 0.02 s when it has none.
    rate_max : float, m/s, optional
        Fastest that a command can change a rest length; the scene's `actuators.rate_max` by default.
    pushes : sequence of Push, Wave or History
        Forces on nodes over time.
    schedule : sequence of Schedule
        Rest-length changes planned ahead, for runs without a controller.
    method : "auto", "splitting2", "splitting4", "splitting6", "dopri5"
        "auto" takes what fits the scene's damping and size; `Run.why` says why.
    tol : float
        Accuracy wanted, over the size of the structure and a second: sets the step of the splittings, and a
        hundredth of it is the error allowed in a step of the adaptive method.

    Raises
    ------
    SimulationError
        A start, time or controller that does not fit, or a motion that cannot be followed.
    """
    rate_max = dynamics.members.rate_max if rate_max is None else rate_max
    _check(tol, rate_max, method, controller)
    times = _times(t_end, timepts, controller, dt)
    nodes, velocities, rest = started(dynamics, start)
    state = state_at(dynamics, nodes, velocities)
    actuators = Actuators(dynamics.members, rest, rate_max)
    plan = planned(dynamics, schedule, actuators, controller is not None)
    moving = Moving(dynamics, choose_integrator(dynamics, method, tol), state, actuators, pushes, times)
    period = None if controller is None else _period(controller, dt)
    if controller is not None:
        controller.reset()
    edges = _edges(times, np.concatenate([Loads(dynamics, pushes).edges, plan.edges]), period)
    is_sample = np.zeros(edges.size, bool) if period is None else _samples(edges, period)
    moving.begin(edges[0])
    for k, t in enumerate(edges):
        if controller is not None and is_sample[k] and period is not None:
            moving.command(controller, t, period)
            if progress is not None:
                progress.advance()
        if k + 1 < edges.size:
            plan.follow(actuators, t, edges[k + 1])
            moving.advance(t, edges[k + 1])
    return moving.finished(controller)


def control_steps(t_end: float, period: float) -> int:
    """How many control steps a run takes, for progress bars."""
    return int(np.floor(t_end / period * (1 + 1e-12))) + 1


def _check(tol: float, rate_max: float, method: str, controller: Controller | None) -> None:
    if not (np.isfinite(tol) and 0 < tol < 1):
        raise SimulationError(f"tol is {tol}; a number between 0 and 1 is expected.")
    if not rate_max > 0:
        raise SimulationError(f"rate_max is {rate_max}; a speed > 0 m/s is expected.")
    if method not in get_args(Method):
        raise SimulationError(f'method is "{method}"; one of {", ".join(get_args(Method))} is expected.')
    for call in () if controller is None else ("step", "reset"):
        if not callable(getattr(controller, call, None)):
            raise SimulationError(
                f"the controller has no {call}(); give an object with step(t, measurement) and reset()."
            )


def _times(t_end, timepts, controller, dt) -> np.ndarray:
    if timepts is not None:
        times = np.asarray(timepts, float)
        if times.ndim != 1 or times.size == 0 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise SimulationError("timepts must be finite times in ascending order, in s.")
        if times[0] < 0:
            raise SimulationError(f"timepts start at {times[0]:g} s; a run starts at 0.")
        if t_end is not None and t_end < times[-1]:
            raise SimulationError(f"timepts end at {times[-1]:g} s, after t_end = {t_end:g} s.")
        return times
    if t_end is None or not (np.isfinite(t_end) and t_end > 0):
        raise SimulationError(f"t_end = {t_end}: give the end of the run in s, > 0, or timepts.")
    step = t_end / 500 if controller is None else _period(controller, dt)
    count = int(np.floor(t_end / step * (1 + 1e-12)))
    return np.unique(np.append(step * np.arange(count + 1), t_end)) if controller else np.linspace(0, t_end, 501)


def _period(controller: Controller, dt: float | None) -> float:
    period = getattr(controller, "dt", None) if dt is None else dt
    period = _PERIOD if period is None else period
    if not (np.isfinite(period) and period > 0):
        raise SimulationError(f"the control period dt is {period}; a time > 0 s is expected.")
    return float(period)


def _edges(times: np.ndarray, others: np.ndarray, period: float | None) -> np.ndarray:
    """Every time at which something changes; one that differs from a recorded time by rounding only is that time."""
    end = times[-1]
    samples = np.zeros(0) if period is None else period * np.arange(control_steps(end, period))
    edges = np.unique(np.concatenate([[0.0], samples, others]))
    edges = np.append(edges[edges < end], end)
    nearest = times[np.abs(times[:, None] - edges[None]).argmin(axis=0)]
    edges = np.unique(np.where(np.abs(nearest - edges) <= 1e-12 * max(end, 1e-300), nearest, edges))
    return edges[np.concatenate([[True], np.diff(edges) > 1e-12 * max(end, 1e-300)])]


def _samples(edges: np.ndarray, period: float) -> np.ndarray:
    phase = edges / period
    return np.abs(phase - np.rint(phase)) <= 1e-9
