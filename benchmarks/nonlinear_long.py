"""Nonlinear MPC over many steps that nobody would wish for: what it keeps, and what it says of the rest.

    python benchmarks/nonlinear_long.py --docs          # 10 000 steps of (3,1), 2000 of Class 2; some ten minutes
    python benchmarks/nonlinear_long.py --steps 1000

The faults, pushes, references out of reach and hard limits are those of `mpc_long.py`: N = 10, dt = 0.02 s, the (3,1)
mast on its pinned base, and with a fifth of the steps the Class 2 mast (3,2), whose rods share nodes. Every plan is
rolled out once more from the sample: by how much tensions miss their floors there beyond what the record, which has the
linearised plan's, tells.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field

import mpc_long
import numpy as np
import page
from pushes import random_pushes

import tensctl as tc
from tensctl.threads import one_blas_thread


@dataclass(eq=False)
class Watched(mpc_long.Watched):
    """A nonlinear controller behind faulty sensors."""

    more: list[float] = field(default_factory=list)

    @property
    def dynamics(self) -> tc.Dynamics:
        """What it was made for."""
        return self.mpc.dynamics

    def _missing(self, t, measurement) -> float:
        """As told: what a roll-out misses beyond it is kept for itself."""
        plan, told = self.mpc.state()["plan"], self.records[-1].relaxed
        step = self.mpc.linearised(t, measurement, plan)
        missing = step.beyond(step.plan) * self.dynamics.members.stiffness[step.bounds.tendons]
        if step.rollout.finite:
            self.more.append(max(float(missing.max(initial=0.0)) - told, 0.0))
        return told


def counted(watched: Watched, run: tc.Run, seconds: float) -> dict[str, object]:
    """What happened, in words and numbers."""
    records = watched.records
    times, relaxed = 1e3 * np.array([r.solve_time for r in records]), max(r.relaxed for r in records)
    bounded = np.array([r.status.endswith("bounded") for r in records])
    kkt = np.array([r.kkt for r in records])
    more = ", ".join(f"{q:g}: {np.quantile(watched.more, q):.2g}" for q in (0.5, 0.9, 0.99, 1.0))
    steps = {f"steps answered: {name}": count for name, count in sorted(Counter(r.status for r in records).items())}
    return {
        "control steps, of the nonlinear structure": len(records),
        "exceptions": 0,
        **mpc_long.broken(watched, run),
        **{f"samples: {name}": watched.faults[name] for name in sorted(watched.faults)},
        **steps,
        "relaxed by at most, N": f"{relaxed:.3g}",
        "missed by a roll-out of the plan beyond what is told, N, by quantile": more,
        "largest KKT residual of an optimum": f"{np.nanmax(kkt[~bounded]):.0e}",
        "largest KKT residual of a bounded answer": f"{np.nanmax(kkt[bounded], initial=0.0):.0e}",
        "time of a step, ms: median, worst": f"{np.median(times):.3g}, {times.max():.3g}",
        "the whole run, s of computing for s of motion": f"{seconds:.0f} for {run.time[-1]:.0f}",
    }


@one_blas_thread()
def watched_run(structure: tc.Structure, steps: int) -> dict[str, object]:
    """Counts of one run."""
    scene = tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    mpc = tc.NonlinearMPC(
        dynamics, mpc_long.Wild(rest), horizon=mpc_long.HORIZON, dt=mpc_long.DT, rate_max=mpc_long.RATE
    )
    watched, t_end, began = Watched(mpc, steps), mpc_long.DT * (steps - 1), time.process_time()
    tops = [n for n, free in zip(structure.node_labels, structure.free.all(axis=1), strict=True) if free]
    times, pushes = mpc_long.DT * np.arange(steps), random_pushes(tops, t_end)
    run = tc.simulate(dynamics, rest, controller=watched, timepts=times, pushes=pushes)
    return counted(watched, run, time.process_time() - began)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--docs", action="store_true", help="renew the table of docs/nonlinear_mpc.md")
    arguments.add_argument("--steps", type=int, default=10_000)
    asked = arguments.parse_args()
    pinned = {"pins": ["P1_*_1"]}
    one = watched_run(tc.shell(3, 1, **pinned), asked.steps)
    two = watched_run(tc.shell(3, 2, cls=2, **pinned), asked.steps // 5)
    rows = [[name, one.get(name, 0), two.get(name, 0)] for name in dict.fromkeys([*one, *two])]
    for row in rows:
        print(*row, sep="  ")
    if asked.docs:
        page.write("nonlinear_mpc.md", {"long": page.table(["what", "(3,1)", "Class 2 (3,2)"], rows)})


if __name__ == "__main__":
    main()
