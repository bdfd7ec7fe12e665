"""Exported controllers against Python: differences of commands and processor time of steps in the same closed loop.

    python benchmarks/export_c.py

The (3,1) mast, base pinned, horizon 10, 0.02 s, compiled with `cc -O2`. Times are of the process, which the machine's
other work does not count into; a first step that loads what it needs is left out of Python's. Commands are compared at
steps that both solve within their work, floors given way by both or by neither.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

import numpy as np

import tensctl as tc

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from compiled import CC, Compiled, flat
from support import random_motion, shell_scene, solved

OK, RELAXED, BOUNDED = 0, 1, 4
OUTCOMES = ("as designed", "relaxed", "fallback", "refused", "bounded")


class Both:
    """Both on the same measurements; C steers, Python goes on from its command."""

    def __init__(self, python, c):
        self.python, self.c, self.dt, self.delay = python, c, python.dt, python.delay
        self.sensors = getattr(python, "sensors", None)
        self.rows = []

    def reset(self):
        """Forget earlier steps."""
        self.python.reset()
        self.c.reset()

    def step(self, t, measurement):
        """The command of C."""
        seen = flat(measurement) if self.sensors is None else np.concatenate([measurement.values, measurement.inputs])
        began = process_time()
        wanted = self.python.step(t, measurement)
        middle = process_time()
        outcome, u = self.c.step(seen)
        ended_at = process_time()
        record, last = self.python.records[-1], self.c.last
        relaxed, ended = record.relaxed > 0, not record.status.endswith("bounded")
        alike = ended and outcome == (RELAXED if relaxed else OK)
        self.rows.append((outcome, alike, np.abs(u - wanted).max(), middle - began, ended_at - middle, last.iterations))
        self.python.restore(self.python.state() | {"command": u})
        return u


def measured(name, dynamics, start, controller, t_end=4.0):
    """Print one row."""
    with tempfile.TemporaryDirectory() as folder:
        made = tc.export_c(controller, folder)
        both = Both(controller, Compiled(Path(folder) / "controller.c", len(controller.linear.inputs)))
        tc.simulate(dynamics, start, controller=both, t_end=t_end, rate_max=controller.rate_max)
        remembered = static_bytes(Path(folder) / "controller.c")
    outcome, alike, apart, python, c, iterations = np.array(both.rows[1:]).T
    alike = alike == 1
    counts = ", ".join(f"{np.sum(outcome == k):.0f} {said}" for k, said in enumerate(OUTCOMES) if (outcome == k).any())
    print(f"{name}: {counts}; apart {apart[alike].max():.0e} m at {alike.sum()} steps that both solve;")
    for said, which in (("as designed", outcome == OK), ("relaxed", (outcome == RELAXED) | (outcome == BOUNDED))):
        if which.any():
            print(f"  {said}: C {spread(c[which])}, Python {spread(python[which])}")
    print(f"  changes of the active set {iterations.mean():.0f}, at most {iterations.max():.0f};", end=" ")
    print(f"remembers {remembered / 1e6:.2f} MB,", end=" ")
    print(f"tables {made.table_bytes / 1e6:.2f} MB, source {len(made.source) / 1e6:.1f} MB")


def static_bytes(source):
    """What the source remembers, by the size of its zeroed memory."""
    subprocess.run([*CC, "-std=c99", "-O2", "-c", str(source), "-o", str(source.with_suffix(".o"))], check=True)
    told = subprocess.run(["size", str(source.with_suffix(".o"))], capture_output=True, text=True, check=True).stdout
    return int(told.splitlines()[1].split()[2])


def spread(seconds):
    """Median and largest."""
    return f"{1e3 * np.median(seconds):.2f} ms, worst {1e3 * seconds.max():.2f}"


def main():
    """All rows."""
    dynamics, rest, linear = solved(shell_scene(pins=["P1_*_1"]))
    thrown = random_motion(rest.potential, np.random.default_rng(1), 0.02, 0.5)
    common = {"horizon": 10, "rate_max": 0.5}
    for floor in (0.1, 2.0):
        measured(f"floor {floor} N", dynamics, thrown, tc.MPC(linear, tension_min=floor, **common))
    longer = tc.MPC(linear, tension_min=0.1, horizon=20, rate_max=0.5)
    measured("floor 0.1 N, horizon 20", dynamics, thrown, longer)
    measured("floor 20 N", dynamics, thrown, tc.MPC(linear, tension_min=20.0, **common), t_end=0.5)
    measured("floor 0.1 N, delay 0.01 s", dynamics, thrown, tc.MPC(linear, tension_min=0.1, delay=0.01, **common))
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)
    measured("sensors", dynamics, rest, tc.OutputMPC(linear, eyes, tension_min=0.5, **common))
    path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), {"height_scale": 1.1, "duration": 1.0}, start=rest)
    measured("path", dynamics, rest, tc.MPC(linear, path=path, tension_min=0.5, **common))


main()
