"""Riccati equations and Gramians: error against run time of this project, SciPy and SLICOT.

python benchmarks/riccati_solvers.py              # prints the tables
python benchmarks/riccati_solvers.py --docs       # and writes them and the plot into docs/riccati.md
python benchmarks/riccati_solvers.py --sizes 48 200
python benchmarks/riccati_solvers.py --rows FILE  # what FILE holds is not measured again; new rows are added to it
python benchmarks/riccati_solvers.py --limit 600  # a row beyond 600 s of processor time is listed as cut off

Processor times with one BLAS thread. SLICOT joins when slycot is installed; it is GPL and no dependency. SciPy on the
Riccati equations of 2000 states takes half an hour. "Error" is the distance to a solution refined by Newton steps, each
with its residual in extended precision, over its norm, at up to 200 states.
"""

import argparse
import importlib.util
import json
import multiprocessing
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import page
import scipy.linalg as sla
from riccati import MODELS, Problem, problems

from tensctl.synthesis import care
from tensctl.synthesis.lyapunov import lyapunov
from tensctl.threads import one_blas_thread

REFINED_UP_TO = 200
# Damping ratio of every mode in the Gramians' loops.
DAMPING = 0.01
Solver = Callable[[Problem], np.ndarray]


@dataclass(frozen=True)
class Gramian(Problem):
    """A W + W A' + B R^-1 B' = 0 of the problem's modes with damping."""

    @classmethod
    def of(cls, given: Problem) -> "Gramian":
        """Every mode damped alike."""
        half = len(given.A) // 2
        A = given.A.copy()
        omega = np.abs(np.diag(A[:half, half:]))
        A[half:, half:] -= np.diag(2 * DAMPING * omega)
        return cls(given.data, A, given.B, given.Q, given.R)

    @property
    def drive(self) -> np.ndarray:
        """B R^-1 B'."""
        return self.B @ np.linalg.solve(self.R, self.B.T)

    def residual(self, X: np.ndarray) -> float:
        """Left side over the sum of the terms' norms."""
        terms = (self.A @ X, X @ self.A.T, self.drive)
        return float(np.linalg.norm(np.sum(terms, axis=0)) / sum(np.linalg.norm(term) for term in terms))


def refined(problem: Problem, X: np.ndarray) -> np.ndarray:
    """X after four Newton steps whose residuals are computed in extended precision."""
    wide = np.longdouble
    A, B, X = problem.A.astype(wide), problem.B.astype(wide), X.astype(wide)
    G = (B / np.diag(problem.R).astype(wide)) @ B.T
    gramian = isinstance(problem, Gramian)
    for _ in range(4):
        left = A @ X + X @ A.T + G if gramian else A.T @ X + X @ A - X @ G @ X + problem.Q
        loop = A if gramian else (A - G @ X).T
        X = X + sla.solve_continuous_lyapunov(loop.astype(float), -left.astype(float))
        X = (X + X.T) / 2
    return X


def slicot() -> dict[str, dict[str, Solver]]:
    """SLICOT's solvers with their options, or none."""
    if importlib.util.find_spec("slycot") is None:
        print("SLICOT is left out: slycot is not installed.")
        return {"Riccati": {}, "Gramian": {}}
    import slycot

    def schur(p: Problem, scal: str) -> np.ndarray:
        n, m = p.B.shape
        G = slycot.sb02mt(n, m, p.B, p.R)[-1]
        return slycot.sb02md(n, p.A, G, p.Q, "C", scal=scal)[0]

    def pencil(p: Problem) -> np.ndarray:
        return slycot.sb02od(*p.B.shape, p.A, p.B, p.Q, p.R, "C")[0]

    def covariance(p: Gramian) -> np.ndarray:
        X, scale = slycot.sb03md57(p.A.copy(), C=-p.drive, trana="T")[2:4]
        return X / scale

    def factor(p: Gramian) -> np.ndarray:
        n, m = p.B.shape
        B = np.zeros((n, n))  # the wrapper takes square factors
        B[:, : min(n, m)] = np.linalg.qr((p.B / np.sqrt(np.diag(p.R))).T, mode="r").T
        U, scale, _ = slycot.sb03od(n, n, p.A.copy(), np.zeros((n, n)), B, "C", trans="T")
        return U @ U.T / scale**2

    riccati = {"SLICOT sb02md": lambda p: schur(p, "N"), "SLICOT sb02md, scal": lambda p: schur(p, "G")}
    riccati["SLICOT sb02od"] = pencil
    return {"Riccati": riccati, "Gramian": {"SLICOT sb03md": covariance, "SLICOT sb03od": factor}}


def solvers() -> dict[str, dict[str, Solver]]:
    found = {
        "Riccati": {
            "tensctl": lambda p: care(p.A, p.B, p.Q, p.R).X,
            "SciPy": lambda p: sla.solve_continuous_are(p.A, p.B, p.Q, p.R),
            "SciPy, not balanced": lambda p: sla.solve_continuous_are(p.A, p.B, p.Q, p.R, balanced=False),
        },
        "Gramian": {
            "tensctl": lambda p: lyapunov(p.A, p.drive).X,
            "SciPy": lambda p: sla.solve_continuous_lyapunov(p.A, -p.drive),
        },
    }
    joined = slicot()
    return {name: own | joined[name] for name, own in found.items()}


