"""Problems that a predictive controller meets: those of the steps of its own closed loop on the nonlinear structure."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tensctl.simulation import Load, control_steps, simulate
from tensctl.simulation.moving import Start
from tensctl.synthesis import MPC, Condensed
from tensctl.synthesis.limits import Limits
from tensctl.synthesis.qp import QP
from tensctl.synthesis.relaxed import relax

# Steps of a run whose problems are kept, evenly; one takes 20 kB at (3,1) with 20 stages.
_KEPT = 400
# A step that changes inputs by less than this part of what it may is at rest: residuals are rounding over rounding.
_STILL = 1e-6
# Turns by this part of a circle spread any number of points evenly.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class Posed:
    """The problem of one step.

    Attributes
    ----------
    condensed : Condensed
        Its matrices, one object for all steps of one linear model.
    limits : Limits
    qp : QP
        As it is solved: with slack on its tension rows where floors give way.
    relaxed : bool
        Whether they do.
    """

    condensed: Condensed
    limits: Limits
    qp: QP
    relaxed: bool


@dataclass(frozen=True, eq=False)
class Heard:
    """What was heard along a closed loop.

    Attributes
    ----------
    posed : tuple of Posed
        In the order of time, without those at rest.
    steps, relaxed : int
        Steps that had a problem, and those whose floors gave way.
    t_end : float, s
        How far the loop went.
    """

    posed: tuple[Posed, ...]
    steps: int
    relaxed: int
    t_end: float

    def some(self, most: int, *, relaxed: bool) -> tuple[Posed, ...]:
        """At most so many problems of one kind, spread over the loop, and so are the first few of them."""
        kind = [p for p in self.posed if p.relaxed == relaxed]
        count = min(most, len(kind))
        turns = np.argsort(np.argsort(_GOLDEN * np.arange(count) % 1.0))
        return tuple(kind[int((k + 0.5) * len(kind) / count)] for k in turns)


class _TimeIsUpError(Exception):
    """Ends a run from within its controller."""


class _Listener:
    """The controller, with the problems of its steps written down."""

    def __init__(self, mpc: MPC, every: int, seconds: float) -> None:
        self.mpc, self.dt, self.delay = mpc, mpc.dt, mpc.delay
        if hasattr(mpc, "sensors"):
            self.sensors = mpc.sensors  # pyright: ignore[reportAttributeAccessIssue]
        self._every, self._until = every, time.perf_counter() + seconds
        self.posed: list[Posed] = []

    def reset(self) -> None:
        """Begin anew."""
        self.mpc.reset()

    def step(self, t: float, measurement: Any) -> np.ndarray:
        """The controller's own command."""
        if time.perf_counter() > self._until and self.mpc.records:
            raise _TimeIsUpError
        wanted = len(self.mpc.records) % self._every == 0
        stated = self.mpc.statement(t, measurement) if wanted else None
        command = self.mpc.step(t, measurement)
        asks = np.abs(command - measurement.commands).max() > _STILL * self.mpc.rate_max * self.dt
        if stated is not None and asks:
            condensed, limits, hard = stated
            gave_way = self.mpc.records[-1].relaxed > 0
            qp = relax(hard, condensed.horizon) if gave_way else hard
            self.posed.append(Posed(condensed, limits, qp, gave_way))
        return command


def overhear(
    mpc: MPC, start: Start, *, t_end: float, pushes: Sequence[Load] = (), seconds: float = np.inf
) -> Heard:  # fmt: skip
    """Run the closed loop on the controller's own structure, for so many seconds of computing at most.

    Raises
    ------
    SimulationError
        A motion that cannot be followed.
    """
    every = int(np.ceil(control_steps(t_end, mpc.dt) / _KEPT))
    listener = _Listener(mpc, every, seconds)
    try:
        simulate(
            mpc.linear.dynamics, start, controller=listener, t_end=t_end, rate_max=mpc.rate_max, pushes=pushes
        )  # fmt: skip
    except _TimeIsUpError:
        t_end = mpc.records[-1].time
    return Heard(tuple(listener.posed), len(mpc.records), sum(r.relaxed > 0 for r in mpc.records), t_end)
