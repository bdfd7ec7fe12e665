"""Riccati equations of shells in harmonics, and extreme cases.

python benchmarks/riccati.py            # both tables, printed and written into docs/riccati.md
python benchmarks/riccati.py --shells   # the table of shells alone
python benchmarks/riccati.py --quick    # the smallest shells, printed only

Times are processor times with one BLAS thread. Each shell has a process of its own; memory is the largest of that
process (`ru_maxrss`) once the gain is there and has answered once, before any dense model. Other solvers stand beside
this one in riccati_solvers.py.
"""

import argparse
import json
import subprocess
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import page
from clock import memory, timed

import tensctl as tc
from tensctl.errors import TensctlError
from tensctl.simulation import Measurement
from tensctl.synthesis import care
from tensctl.threads import one_blas_thread

SHAPES = {
    (20, 10): ({"overlap": 0.15}, 0.8),
    (50, 40): ({"radius": 1.25, "overlap": 0.05, "twist": 1.6}, 0.9),
}
SIZES = ((3, 1), (4, 2), (6, 3), (8, 4), (20, 10), (50, 40))
# States, and the shell whose lowest modes they are.
MODELS = {48: (3, 1), 200: (4, 3), 628: (8, 4), 768: (13, 3), 2000: (17, 6)}


@dataclass(frozen=True)
class Problem:
    """One equation, with the name of its data."""

    data: str
    A: np.ndarray
    B: np.ndarray
    Q: np.ndarray
    R: np.ndarray

    def residual(self, X: np.ndarray) -> float:
        """Left side over the sum of the terms' norms."""
        XA = X @ self.A
        terms = (XA, XA.T, -X @ self.B @ np.linalg.solve(self.R, self.B.T @ X), self.Q)
        return float(np.linalg.norm(np.sum(terms, axis=0)) / sum(np.linalg.norm(term) for term in terms))


def shell(n: int, m: int, **given) -> tc.Scene:
    shape, ratio = SHAPES.get((n, m), ({}, 0.8))
    return tc.Scene(structure={"kind": "shell", "n": n, "m": m} | shape, **({"tendons": {"rest_ratio": ratio}} | given))


def unequal(n: int, m: int) -> tc.Scene:
    """A shell without symmetry: stiffnesses differ by up to 25 %."""
    labels = tc.build_structure(shell(n, m)).tendon_labels
    factors = np.random.default_rng(0).uniform(0.8, 1.25, len(labels))
    stiffness = {label: 100.0 * factor for label, factor in zip(labels, factors.tolist(), strict=True)}
    return shell(n, m, tendons={"rest_ratio": 0.8, "stiffness": stiffness})


