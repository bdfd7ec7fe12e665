"""A predictive controller over 100 000 steps that nobody would wish for: what it keeps, and what it says of the rest.

    python benchmarks/mpc_long.py          # prints the counts; some twenty minutes
    python benchmarks/mpc_long.py --docs   # also renews them in docs/mpc.md
    python benchmarks/mpc_long.py --steps 5000

The (3,1) mast on its pinned base, N = 10, dt = 0.02 s, on the full structure. About every other second a force of 1 to
20 N pushes a node at random for 0.1 s. For 1.2 s of every 20 s the reference cannot be reached: rest lengths, tensions
and nodes that belong to no equilibrium, anew every 0.4 s, some below the floors of rest lengths. One sample in fifty
never comes, one in fifty holds NaN or infinite numbers, one in fifty does not know the inputs, and about once a minute
nothing is measured for half a second. Commands are judged as they leave the controller and rest lengths as the
structure has them: floors to the last bit, rates to 1e-9 of them. Whether a plan keeps the tension floors is computed
again beside the controller, and what its record does not tell is counted.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from dataclasses import dataclass, field, replace

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page
from pushes import random_pushes

import tensctl as tc
from tensctl.synthesis.reference import Hold
from tensctl.threads import one_blas_thread

DT, HORIZON, RATE = 0.02, 10, 0.5
# Part of a rate that rounding adds where it is computed as a difference of lengths over one of times near 2000 s.
_ROUNDING = 1e-9
# Missing tension, N, that counts as told: solvers keep their rows to 1e-10 m, at 100 N/m.
_TOLD = 1e-6


@dataclass(frozen=True, eq=False)
class Wild(Hold):
    """Holds an equilibrium, and asks now and then for what no structure can do."""

    ends = np.inf

    def _noise(self, t: float | np.ndarray, size: int) -> np.ndarray:
        """Numbers for each time, the same for 0.4 s, and 0 while the equilibrium is asked for."""
        drawn = np.zeros((np.size(t), size))
        for row, s in zip(drawn, np.ravel(t), strict=True):
            if s % 20.0 >= 18.8:
                row[:] = np.random.default_rng(int(s // 0.4)).standard_normal(size)
        return drawn.reshape(*np.shape(t), size)

    def inputs_at(self, t):
        """Rest-length changes, m."""
        return super().inputs_at(t) + 0.4 * self._noise(t, self.equilibrium.inputs.size)

    def tensions_at(self, t):
        """Tensions, N."""
        return super().tensions_at(t) + 10 * self._noise(t, self.equilibrium.tensions.size)

    def nodes_at(self, t):
        """Nodes, m."""
        manifold = self.equilibrium.potential.manifold
        return manifold.retract(self.equilibrium.nodes, 0.2 * self._noise(t, manifold.size))


@dataclass(eq=False)
class Watched:
    """The controller behind faulty sensors; keeps what it was told and what it answered."""

    mpc: tc.MPC
    total: int
    dt: float = DT
    faults: Counter = field(default_factory=Counter)
    commands: list[np.ndarray] = field(default_factory=list)
    before: list[np.ndarray] = field(default_factory=list)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))
    silent: int = 0
    untold: int = 0

    @property
    def records(self):
        """Those of the controller."""
        return self.mpc.records

    @property
    def dynamics(self) -> tc.Dynamics:
        """What it was made for."""
        return self.mpc.linear.dynamics

    def reset(self) -> None:
        """Begin anew."""
        self.mpc.reset()

    def step(self, t, measurement):
        """The controller's command, from a sample as it came through."""
        shown = self._through(measurement)
        self.before.append(measurement.inputs)
        self.commands.append(self.mpc.step(t, shown))
        if self.records[-1].status != "no measurement":
            self.untold += (
                self._missing(t, replace(shown, inputs=measurement.inputs)) > self.records[-1].relaxed + _TOLD
            )
        if len(self.commands) % (self.total // 20) == 0:
            print(f"{len(self.commands)} steps, {dict(Counter(r.status for r in self.records))}", flush=True)
        return self.commands[-1]

    def _missing(self, t, measurement) -> float:
        """Largest tension, N, that the plan of this step leaves missing at the end of any period ahead."""
        problem, limits, _ = self.mpc.statement(t, measurement)
        ahead = self.mpc.linear.dynamics.members.input_bounds[1] - limits.input_upper
        return limits.shortfall(problem, self.mpc.state()["plan"] - ahead)

    def _through(self, measurement):
        chance = self.rng.random()
        self.silent = 25 if chance > 1 - DT / 60 else max(self.silent - 1, 0)
        if self.silent or chance < 0.02:
            self.faults["no sample"] += 1
            return None
        if chance < 0.04:
            self.faults["NaN or infinite"] += 1
            nodes, velocities = measurement.nodes.copy(), measurement.velocities.copy()
            spoilt = nodes if chance < 0.03 else velocities
            spoilt[self.rng.random(spoilt.shape) < 0.2] = np.nan if chance < 0.035 else np.inf
            spoilt[-1] = np.nan
            return replace(measurement, nodes=nodes, velocities=velocities)
        if chance < 0.06:
            self.faults["inputs unknown"] += 1
            return replace(measurement, inputs=np.full_like(measurement.inputs, np.nan))
        return measurement


def broken(watched: Watched, run: tc.Run) -> dict[str, int]:
    """How often each hard limit was broken."""
    members, commands = watched.dynamics.members, np.array(watched.commands)
    lower, upper = members.input_bounds
    asked = np.abs(commands - np.array(watched.before)) / DT
    rates = np.abs(np.diff(run.rest_lengths, axis=0)) / np.diff(run.time)[:, None]
    return {
        "commands that are no finite numbers": int((~np.isfinite(commands)).any(axis=1).sum()),
        "commands beyond a rest-length floor": int(((commands > upper) | (commands < lower)).any(axis=1).sum()),
        "commands beyond the rate limit": int((asked > RATE * (1 + _ROUNDING)).any(axis=1).sum()),
        "samples with a rest length below its floor": int((run.rest_lengths < members.floors).any(axis=1).sum()),
        "periods with a rest length faster than the limit": int((rates > RATE * (1 + _ROUNDING)).any(axis=1).sum()),
    }


def rows_of(watched: Watched, run: tc.Run, seconds: float) -> list[list[object]]:
    records, members = watched.records, watched.mpc.linear.dynamics.members
    times = 1e3 * np.array([r.solve_time for r in records])
    relaxed, kkt = np.array([r.relaxed for r in records]), np.array([r.kkt for r in records])
    floors = (np.array(watched.commands) >= members.input_bounds[1]).any(axis=1).sum()
    fastest = (np.abs(np.diff(run.rest_lengths, axis=0)) / DT > 0.999 * RATE).any(axis=1).sum()
    quantiles = ", ".join(f"{q}: {np.quantile(times, float(q)):.3g}" for q in ("0.5", "0.9", "0.99", "0.999"))
    answers = Counter(r.status for r in records)
    return [
        ["control steps, of the nonlinear structure", len(records)],
        ["exceptions", 0],
        *broken(watched, run).items(),
        *([f"samples: {name}", count] for name, count in watched.faults.items()),
        *([f"steps answered: {name}", count] for name, count in answers.most_common()),
        ["steps with a relaxed tension floor", int((relaxed > 0).sum())],
        ["plans that miss a tension floor by more than their record tells", watched.untold],
        ["relaxed by at most, N", f"{relaxed.max():.3g}"],
        ["steps at a rest-length floor", int(floors)],
        ["periods at the rate limit", int(fastest)],
        ["largest KKT residual of an answer", f"{np.nanmax(kkt):.0e}"],
        ["time of a step, ms, by quantile", f"{quantiles}, worst: {times.max():.3g}"],
        ["the whole run, s of computing for s of motion", f"{seconds:.0f} for {run.time[-1]:.0f}"],
    ]


@one_blas_thread()
def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--docs", action="store_true", help="renew the table of docs/mpc.md")
    arguments.add_argument("--steps", type=int, default=100_000)
    asked = arguments.parse_args()
    scene = tc.Scene(structure=tc.shell(3, 1, pins=["P1_*_1"]), tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    mpc = tc.MPC(tc.linearize(dynamics, rest), horizon=HORIZON, dt=DT, rate_max=RATE, path=Wild(rest))
    watched, t_end = Watched(mpc, asked.steps), DT * (asked.steps - 1)
    began = time.perf_counter()
    tops = [label for label in dynamics.structure.node_labels if label.startswith(("P2", "P3", "P4"))]
    loads, times = random_pushes(tops, t_end), DT * np.arange(asked.steps)
    run = tc.simulate(dynamics, rest, controller=watched, timepts=times, pushes=loads)
    rows = rows_of(watched, run, time.perf_counter() - began)
    for name, value in rows:
        print(f"{name:60} {value}")
    if asked.docs:
        page.write("mpc.md", {"long": page.table(["what", "how often"], rows)})


if __name__ == "__main__":
    main()
