"""How long the steps of a predictive controller take at worst, and what the bound on their work costs the motion.

    python benchmarks/mpc_in_time.py          # prints the table; some minutes
    python benchmarks/mpc_in_time.py --docs   # also renews it in docs/mpc.md
    python benchmarks/mpc_in_time.py --steps 1000

The free (3,1) shell, 24 inputs, N = 20, dt = 0.02 s, on the full structure. About every other second a force of 1 to
20 N pushes a node at random for 0.1 s: rates are at their limits then, and floors cannot always be kept. The same
motion is controlled twice: with the work of a search bounded, and with every search taken to its end. Times are
processor time from measurement to command, the check of the answer's KKT residual included.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page
from pushes import random_pushes

import tensctl as tc
from tensctl.synthesis.qp_primal import PrimalSolver
from tensctl.threads import one_blas_thread

DT, HORIZON, RATE = 0.02, 20, 0.5


class Timed:
    """The controller, with the processor time of each of its steps."""

    def __init__(self, mpc: tc.MPC) -> None:
        self.mpc, self.dt, self.times = mpc, mpc.dt, []

    @property
    def records(self):
        """Those of the controller."""
        return self.mpc.records

    def reset(self) -> None:
        """Begin anew."""
        self.mpc.reset()
        self.times = []

    def step(self, t, measurement):
        """The controller's command."""
        began = time.process_time()
        command = self.mpc.step(t, measurement)
        self.times.append(1e3 * (time.process_time() - began))
        return command


def rows_of(name: str, controller: Timed, run: tc.Run, rest: tc.Equilibrium) -> list[list[object]]:
    statuses = np.array([record.status for record in controller.records])
    kkt = np.array([record.kkt for record in controller.records])
    relaxed = np.array([record.relaxed for record in controller.records])
    times = np.array(controller.times)
    off = np.sqrt(((run.lengths - rest.lengths) ** 2).mean())
    rows = []
    for status, count in [("all", len(statuses)), *Counter(statuses.tolist()).most_common()]:
        own = np.ones(len(statuses), bool) if status == "all" else statuses == status
        spread = [f"{np.quantile(times[own], q):.2g}" for q in (0.5, 0.99)]
        end = [f"{1e3 * off:.2f}", f"{relaxed.mean():.3f}"] if status == "all" else ["", ""]
        rows.append([name, status, count, *spread, f"{times[own].max():.3g}", f"{np.nanmax(kkt[own]):.0e}", *end])
    return rows


@one_blas_thread()
def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--docs", action="store_true", help="renew the table of docs/mpc.md")
    arguments.add_argument("--steps", type=int, default=10_000)
    given = arguments.parse_args()
    scene = tc.Scene(structure=tc.shell(3, 1), tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    linear = tc.linearize(dynamics, rest, outputs=())
    times = DT * np.arange(given.steps)
    loads, rows = random_pushes(dynamics.structure.node_labels, float(times[-1])), []
    for name, work in (("bounded", None), ("to the end", 1e10)):
        mpc = tc.MPC(linear, horizon=HORIZON, dt=DT, rate_max=RATE)
        if work is not None:
            asked, piece = mpc.problem, mpc.piece_at(0.0)
            piece._solvers["primal", True] = PrimalSolver(asked.H, asked.rows, HORIZON, soft=True, work=work)
        controller = Timed(mpc)
        run = tc.simulate(dynamics, rest, controller=controller, timepts=times, pushes=loads, rate_max=RATE)
        rows += rows_of(name, controller, run, rest)
        for row in rows[-5:]:
            print(row, flush=True)
    head = [
        "searches",
        "answered by",
        "steps",
        "median, ms",
        "99 %",
        "worst",
        "largest KKT",
        "lengths off, mm",
        "missing, N",
    ]
    if given.docs:
        page.write("mpc.md", {"in time": page.table(head, rows)})


if __name__ == "__main__":
    main()
