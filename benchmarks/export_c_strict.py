"""Exported controllers of every kind under all warnings of two compilers, and under the sanitizers while they run.

    python benchmarks/export_c_strict.py          # prints the table; a quarter of an hour
    python benchmarks/export_c_strict.py --docs   # also renews it in docs/export_c.md

The (3,1) mast is thrown about; Python steers it for 25 steps, and what it was shown is played to the C source, compiled
with the address and undefined-behaviour sanitizers. Commands are compared up to the first step that is bounded: from
there on each goes on from its own plan.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import page

import tensctl as tc

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from compiled import CC, STRICT, ZIG, played, sanitized
from support import random_motion, shell_scene, solved

from tensctl.synthesis import LQG

DT, DELAY, STEPS, HORIZONS = 0.02, 0.007, 25, (5, 10, 20)
TALLER = {"height_scale": 1.05, "duration": 0.3}
TIP = tc.Weights(outputs={"nodes:P4_1_1": 1e-2})
COURSES = tc.Courses({"P4_1_1_x": ([0.1, 0.3], [0.0, 0.02])})
BOUNDED = 4  # `TENSCTL_BOUNDED` of the header
HEAD = [
    "controller", "N", "source, MB", "warnings of cc", "of zig cc", "found by the sanitizers", "steps",
    "before one is bounded", "apart there, m",
]  # fmt: skip


def wavy(t: float) -> np.ndarray:
    """What the tip should do, m."""
    return 0.01 * np.sin(3 * t + np.arange(3))


# Options of predictive controllers; True stands for the path of the scene.
OPTIONS: dict[str, dict[str, Any]] = {
    "plain": {},
    "delay": {"delay": DELAY},
    "path, delay": {"path": True, "delay": DELAY},
    "lag": {"lag": True},
    "path, lag, delay": {"path": True, "lag": True, "delay": DELAY},
    "signal": {"signal": COURSES, "weights": TIP},
    "signal that is shown": {"signal": wavy, "weights": TIP},
}


class Case:
    """The mast, with lag or without, its path and its sensors."""

    def __init__(self, *, lag: bool) -> None:
        scene = shell_scene(pins=["P1_*_1"], **({"actuators": {"lag": 0.15}} if lag else {}))
        self.dynamics, self.rest, self.linear = solved(scene)
        self.path = tc.plan_shape(scene, TALLER, start=self.rest)
        self.sensors = tc.sensors(self.dynamics.structure, lengths=1e-4, tensions=1e-2, seed=3)


class Heard:
    """A controller, and all that it was shown as C reads it."""

    def __init__(
        self, controller: Any, horizon: int, signal: Callable[[float], np.ndarray] | None, *, lag: bool
    ) -> None:
        self.lag = lag
        self.controller, self.dt, self.horizon, self.signal = controller, controller.dt, horizon, signal
        self.sensors, self.delay = getattr(controller, "sensors", None), getattr(controller, "delay", 0.0)
        self.shown: list[np.ndarray] = []
        self.commands: list[np.ndarray] = []

    def reset(self) -> None:
        """Forget earlier steps."""
        self.controller.reset()

    def step(self, t: float, measurement: Any) -> np.ndarray:
        """The command of Python."""
        parts = ["nodes", "velocities"] if self.sensors is None else ["values"]
        parts += [] if self.lag and isinstance(self.controller, LQG) else ["inputs"]
        parts += ["commands"] if self.lag else []
        told = [np.asarray(getattr(measurement, name)).ravel() for name in parts]
        if self.signal is not None:
            told += [self.signal(t + self.delay + self.dt * k) for k in range(1, self.horizon + 1)]
        self.shown.append(np.concatenate(told))
        self.commands.append(self.controller.step(t, measurement))
        return self.commands[-1]


def warnings(compiler: list[str], source: Path) -> int:
    """How many a compiler has."""
    flags = [flag for flag in STRICT if flag != "-Werror"]
    command = [*compiler, *flags, "-c", str(source), "-o", str(source.with_suffix(".o"))]
    return subprocess.run(command, capture_output=True, text=True, check=True).stderr.count("warning:")


def row(name: str, case: Case, controller: Any, horizon: int = 0, signal: Any = None) -> list[object]:
    """One controller."""
    heard = Heard(controller, horizon, signal, lag=case.linear.actuated.lag > 0)
    start = random_motion(case.rest.potential, np.random.default_rng(1), 0.01, 0.3)
    tc.simulate(case.dynamics, start, controller=heard, t_end=(STEPS - 1) * DT, rate_max=2.0)
    with tempfile.TemporaryDirectory() as folder:
        made = tc.export_c(controller, folder)
        source = Path(folder) / "controller.c"
        told = warnings(CC, source), warnings(ZIG, source)
        try:
            outcomes, commands = played(sanitized(Path(folder)), np.array(heard.shown))
            found = 0
        except subprocess.CalledProcessError:
            outcomes, commands, found = np.zeros(0), np.zeros((0, 0)), 1
    ended = [record.status.endswith("bounded") for record in getattr(controller, "records", [])]
    bounded = [*np.flatnonzero(outcomes == BOUNDED), *np.flatnonzero(ended), len(outcomes)]
    alike = min(bounded)
    apart = f"{np.abs(commands[:alike] - heard.commands[:alike]).max():.0e}" if alike else "-"
    return [name, horizon or "", f"{len(made.source) / 1e6:.1f}", *told, found, len(outcomes), alike, apart]


def rows() -> Iterator[list[object]]:
    """One row a controller and horizon."""
    cases = {lag: Case(lag=lag) for lag in (False, True)}
    for lag, case in cases.items():
        said, linear = ", lag" if lag else "", case.linear
        yield row("LQR, sampled" + said, case, tc.lqr(linear, dt=DT))
        yield row("LQG" + said, case, tc.lqg(linear, case.sensors, dt=DT))
        scheduled = tc.scheduled_lqr(case.path, case.dynamics, lambda linear: tc.lqr(linear, dt=DT))
        yield row("LQR, scheduled" + said, case, scheduled)
    for horizon in HORIZONS:
        for name, asked in OPTIONS.items():
            case = cases["lag" in asked]
            given = {key: value for key, value in asked.items() if key not in ("path", "lag")}
            given |= {"path": case.path} if "path" in asked else {}
            given |= {"horizon": horizon, "dt": DT, "tension_min": 1.0, "rate_max": 2.0}
            signal = wavy if asked.get("signal") is wavy else None
            yield row(f"MPC, {name}", case, tc.MPC(case.linear, **given), horizon, signal)
            controller = tc.OutputMPC(case.linear, case.sensors, **given)
            yield row(f"OutputMPC, {name}", case, controller, horizon, signal)


if __name__ == "__main__":
    page.tell("export_c.md", "strict", HEAD, rows())
