"""Tension floors near the edge of what can be kept: by whom problems are answered, and by how much floors give way.

    python benchmarks/floors_at_edge.py          # prints the table; some minutes
    python benchmarks/floors_at_edge.py --docs   # also renews it in docs/mpc.md
    python benchmarks/floors_at_edge.py --random # of 480 random problems below their edges: how many are kept

Ten times the free (3,1) shell is at rest but for a motion in a direction of its own. A linear programme finds the speed
up to which some plan keeps a floor of 2 N in every tendon; the problem is stated at parts of that speed, each without a
plan to begin at. Beside the answer: by how much floors give way at the first price alone, taken to the optimum. Times
are processor time of an answer, its KKT check included.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import page

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))
from edge_support import Thrown

from tensctl.synthesis.qp_primal import PrimalSolver
from tensctl.synthesis.relaxed import relax
from tensctl.threads import one_blas_thread

SEEDS, PARTS, HORIZONS = range(10), (-1e-1, -1e-2, -1e-3, -1e-4, -1e-6, 1e-3), (6, 10, 20)
RANDOM = [
    (6, range(40), {"floor": 2.0, "u_max": 0.01}), (6, range(40), {"floor": 1.0}),
    (10, range(20), {"floor": 3.0, "u_max": 0.02}), (10, range(20), {"floor": 0.5}),
]  # fmt: skip
HEAD = [
    "N", "part of the edge", "`dual`", "`primal`", "gives way", "bounded", "worst KKT", "bounded KKT",
    "most missing, N", "bounded, N", "at the first price, N", "median, ms", "most",
]  # fmt: skip


@one_blas_thread()
def row(cases: list[Thrown], patient: list[PrimalSolver], horizon: int, part: float) -> list[object]:
    """One distance from the edge, all directions."""
    words, found = [], []
    for thrown, whole in zip(cases, patient, strict=True):
        problem, limits, hard = thrown.mpc.statement(0.0, thrown.look(part))
        began = time.process_time()
        plan, status, kkt = thrown.mpc.piece_at(0.0).answer(limits)
        took = 1e3 * (time.process_time() - began)
        missing = limits.shortfall(problem, plan)
        status = status if missing > 1e-9 or status.endswith("bounded") else status.removesuffix(" relaxed")
        first = whole.solve(relax(hard, horizon))
        alone = (
            limits.shortfall(problem, first.z[: hard.f.size].reshape(plan.shape)) if first.status == "solved" else 0.0
        )
        words.append(status)
        found.append((kkt, missing, alone, took))
    kkt, missing, alone, took = np.array(found).T
    ended = np.array([status.endswith("bounded") for status in words])
    count = Counter(words)
    most = lambda values: f"{values.max(initial=0.0):.0e}"  # noqa: E731
    return [
        horizon, f"{1 + part:.6g}", count["dual"], count["primal"], count["primal relaxed"], count["primal bounded"],
        most(kkt[~ended]), most(kkt[ended]), most(missing[~ended]), most(missing[ended]), most(alone),
        f"{np.median(took):.2g}", f"{took.max():.2g}",
    ]  # fmt: skip


def rows():
    for horizon in HORIZONS:
        cases = [Thrown(seed, horizon) for seed in SEEDS]
        problem = cases[0].mpc.problem
        patient = [PrimalSolver(problem.H, problem.rows, horizon, soft=True, work=1e10)] * len(cases)
        for part in PARTS:
            yield row(cases, patient, horizon, part)


@one_blas_thread()
def at_random():
    """Problems with nodes 4 mm off, 1e-6 to 0.3 below their edges: by whom they are answered, how many lose floors."""
    for horizon, seeds, options in RANDOM:
        words, lost, worst, times = Counter(), 0, 0.0, []
        for seed in seeds:
            thrown = Thrown(seed, horizon, reach=4e-3, **options)
            for inside in 10.0 ** np.random.default_rng(seed).uniform(-6, -0.5, 4):
                problem, limits, _ = thrown.mpc.statement(0.0, thrown.look(-inside))
                began = time.process_time()
                plan, status, kkt = thrown.mpc.piece_at(0.0).answer(limits)
                times.append(1e3 * (time.process_time() - began))
                words[status], lost = words[status] + 1, lost + (limits.shortfall(problem, plan) > 0)
                worst = max(worst, kkt)
        print(
            f"N = {horizon}, {options}: {dict(words)}, {lost} lost, KKT to {worst:.0e}, "
            f"{np.median(times):.2g} ms in the median, {max(times):.2g} at most"
        )


if __name__ == "__main__":
    if "--random" in sys.argv[1:]:
        at_random()
    else:
        page.tell("mpc.md", "edge", HEAD, rows())
