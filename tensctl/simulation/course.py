"""The way of a run through time: from edge to edge, with what happens at each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.actuators import Actuators
from tensctl.simulation.controller import Controller, memory_of
from tensctl.simulation.integrators import choose_integrator
from tensctl.simulation.loads import Loads
from tensctl.simulation.moving import Moving
from tensctl.simulation.request import Request
from tensctl.simulation.run import Run
from tensctl.simulation.schedule import Plan, planned
from tensctl.simulation.store import Store


class Counter(Protocol):
    """What shows the progress of a run."""

    def advance(self, n: int = 1) -> None:
        """Count n more steps as done."""
        ...


@dataclass(frozen=True, eq=False)
class Course:
    """What happens when.

    Attributes
    ----------
    edges : (e,) s
        Times at which something changes.
    samples, ends : (e,) bool
        At which of them a controller is asked, and a chunk ends.
    acts : (e,) bool
        At which of them a command that took its time begins to act.
    plan : Plan
    period : float or None, s
        Of the controller.
    rest : (nt,) m
        Rest lengths at the start.
    """

    edges: np.ndarray
    samples: np.ndarray
    ends: np.ndarray
    acts: np.ndarray
    plan: Plan
    period: float | None
    rest: np.ndarray


def set_out(
    dynamics: Dynamics, request: Request, state: tuple[np.ndarray, np.ndarray], rest: np.ndarray
) -> tuple[Moving, Course]:
    """The structure at a state, before anything is asked of its actuators, and what lies ahead."""
    actuators = Actuators(dynamics.members, rest, request.rate_max)
    times, period = request.times, request.period
    plan = planned(dynamics, request.schedule, actuators, period is not None)
    choice = choose_integrator(dynamics, request.method, request.tol)
    moving = Moving(dynamics, choice, state, actuators, request.loads, times, request.chunk)
    changes = [Loads(dynamics, request.loads).edges, plan.edges, request.ends, _late(times[-1], period, request.delay)]
    edges = _edges(times, np.concatenate(changes), period)
    samples = np.zeros(edges.size, bool) if period is None else _samples(edges, period)
    acts = np.zeros_like(samples)
    if period is not None and request.delay > 0:
        acts = (edges >= request.delay * (1 - 1e-9)) & _samples(edges - request.delay, period)
    moving.delayed = request.delay > 0
    ends = np.isin(edges, request.ends)
    if ends.sum() < request.ends.size:
        raise SimulationError("two recorded times are one to rounding where a chunk ends; leave one of them out.")
    return moving, Course(edges, samples, ends, acts, plan, period, rest)


def follow(
    moving: Moving, course: Course, controller: Controller | None, progress: Counter | None, store: Store | None,
    begun: int = -1,
) -> Run:  # fmt: skip
    """Go from edge to edge; all that happens at edge number `begun` has happened already."""
    edges = course.edges
    for k in range(max(begun, 0), edges.size):
        if k > begun and course.acts[k] and course.period is not None:
            moving.act(course.period)
        if k > begun and controller is not None and course.samples[k] and course.period is not None:
            moving.command(controller, edges[k], course.period)
            if progress is not None:
                progress.advance()
        if k > begun and store is not None and course.ends[k]:
            state = moving.state() | memory_of(controller) | {"start": course.rest, "edge": np.asarray(k)}
            store.keep(moving.finished(controller), state)
            if k + 1 < edges.size:
                moving.turn(controller)
        if k + 1 < edges.size:
            course.plan.follow(moving.actuators, edges[k], edges[k + 1])
            moving.advance(edges[k], edges[k + 1])
    return moving.finished(controller)


def control_steps(t_end: float, period: float) -> int:
    """How many control steps a run takes, for progress bars."""
    return int(np.floor(t_end / period * (1 + 1e-12))) + 1


def _edges(times: np.ndarray, others: np.ndarray, period: float | None) -> np.ndarray:
    """Every time at which something changes; one that differs from a recorded time by rounding only is that time."""
    end = times[-1]
    samples = np.zeros(0) if period is None else period * np.arange(control_steps(end, period))
    edges = np.unique(np.concatenate([[0.0], samples, others]))
    edges = np.append(edges[edges < end], end)
    after = np.searchsorted(times, edges).clip(max=times.size - 1)
    before = (after - 1).clip(min=0)
    nearest = np.where(edges - times[before] <= times[after] - edges, times[before], times[after])
    edges = np.unique(np.where(np.abs(nearest - edges) <= 1e-12 * max(end, 1e-300), nearest, edges))
    edges = edges[np.concatenate([[True], np.diff(edges) > 1e-12 * max(end, 1e-300)])]
    edges[-1] = end  # not an edge just before it: what is recorded at the end would never be reached
    return edges


def _late(end: float, period: float | None, delay: float) -> np.ndarray:
    """When commands begin to act that take their time."""
    if period is None or not delay:
        return np.zeros(0)
    times = delay + period * np.arange(control_steps(end, period))
    return times[times <= end]


def _samples(edges: np.ndarray, period: float) -> np.ndarray:
    phase = edges / period
    return np.abs(phase - np.rint(phase)) <= 1e-9