def measured(problem: Problem, solve: Solver, exact: np.ndarray | None) -> dict:
    """Time, residual and error, or the sentence of the fault."""
    best, spent = np.inf, 0.0
    try:
        while spent < 0.05:
            began = time.process_time()
            X = solve(problem)
            took = time.process_time() - began
            best, spent = min(best, took), spent + max(took, 1e-6)
    except (ArithmeticError, ValueError) as fault:
        return {"fault": type(fault).__name__ + ": " + " ".join(str(fault).split())[:90]}
    row = {"time": best, "residual": problem.residual(X)}
    return row if exact is None else row | {"error": float(np.linalg.norm(X - exact) / np.linalg.norm(exact))}


def measured_within(limit: int, problem: Problem, solve: Solver, exact: np.ndarray | None) -> dict:
    """`measured` in a process of its own, which the system ends after `limit` seconds of processor time."""
    fork = multiprocessing.get_context("fork")
    here, there = fork.Pipe(duplex=False)

    def work() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
        there.send(measured(problem, solve, exact))

    process = fork.Process(target=work)
    process.start()
    there.close()
    try:
        return here.recv()
    except EOFError:
        return {"fault": f"cut off after {limit} s of processor time"}
    finally:
        process.join()


def rows_of(
    sizes: list[int], names: list[str] | None, known: list[dict], path: Path | None, limit: int | None
) -> list[dict]:
    """A row for each size, equation, kind of data and solver; new ones are added to the file at once."""
    rows = list(known)
    done = {(r["equation"], r["states"], r["data"], r["solver"]) for r in known}
    every = solvers()
    for states in sizes:
        for given in problems(states):
            for equation, problem in (("Riccati", given), ("Gramian", Gramian.of(given))):
                exact = refined(problem, every[equation]["tensctl"](problem)) if states <= REFINED_UP_TO else None
                for name, solve in every[equation].items():
                    key = (equation, states, problem.data, name)
                    if key in done or (names and name not in names):
                        continue
                    row = dict(zip(("equation", "states", "data", "solver"), key, strict=True))
                    found = measured_within(limit, problem, solve, exact) if limit else measured(problem, solve, exact)
                    rows.append(row | found)
                    print(rows[-1], flush=True)
                    if path:
                        with path.open("a", encoding="utf-8") as file:
                            file.write(json.dumps(rows[-1]) + "\n")
    return rows


def table(rows: list[dict], equation: str) -> str:
    """Rows of one equation, sorted by size; times over the project's own in the last column."""
    own = {
        (r["states"], r["data"]): r.get("time") for r in rows if (r["equation"], r["solver"]) == (equation, "tensctl")
    }
    cells = []
    for r in sorted((r for r in rows if r["equation"] == equation), key=lambda r: (r["states"], r["data"])):
        error = f"{r['error']:.1e}" if "error" in r else ""
        if "fault" in r:
            end = ["", r["fault"], "", ""]
        else:
            ratio = r["time"] / own.get((r["states"], r["data"]), np.nan)
            end = [f"{r['time']:.3g}", f"{r['residual']:.1e}", error, "" if np.isnan(ratio) else f"{ratio:.3g}"]
        cells.append([r["states"], r["data"], r["solver"], *end])
    return page.table(["states", "data", "solver", "time, s", "residual", "error", "times tensctl"], cells)


def plot(rows: list[dict]) -> None:
    """Residual against processor time, one panel for each equation and kind of data, one mark for each size."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "tensctl"
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, 2, figsize=(7.2, 6.0), layout="constrained", sharex=True)
    names = list(dict.fromkeys(r["solver"] for r in rows))
    for axes, (equation, data) in zip(
        panels.flat, [(e, d) for e in ("Riccati", "Gramian") for d in ("nominal", "stiff")], strict=True
    ):
        for k, name in enumerate(names):
            own = [r for r in rows if (r["equation"], r["data"], r["solver"]) == (equation, data, name) and "time" in r]
            own.sort(key=lambda r: r["states"])
            line = ([r["time"] for r in own], [r["residual"] for r in own])
            axes.loglog(*line, "osv^D<>*P"[k % 9] + "-", color=f"C{k}", markersize=4)
        axes.set_title(f"{equation}, {data}", fontsize=9)
        axes.grid(visible=True, which="major", alpha=0.3)
    figure.supxlabel("processor time, s", fontsize=9)
    figure.supylabel("residual over its terms", fontsize=9)
    handles = [plt.Line2D([], [], marker="osv^D<>*P"[k % 9], color=f"C{k}", label=n) for k, n in enumerate(names)]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=7)
    figure.savefig(page.DOCS / "images" / "riccati.svg", metadata={"Date": None})


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--docs", action="store_true", help="write tables and plot into docs/riccati.md")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(MODELS), choices=list(MODELS))
    parser.add_argument("--solvers", nargs="+", help="these alone, by the names of the tables")
    parser.add_argument("--rows", type=Path, help="JSON lines of rows that are known; new ones are added")
    parser.add_argument("--limit", type=int, help="seconds of processor time for a row")
    given = parser.parse_args()
    text = given.rows.read_text(encoding="utf-8") if given.rows and given.rows.exists() else ""
    known = [json.loads(line) for line in text.splitlines()]
    rows = rows_of(given.sizes, given.solvers, known, given.rows, given.limit)
    tables = {"solvers": table(rows, "Riccati"), "gramians": table(rows, "Gramian")}
    print("\n\n".join(tables.values()))
    if given.docs:
        plot(rows)
        page.write("riccati.md", tables)


if __name__ == "__main__":
    main()
