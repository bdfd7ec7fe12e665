"""Every solver on the problems of one predictive controller: time and error, floors kept and floors relaxed.

    python benchmarks/mpc_solvers.py          # prints the table
    python benchmarks/mpc_solvers.py --docs   # also renews it in docs/mpc.md

Problems are those of closed loops on the full structure, 2 s under pushes from 5 to 50 N, dt = 0.02 s. A problem counts
as "kept" when it has a solution within all tension floors; the others are solved with their floors relaxed. The error
of an answer is the largest distance of its first input to DAQP's, which runs without a bound on its iterations here,
over what an input may change in a period. One core, one BLAS thread.
"""

from __future__ import annotations

import argparse
import os
import time

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page

import tensctl as tc
from tensctl.synthesis.qp import QP, Solver
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_solvers import SOLVERS, new_solver
from tensctl.synthesis.relaxed import relax
from tensctl.threads import one_blas_thread

_EVERY = 6  # of the problems of a loop, so many are left out between two
_ACCEPT = 1e-6


class Overheard:
    """A controller that keeps the problems of its steps."""

    def __init__(self, mpc: tc.MPC) -> None:
        self.mpc, self.dt, self.problems = mpc, mpc.dt, []

    def reset(self) -> None:
        """Begin anew."""
        self.mpc.reset()

    def step(self, t, measurement):
        """The controller's own command."""
        self.problems.append(self.mpc.statement(t, measurement)[2])
        return self.mpc.step(t, measurement)


def problems_of(pins: list[str], horizon: int) -> tuple[tc.MPC, list[QP]]:
    scene = tc.Scene(structure=tc.shell(3, 1, pins=pins), tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    heard = Overheard(tc.MPC(tc.linearize(dynamics, rest), horizon=horizon))
    rng = np.random.default_rng(0)
    tops = [label for label in dynamics.structure.node_labels if label.startswith(("P3", "P4"))]
    sizes = (5, 10, 20, 30, 40, 50)
    pushes = [
        tc.Push(node, tuple(size * rng.standard_normal(3)), 0.05 + 0.3 * k, 0.15 + 0.3 * k)
        for k, (node, size) in enumerate(zip(tops, sizes, strict=False))
    ]
    tc.simulate(dynamics, rest, controller=heard, t_end=2.0, pushes=pushes)
    return heard.mpc, heard.problems[::_EVERY]


def row(mpc: tc.MPC, name: str, solver: Solver, pairs: list[tuple[QP, np.ndarray]]) -> list[str]:
    reach, times, kkt, errors = mpc.rate_max * mpc.dt, [], [], []
    for qp, exact in pairs:
        began = time.perf_counter()
        found = solver.solve(qp)
        times.append(1e3 * (time.perf_counter() - began))
        if found.z is not None and found.kkt <= _ACCEPT:
            kkt.append(found.kkt)
            errors.append(np.abs(found.z[: exact.size] - exact).max() / reach)
    failed = len(pairs) - len(kkt)
    worst = [f"{max(values):.0e}" if values else "" for values in (kkt, errors)]
    return [name, f"{np.median(times):.3g}", f"{max(times):.3g}", *worst, f"{failed} of {len(pairs)}"]


@one_blas_thread()
def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--docs", action="store_true", help="renew the table of docs/mpc.md")
    asked, rows = arguments.parse_args(), []
    for name, pins in (("free", []), ("base pinned", ["P1_*_1"])):
        for horizon in (10, 20):
            mpc, problems = problems_of(pins, horizon)
            found = [(qp, DaqpSolver(qp).solve(qp)) for qp in problems]
            soft = [relax(qp, horizon) for qp, answer in found if answer.z is None]
            groups = {
                "kept": [(qp, answer.z) for qp, answer in found if answer.z is not None],
                "relaxed": [(qp, DaqpSolver(qp).solve(qp).z) for qp in soft],
            }
            for kind, known in groups.items():
                pairs = [(qp, z[: len(mpc.linear.inputs)]) for qp, z in known if z is not None]
                for solver_name in SOLVERS:
                    solver = new_solver(solver_name, mpc.problem, soft=kind == "relaxed")
                    rows.append([name, horizon, kind, *row(mpc, solver_name, solver, pairs)])
                    print(*rows[-1], sep="  ", flush=True)
    if asked.docs:
        head = ["(3,1) shell", "N", "floors", "solver", "median, ms", "worst, ms", "worst KKT", "worst error", "failed"]
        page.write("mpc.md", {"solvers": page.table(head, rows)})


if __name__ == "__main__":
    main()