def problems(states: int) -> list[Problem]:
    """The lowest modes of a shell as they are, and with the same drives over five decades of frequency."""
    size = MODELS[states]
    scene = shell(*size) if states in (48, 628) else unequal(*size)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    flexible = tc.linearize(dynamics, rest).flexible
    low = replace(flexible, modes=flexible.modes[: states // 2])
    stiffness = dynamics.members.stiffness[dynamics.members.inputs]
    omega = np.geomspace(1e-1, 1e4, states // 2)
    zero = np.zeros((omega.size, omega.size))
    drive = low.B[omega.size :] * (omega / low.scales)[:, None]
    A = np.block([[zero, np.diag(omega)], [-np.diag(omega), zero]])
    weights = np.random.default_rng(1).permutation(np.geomspace(1e-4, 1e4, stiffness.size))
    return [
        Problem("nominal", low.A, low.B, np.eye(states), np.diag(stiffness)),
        Problem("stiff", A, np.vstack([0 * drive, drive]), np.eye(states), np.diag(stiffness * weights)),
    ]


def shell_rows(sizes: Sequence[tuple[int, int]]) -> list[dict]:
    """Rows of the table of shells, each from a process of its own."""
    rows = []
    for n, m in sizes:
        command = [sys.executable, __file__, "--one", str(n), str(m)]
        made = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
        rows.append(json.loads(made))
        print(rows[-1], flush=True)
    return rows


def shell_row(n: int, m: int) -> dict:
    """From equilibrium to gain: by harmonics, by the dense model, and by python-control on SciPy."""
    scene = shell(n, m)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    long = 1e-9 if n >= 20 else 0.2
    linear, model = timed(lambda: tc.harmonics(dynamics, rest), long)
    gain, design = timed(lambda: tc.harmonic_lqr(model), long)
    row = {"shell": f"({n},{m})", "states": model.nx, "linear": linear, "gain": gain, "residual": design.residual}
    still = Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
    design.step(0.0, still)  # loads the compiled kernels
    row["step"], _ = timed(lambda: design.step(0.0, still), 0.05)
    row["memory"] = memory()
    if model.nx <= 700:
        row |= dense(dynamics, rest, design) | {"control": by_control(dynamics, rest)}
    return row


def by_control(dynamics: tc.Dynamics, rest: tc.Equilibrium) -> float:
    """Time of python-control on SciPy, linear model included, s."""
    import control

    began = time.process_time()
    flexible = tc.linearize(dynamics, rest).flexible
    stiffness = dynamics.members.stiffness[dynamics.members.inputs]
    control.lqr(flexible.to_statespace(), np.eye(len(flexible.A)), np.diag(stiffness), method="scipy")
    return time.process_time() - began


def dense(dynamics: tc.Dynamics, rest: tc.Equilibrium, design: tc.HarmonicLQR) -> dict:
    """Time of the dense equation, and how far the gains are from each other."""
    began = time.process_time()
    flexible = tc.linearize(dynamics, rest).flexible
    stiffness = dynamics.members.stiffness[dynamics.members.inputs]
    found = care(flexible.A, flexible.B, np.eye(len(flexible.A)), np.diag(stiffness))
    took = time.process_time() - began
    return {"dense": took, "gap": np.abs(design.dense(flexible)[0] - found.K).max() / np.abs(found.K).max()}


def shell_table(rows: list[dict]) -> str:
    head = ["shell", "states", "linear model, s", "gain, s", "residual", "one command, ms", "memory, MB"]
    head += ["dense model and gain, s", "control.lqr on SciPy, s", "times harmonics", "gains differ by"]
    cells = []
    for r in rows:
        own = r["linear"] + r["gain"]
        known = [r["shell"], r["states"], f"{r['linear']:.3g}", f"{r['gain']:.3g}", f"{r['residual']:.0e}"]
        known += [f"{1e3 * r['step']:.2g}", f"{r['memory']:.0f}"]
        if "control" in r:
            known += [f"{r['dense']:.3g}", f"{r['control']:.3g}", f"{r['control'] / own:.3g}", f"{r['gap']:.0e}"]
        cells.append(known + [""] * (len(head) - len(known)))
    return page.table(head, cells)


def extreme_scenes() -> dict[str, tuple[tc.Scene, float]]:
    """Variations of the (4,1) shell, each with the part of its stretch that is kept as prestress."""
    found = {}
    for ratio in (1e0, 1e3, 1e6, 1e9, 1e12):
        tendons = {"stiffness": {"*": 100.0, "t5_*": 100.0 * ratio}, "rest_ratio": {"*": 0.8, "t5_*": 1 - 0.2 / ratio}}
        found[f"stiffness ratio {ratio:.0e}"] = (shell(4, 1, tendons=tendons), 1.0)
    for ratio in (1e2, 1e4, 1e6, 1e8):
        found[f"mass ratio {ratio:.0e}"] = (shell(4, 1, rods={"mass": {"r1_*": 1.0, "r2_*": ratio}}), 1.0)
    for part in (1e0, 1e-3, 1e-6):
        found[f"prestress {part:.0e} of the default"] = (shell(4, 1), part)
    for ratio in (0.0, 0.01, 0.1, 1.0):
        tendons = {"rest_ratio": 0.8, "damping": {"ratio": ratio}}
        found[f"damping {ratio:g} of critical"] = (shell(4, 1, tendons=tendons), 1.0)
    for part in (1e-14, 1e-10, 1e-6, 1e-4, 1e-2):
        tendons = {"rest_ratio": 0.8, "stiffness": {"*": 100.0, "t5_1_1": 100.0 * (1 + part)}}
        found[f"one tendon stiffer by {part:.0e} of itself"] = (shell(4, 1, tendons=tendons), 1.0)
    return found


def extreme_table() -> str:
    head = ["case", "frequencies, rad/s", "mismatch", "residual, harmonics", "residual, dense", "gains differ by"]
    head += ["slowest pole of the whole loop, 1/s"]
    rows = []
    for name, (scene, part) in extreme_scenes().items():
        try:
            rows.append([name, *extreme(scene, part)])
        except TensctlError as fault:
            rows.append([name, f"refused: {str(fault).split(';')[0]}", *[""] * 5])
        print(rows[-1], flush=True)
    return page.table(head, rows)


def extreme(scene: tc.Scene, part: float) -> list[str]:
    """One row: the harmonic design, the dense one, and the harmonic gain on the dense model."""
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    if part < 1:
        members = dynamics.members
        slack = rest.lengths - part * rest.tensions / members.stiffness
        rest = tc.find_equilibrium(scene, start=rest.nodes, inputs=(members.rest_lengths - slack)[members.inputs])
    model = tc.harmonics(dynamics, rest, tol=0.05)
    design, flexible = tc.harmonic_lqr(model), tc.linearize(dynamics, rest).flexible
    stiffness = dynamics.members.stiffness[dynamics.members.inputs]
    other = care(flexible.A, flexible.B, np.eye(len(flexible.A)), np.diag(stiffness))
    K, _ = design.dense(flexible)
    slowest = np.linalg.eigvals(flexible.A - flexible.B @ K).real.max()
    omega = np.sqrt(model.omega2[[0, -1]])
    gap = np.abs(K - other.K).max() / np.abs(other.K).max()
    return [
        f"{omega[0]:.2g} to {omega[1]:.2g}", f"{model.mismatch:.0e}", f"{design.residual:.0e}",
        f"{other.residual:.0e}", f"{gap:.0e}", f"{slowest:.2e}",
    ]  # fmt: skip


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="small sizes only, printed only")
    parser.add_argument("--shells", action="store_true", help="the table of shells alone")
    parser.add_argument("--one", nargs=2, type=int, metavar=("N", "M"), help="one shell, in this process")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    care(np.zeros((2, 2)), np.eye(2), np.eye(2), np.eye(2))
    tc.harmonic_lqr(tc.harmonics(tc.build_dynamics(shell(3, 1)), tc.find_equilibrium(shell(3, 1))))
    if asked.one:
        print(json.dumps(shell_row(*asked.one)))
        return
    tables = {} if asked.shells else {"extremes": extreme_table()}
    tables["shells"] = shell_table(shell_rows(SIZES[:3] if asked.quick else SIZES))
    for table in tables.values():
        print(f"\n{table}")
    if not asked.quick:
        page.write("riccati.md", tables)


if __name__ == "__main__":
    main()
