"""Error against run time of every solver of predictive control: nominal, stiff, and at 304 inputs.

    python benchmarks/mpc_solvers.py                  # prints tables; half an hour
    python benchmarks/mpc_solvers.py --docs           # also renews tables and plot of docs/mpc.md
    python benchmarks/mpc_solvers.py --cases nominal --rows FILE   # these alone; rows are kept in FILE and not redone

Problems are those of closed loops on the full structure, 100 periods under six pushes from 5 to 50 N. "nominal" is the
free (3,1) shell with k = 100 N/m and dt = 0.02 s. In "stiff" its tendons t5 are 1e9 times stiffer, with rest lengths
such that shape and tensions stay: frequencies spread over 5 decades. There dt = 0.02 s with `modes = "truncate"`, 50
periods; in "stiff, all modes" dt is as short as the fastest mode asks for, 4 us. "(8,4)" is the free shell of 304
tendons, 20 periods, with a push of 0.5 N. How errors are measured stands in `tensctl/accuracy/solvers.py`. Times are
processor time, one core, one BLAS thread.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page

import tensctl as tc
from tensctl.accuracy.overheard import Heard, overhear
from tensctl.accuracy.solver_result import SolverAttempt
from tensctl.accuracy.solvers import TOLERANCES, compared
from tensctl.linear import LinearModel
from tensctl.synthesis.qp_solvers import SOLVERS
from tensctl.threads import one_blas_thread

_STIFFER = 1e9
_MARKS = "oPX^sDv"
Case = tuple[tc.MPC, Heard]


def shell(n: int, m: int, pins: list[str], stiffer: float = 1.0) -> LinearModel:
    """The linear model at rest, tendons t5 stiffer and otherwise as at rest without."""
    structure = tc.shell(n, m, pins=pins)
    scene = tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    rest = tc.find_equilibrium(scene)
    if stiffer != 1:
        labels = rest.structure.tendon_labels
        k = np.array([100.0 * (stiffer if label.startswith("t5_") else 1.0) for label in labels])
        lengths = rest.lengths - rest.tensions / k
        tendons = {
            "stiffness": dict(zip(labels, k.tolist(), strict=True)),
            "rest_length": dict(zip(labels, lengths.tolist(), strict=True)),
        }
        scene = tc.Scene(structure=structure, tendons=tendons)
        rest = tc.find_equilibrium(scene, start=rest.nodes)
    return tc.linearize(tc.build_dynamics(scene), rest, outputs=())


def loop(mpc: tc.MPC, periods: int = 100, share: float = 1.0) -> Case:
    """What a controller is asked over some periods under pushes that last five of them."""
    rng, dt, structure = np.random.default_rng(0), mpc.dt, mpc.linear.dynamics.structure
    last = max(int(label[1 : label.index("_")]) for label in structure.node_labels)
    tops = [label for label in structure.node_labels if label.startswith((f"P{last - 1}_", f"P{last}_"))]
    pushes = [
        tc.Push(node, tuple(share * size * rng.standard_normal(3)), (2.5 + 15 * k) * dt, (7.5 + 15 * k) * dt)
        for k, (node, size) in enumerate(zip(tops, (5, 10, 20, 30, 40, 50), strict=False))
    ]
    return mpc, overhear(mpc, mpc.reference.equilibria[0], t_end=periods * dt, pushes=pushes)


def nominal(horizon: int) -> Case:
    return loop(tc.MPC(shell(3, 1, []), horizon=horizon))


def stiff(horizon: int) -> Case:
    return loop(tc.MPC(shell(3, 1, [], _STIFFER), horizon=horizon, modes="truncate"), 50)


def stiff_all(horizon: int) -> Case:
    linear = shell(3, 1, [], _STIFFER)
    fastest = np.sqrt(max(mode.omega2 for mode in linear.modes))
    return loop(tc.MPC(linear, horizon=horizon, dt=0.9 * np.pi / fastest))


def large(horizon: int) -> Case:
    return loop(tc.MPC(shell(8, 4, []), horizon=horizon), 20, 0.1)


CASES: dict[str, tuple[Callable[[int], Case], tuple[int, ...], tuple[str, ...], tuple[float, ...]]] = {
    "nominal": (nominal, (10, 20), (*SOLVERS, "cvxpy"), TOLERANCES),
    "stiff": (stiff, (10, 20), (*SOLVERS, "cvxpy"), TOLERANCES),
    "stiff, all modes": (stiff_all, (10, 20), (*SOLVERS, "cvxpy"), TOLERANCES),
    "(8,4)": (large, (10,), ("daqp", "piqp"), (1e-6,)),
}


def rows_of(case: str, horizon: int, share: float) -> list[dict]:
    make, _, solvers, tolerances = CASES[case]
    mpc, heard = make(horizon)
    budget = share * 2 * len(solvers) * len(tolerances)
    found = compared(mpc, heard, solvers=solvers, tolerances=tolerances, budget=budget)
    print(f"\n{case}, N = {horizon}\n{found.table()}", flush=True)
    return [{"case": case, "horizon": horizon, "dt": found.dt} | asdict(a) for a in found.attempts]


def table(rows: list[dict]) -> str:
    sized = ["KKT", "worst", "error", "worst", "failed"]
    head = ["problems", "N", "floors", "solver", "tol", "median, ms", "worst, ms", *sized]
    cells = []
    for row in rows:
        a = SolverAttempt(**{name: row[name] for name in SolverAttempt.__dataclass_fields__})
        sizes = [f"{v:.0e}" if np.isfinite(v) else "" for v in (a.kkt, a.worst_kkt, a.error, a.worst_error)]
        times = [f"{1e3 * v:.3g}" for v in (a.seconds, a.worst_seconds)]
        end = [a.failure, *[""] * 6] if a.failure else [*times, *sizes, f"{a.failures} of {a.asked}"]
        cells.append([row["case"], row["horizon"], a.floors, a.solver, f"{a.tol:.0e}", *end])
    return page.table(head, cells)


def plot(rows: list[dict]) -> None:
    """Worst error of the first input against the median time, one panel for each case and kind, N as size of marks."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "tensctl"
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 3, figsize=(8.4, 6.0), layout="constrained", sharex=True, sharey=True)
    names = (*SOLVERS, "cvxpy")
    shown = [(floors, case) for floors in ("kept", "relaxed") for case in list(CASES)[:3]]
    for axes, (floors, case) in zip(panels.flat, shown, strict=True):
        for k, name in enumerate(names):
            for horizon, dash in ((10, "-"), (20, "--")):
                key = (case, horizon, floors, name)
                own = [r for r in rows if (r["case"], r["horizon"], r["floors"], r["solver"]) == key]
                points = [(1e3 * r["seconds"], max(r["worst_error"], 1e-16)) for r in own if r["worst_error"] >= 0]
                axes.loglog(*np.reshape(points, (-1, 2)).T, _MARKS[k] + dash, color=f"C{k}", markersize=4, linewidth=1)
        axes.set_title(f"{case}, floors {floors}", fontsize=9)
        axes.grid(visible=True, which="major", alpha=0.3)
    figure.supxlabel("processor time of a solve, median, ms; N = 10 whole lines, N = 20 dashed", fontsize=9)
    figure.supylabel("worst error of the first input over its reach in a period", fontsize=9)
    handles = [plt.Line2D([], [], marker=_MARKS[k], color=f"C{k}", label=name) for k, name in enumerate(names)]
    figure.legend(handles=handles, loc="outside upper center", ncols=7, fontsize=8)
    figure.savefig(page.DOCS / "images" / "mpc_solvers.svg", metadata={"Date": None})


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", action="store_true", help="renew tables and plot of docs/mpc.md")
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--share", type=float, default=20.0, help="s for a solver, tolerance and kind of problem")
    parser.add_argument("--rows", type=Path, help="JSON lines of rows that are known; new ones are added")
    asked = parser.parse_args()
    text = asked.rows.read_text(encoding="utf-8") if asked.rows and asked.rows.exists() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    for case in asked.cases:
        for horizon in CASES[case][1]:
            if not any((row["case"], row["horizon"]) == (case, horizon) for row in rows):
                new = rows_of(case, horizon, asked.share)
                rows += new
                if asked.rows:
                    with asked.rows.open("a", encoding="utf-8") as file:
                        file.writelines(json.dumps(row) + "\n" for row in new)
    if asked.docs:
        plot(rows)
        page.write("mpc.md", {"solvers": table(rows)})


if __name__ == "__main__":
    main()
