"""What then happens: the nonlinear structure over time, alone or under a controller.

The controller is asked every `dt`; rest lengths ramp from where they are to its command, which they reach at the end of
the period, no faster than `rate_max` and never below their floors; with actuator lag they follow that ramp. A
controller that has a `delay` needs so long to compute: its commands begin to act that much later.

Integrators stop at edges only: control samples, times at which a load begins, bends or ends, and ends of chunks that go
to disk. Recorded times in between are filled in, so recording does not change the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import get_args

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.complaint import shown
from tensctl.scene.given import argument, check_kind, endless, place, real
from tensctl.scene.values import Number
from tensctl.simulation.checked import check_counter, check_each, check_pushes
from tensctl.simulation.controller import Controller
from tensctl.simulation.course import Counter, follow, set_out
from tensctl.simulation.integrators import Method
from tensctl.simulation.loads import Load
from tensctl.simulation.moving import Start, started
from tensctl.simulation.request import Request
from tensctl.simulation.run import Run
from tensctl.simulation.schedule import Schedule
from tensctl.simulation.state import state_at
from tensctl.simulation.store import Store
from tensctl.simulation.times import ascends
from tensctl.threads import one_blas_thread

# Control period, s, of a controller that names none: the scene's own default.
_PERIOD = 0.02


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
    store: str | Path | None = None,
    chunk: int = 1000,
    progress: Counter | None = None,
) -> Run:
    """Run the nonlinear structure.

    Parameters
    ----------
    dynamics : Dynamics
    start : Equilibrium or (N, 3) nodes at rest, or either with (N, 3) velocities
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
    method : "auto", "splitting2", "splitting4", "splitting6", "dopri5", "rosenbrock", "cvodes", "idas"
        "auto" takes what fits the scene's damping and size; `Run.why` says why.
    tol : float
        Accuracy wanted, over the size of the structure and a second: sets the step of the splittings, and a
        hundredth of it is the error allowed in a step of the adaptive method.
    store : path, optional
        A netCDF file that is written while the run goes on, from which `resume` goes on after a break. Memory holds
        one chunk at a time, and what is returned is the last of them; `Run.load` reads them all.
    chunk : int
        Records that go to `store` together; the integrator stops at the last of them.

    Raises
    ------
    SimulationError
        A start, time or controller that does not fit, or a motion that cannot be followed.
    OutputError
        When `store` cannot be written.
    """
    check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    _check(tol, method, controller, progress)
    rate_max = dynamics.members.rate_max if rate_max is None else _speed(rate_max)
    check_pushes(pushes)
    check_each("schedule", schedule, Schedule, 'tc.Schedule("t5_1_1", [0, 1], [0, 0.05])')
    chunk = argument("chunk", chunk, Number("records", least=1, whole=True), SimulationError)
    period = period_of(controller, dt)
    if store is not None:
        store = place("store", store, 'a file such as "run.nc"', SimulationError)
    request = Request(
        _times(t_end, timepts, controller, dt), pushes, schedule, method, tol, rate_max,
        None if controller is None else period, None if store is None else chunk,
        _delay(controller, dt),
    )  # fmt: skip
    nodes, velocities, rest = started(dynamics, start)
    moving, course = set_out(dynamics, request, state_at(dynamics, nodes, velocities), rest)
    if controller is not None:
        controller.reset()
    moving.begin(course.edges[0])
    file = None if store is None else Store(store, dynamics, request)
    with one_blas_thread():
        return follow(moving, course, controller, progress, file)


def _speed(rate_max: float) -> float:
    if endless(rate_max):
        return rate_max
    return argument("rate_max", rate_max, Number("m/s", above=0), SimulationError)


def _check(tol: float, method: str, controller: Controller | None, progress: Counter | None) -> None:
    argument("tol", tol, Number(above=0, below=1), SimulationError)
    if not (isinstance(method, str) and method in get_args(Method)):
        raise SimulationError(f"method is {shown(method)}; one of {', '.join(get_args(Method))} is expected.")
    for call in () if controller is None else ("step", "reset"):
        if not callable(getattr(controller, call, None)):
            raise SimulationError(
                f"the controller has no {call}(); give an object with step(t, measurement) and reset()."
            )
    check_counter(progress)


def _times(t_end, timepts, controller, dt) -> np.ndarray:
    if t_end is not None:
        t_end = argument("t_end", t_end, Number("s", above=0), SimulationError)
    if timepts is not None:
        times = real("timepts", timepts, "finite times in ascending order, s,", SimulationError)
        if not ascends(times):
            raise SimulationError("timepts must be finite times in ascending order, in s.")
        if times[0] < 0:
            raise SimulationError(f"timepts start at {times[0]:g} s; a run starts at 0.")
        if t_end is not None and t_end < times[-1]:
            raise SimulationError(f"timepts end at {times[-1]:g} s, after t_end = {t_end:g} s.")
        return times
    if t_end is None:
        raise SimulationError("t_end = None: give the end of the run in s, > 0, or timepts.")
    step = t_end / 500 if controller is None else period_of(controller, dt)
    if controller is None:
        return np.linspace(0, t_end, 501)
    times = step * np.arange(int(np.floor(t_end / step * (1 + 1e-12))) + 1)
    # A sample at the end is the end, rounding aside.
    before = times if t_end - times[-1] > 1e-12 * t_end else times[:-1]
    return np.append(before, t_end)


def period_of(controller: Controller | None, dt: float | None) -> float:
    """The control period, s: as given, or the controller's own, or the default."""
    period = getattr(controller, "dt", None) if dt is None else dt
    try:
        return argument("dt", _PERIOD if period is None else period, Number("s", above=0), SimulationError)
    except SimulationError as wrong:
        raise SimulationError(f"the control period {wrong}") from None  # the controller's own, where none was given


def _delay(controller: Controller | None, dt: float | None) -> float:
    delay = 0.0 if controller is None else float(getattr(controller, "delay", 0.0))
    if controller is not None and not 0 <= delay <= period_of(controller, dt):
        raise SimulationError(f"the controller's delay is {delay} s; a time from 0 to its period is expected.")
    return delay
