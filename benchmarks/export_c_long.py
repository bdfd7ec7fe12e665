"""Ten thousand steps of exported predictive controllers beside Python's, in the same closed loop.

    python benchmarks/export_c_long.py          # prints the table; some minutes
    python benchmarks/export_c_long.py --docs   # also renews it in docs/export_c.md

The free (3,1) shell and the mast, its base pinned, N = 20, 0.02 s: a node is pushed by 1 to 20 N for 0.1 s about every
other second. One sample in a hundred has a node that is no number, and one in a hundred knows half of the inputs only.
C steers; Python is shown the same, and goes on from its own last plan with the command of C. A step is saturated where
an input changes as fast as it may, or is at its bound. Times are of the process.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import page
from pushes import random_pushes

import tensctl as tc

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from compiled import Compiled, flat
from support import shell_scene, solved

STEPS, DT, RATE = 10_000, 0.02, 0.5
SCENES = {"free shell": shell_scene(), "mast": shell_scene(pins=["P1_*_1"])}
# What the outcomes of C are called, and what Python's statuses end with; all others are optima with floors kept.
OUTCOMES = ("optimum", "relaxed", "fallback", "no measurement", "bounded")
HEAD = [
    "structure", "C ends with", "Python ends with", "steps", "saturated", "apart, m", "C: median, worst, ms", "Python",
]  # fmt: skip


@dataclass(frozen=True)
class Step:
    """One step of both: how each ended, by how much commands differ, m, and processor time, s."""

    c: str
    python: str
    apart: float
    saturated: bool
    c_time: float
    python_time: float


class Both:
    """Both on the same measurements; C steers."""

    def __init__(self, python: tc.MPC, c: Compiled) -> None:
        self.python, self.c, self.dt = python, c, python.dt
        self.delay, self.sensors = python.delay, None
        self.faults = np.random.default_rng(5)
        self.steps: list[Step] = []

    def reset(self) -> None:
        """Forget earlier steps."""
        self.python.reset()
        self.c.reset()

    def step(self, t: float, measurement: Any) -> np.ndarray:
        """The command of C."""
        seen = self._faulty(measurement)
        began = process_time()
        wanted = self.python.step(t, seen)
        middle = process_time()
        outcome, u = self.c.step(flat(seen))
        ended = process_time()
        status = self.python.records[-1].status
        kind = next((name for name in OUTCOMES[1:] if status.endswith(name)), OUTCOMES[0])
        hard = self.python.hard
        limits = measurement.inputs - hard.reach, measurement.inputs + hard.reach, hard.lower, hard.upper
        saturated = any(bool((u == limit).any()) for limit in limits)
        apart = float(np.abs(u - wanted).max())
        self.steps.append(Step(OUTCOMES[outcome], kind, apart, saturated, ended - middle, middle - began))
        self.python.restore(self.python.state() | {"command": u})
        return u

    def _faulty(self, measurement: Any) -> Any:
        chance = self.faults.random()
        if chance < 0.01:
            nodes = measurement.nodes.copy()
            nodes[self.faults.integers(len(nodes))] = np.nan
            return replace(measurement, nodes=nodes)
        if chance < 0.02:
            inputs = measurement.inputs.copy()
            inputs[::2] = np.nan
            return replace(measurement, inputs=inputs)
        return measurement


def spread(seconds: list[float]) -> str:
    """Median and largest, ms."""
    return f"{1e3 * np.median(seconds):.2f}, {1e3 * max(seconds):.1f}"


def rows() -> Iterator[list[object]]:
    """One row a structure and pair of endings."""
    for name, scene in SCENES.items():
        dynamics, rest, linear = solved(scene)
        mpc, t_end = tc.MPC(linear, horizon=20, dt=DT, rate_max=RATE), (STEPS - 1) * DT
        with tempfile.TemporaryDirectory() as folder:
            tc.export_c(mpc, folder)
            both = Both(mpc, Compiled(Path(folder) / "controller.c", len(linear.inputs)))
        pushes = random_pushes(dynamics.structure.node_labels, t_end)
        tc.simulate(dynamics, rest, controller=both, t_end=t_end, rate_max=RATE, pushes=pushes)
        for kinds in sorted({(step.c, step.python) for step in both.steps[1:]}):
            steps = [step for step in both.steps[1:] if (step.c, step.python) == kinds]
            yield [
                name, *kinds, len(steps), sum(step.saturated for step in steps),
                f"{max(step.apart for step in steps):.0e}", spread([step.c_time for step in steps]),
                spread([step.python_time for step in steps]),
            ]  # fmt: skip


if __name__ == "__main__":
    page.tell("export_c.md", "long", HEAD, rows())
