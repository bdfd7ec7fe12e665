"""What then happens: the nonlinear structure over time, alone or under a controller.

The controller is asked every `dt`; rest lengths ramp from where they are to its command, which they reach at the end of
the period, no faster than `rate_max` and never below their floors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, get_args

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.controller import Controller
from tensctl.simulation.disturbance import Disturbances, Push
from tensctl.simulation.moving import Moving, Start
from tensctl.simulation.plant import Method
from tensctl.simulation.run import Run

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
    rate_max: float = np.inf,
    pushes: Sequence[Push] = (),
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
    rate_max : float, m/s
        Fastest that a rest length can change.
    pushes : sequence of Push
    method : "auto", "splitting4", "dopri5"
    tol : float
        Accuracy wanted, over the size of the structure and a second: sets the step of the splitting integrator, and a
        hundredth of it is the error allowed in a step of the adaptive one.

    Raises
    ------
    SimulationError
        A start, time or controller that does not fit, or a motion that cannot be followed.
    """
    _check(tol, rate_max, method, controller)
    times = _times(t_end, timepts, controller, dt)
    moving = Moving(dynamics, start, method, tol)
    forces = Disturbances(dynamics, pushes)
    period = None if controller is None else _period(controller, dt)
    if controller is not None:
        controller.reset()
    edges = _edges(times, forces.edges, period)
    is_sample = np.zeros(edges.size, bool) if period is None else _samples(edges, period)
    is_record = np.isin(edges, times)
    for k, t in enumerate(edges):
        if controller is not None and is_sample[k] and period is not None:
            moving.command(controller, t, period, rate_max)
            if progress is not None:
                progress.advance()
        if is_record[k]:
            moving.record(t, controller)
        if k + 1 < edges.size:
            moving.advance(t, edges[k + 1], forces.at(0.5 * (t + edges[k + 1])))
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


def _edges(times: np.ndarray, pushes: np.ndarray, period: float | None) -> np.ndarray:
    """Every time at which something changes or is recorded, merged when they differ by rounding only."""
    end = times[-1]
    samples = np.zeros(0) if period is None else period * np.arange(control_steps(end, period))
    rest = np.concatenate([[0.0], samples, pushes])
    rest = rest[rest <= end * (1 + 1e-12)]
    near = np.abs(rest[:, None] - times[None]).min(axis=1, initial=np.inf) <= 1e-12 * max(end, 1e-300)
    merged = np.unique(np.concatenate([times, rest[~near]]))
    return merged[np.concatenate([[True], np.diff(merged) > 1e-12 * max(end, 1e-300)])]


def _samples(edges: np.ndarray, period: float) -> np.ndarray:
    phase = edges / period
    return np.abs(phase - np.rint(phase)) <= 1e-9
