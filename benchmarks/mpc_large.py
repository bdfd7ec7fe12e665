"""Steps of a predictive controller with 304 inputs while limits act: who answers, and how long it takes.

    python benchmarks/mpc_large.py          # prints the table; ten minutes
    python benchmarks/mpc_large.py --docs   # also renews it in docs/mpc.md

The free (8,4) shell, 304 tendons, N = 10, 3040 variables, dt = 0.02 s, at most 0.5 m/s, on the full structure. About
twice a second the whole top ring is pushed for 0.1 s with 1 to 20 N on each node, or every node of the shell, each in a
direction of its own. Times are processor time from measurement to command, the check of the KKT residual included; only
steps at which a limit acts are counted.
"""

from __future__ import annotations

import argparse
import os
import time

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page
from mpc_in_time import DT, RATE, Timed
from mpc_solvers import shell
from pushes import ring_pushes

import tensctl as tc
from tensctl.synthesis.piece import Piece
from tensctl.threads import one_blas_thread


class Counting:
    """Counts the limits that act in the last answer of each step."""

    def __init__(self, piece: Piece) -> None:
        self.found, ask = [], piece.ask

        def counted(name, qp, *, soft):
            answer = ask(name, qp, soft=soft)
            self.last = 0 if answer.y is None else int(np.count_nonzero(answer.y))
            return answer

        object.__setattr__(piece, "ask", counted)
        self.last = 0


class Watched(Timed):
    """The controller, with times and acting limits of its steps."""

    def __init__(self, mpc: tc.MPC) -> None:
        super().__init__(mpc)
        self.counting, self.acting = Counting(mpc.piece_at(0.0)), []

    def step(self, t, measurement):
        """The controller's command."""
        command = super().step(t, measurement)
        self.acting.append(self.counting.last)
        return command


def rows_of(pushed: str, first: str, controller: Watched) -> list[list[object]]:
    statuses = np.array([record.status for record in controller.records])
    kkt = np.array([record.kkt for record in controller.records])
    times, acting = np.array(controller.times), np.array(controller.acting)
    rows = []
    for status in ["all", *dict.fromkeys(statuses[acting > 0].tolist())]:
        own = (acting > 0) & ((statuses == status) | (status == "all"))
        limits = f"{np.median(acting[own]):.0f}", acting[own].max()
        spread = [f"{value:.3g}" for value in (np.median(times[own]), times[own].max())]
        rows.append([pushed, first, status, own.sum(), *limits, *spread, f"{np.nanmax(kkt[own]):.0e}"])
    return rows


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", action="store_true", help="renew the table of docs/mpc.md")
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--first", nargs="+", default=["dual", "daqp"], help="solvers that are asked first")
    asked = parser.parse_args()
    linear, rows = shell(8, 4, []), []
    times, nodes = DT * np.arange(asked.steps), linear.dynamics.structure.node_labels
    for first in asked.first:
        began = time.process_time()
        mpc = tc.MPC(linear, horizon=10, dt=DT, rate_max=RATE, solver=first)
        print(f"{first} is set up in {time.process_time() - began:.3g} s", flush=True)
        for pushed in ("top ring", "every node")[: 2 if first == "dual" else 1]:
            mpc.reset()
            controller, loads = Watched(mpc), ring_pushes(nodes, float(times[-1]), every_node=pushed == "every node")
            tc.simulate(
                linear.dynamics, linear.equilibrium, controller=controller, timepts=times, pushes=loads, rate_max=RATE
            )  # fmt: skip
            rows += rows_of(pushed, first, controller)
            for row in rows:
                print(row, flush=True)
    if asked.docs:
        head = ["pushed", "asked first", "answered by", "steps", "limits, median", "most", "median, ms", "worst", "KKT"]
        page.write("mpc.md", {"large": page.table(head, rows)})


if __name__ == "__main__":
    main()
