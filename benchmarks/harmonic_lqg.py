"""Kalman filters and LQG of symmetric shells by harmonics, beside the dense ones.

python benchmarks/harmonic_lqg.py           # prints the table
python benchmarks/harmonic_lqg.py --docs    # and writes it into docs/riccati.md

Every tendon's length is measured. Both sides begin at the equilibrium and end at the gain, in one process with one BLAS
thread; processor time. Dense designs stop at 628 states.
"""

import time
import warnings

import numpy as np
import page
from clock import timed
from riccati import shell

import tensctl as tc
from tensctl.linear import HarmonicModel
from tensctl.synthesis.kalman import kalman, white_forces
from tensctl.threads import one_blas_thread

SIZES = ((3, 1), (4, 2), (6, 3), (8, 4), (20, 10))
DENSE_UP_TO = 628
DT = 0.01
HEAD = ["shell", "states, sensors", "filter, s", "residual", "dense, s", "times", "gains differ by"]
HEAD += ["sampled LQG, s", "residuals", "one step, ms", "dense, s", "times", "gains differ by"]


def apart(found: np.ndarray, wanted: np.ndarray) -> str:
    return f"{np.abs(found - wanted).max() / np.abs(wanted).max():.0e}"


def row(n: int, m: int) -> list[str]:
    scene = shell(n, m)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    eyes = tc.sensors(dynamics.structure, lengths=1e-3)
    taken, model = timed(lambda: tc.harmonics(dynamics, rest), 0.2)
    filtering, found = timed(lambda: tc.harmonic_kalman(model, eyes), 0.2)
    designing, lqg = timed(lambda: tc.harmonic_lqg(model, eyes, dt=DT))
    reading = eyes.read(rest, 0)
    lqg.step(0.0, reading)
    stepping, _ = timed(lambda: lqg.step(0.0, reading), 0.2)
    cells = [f"({n},{m})", f"{model.nx}, {eyes.noise.size}", f"{taken + filtering:.3g}", f"{found.residual:.0e}"]
    cells += dense_filter(dynamics, rest, eyes, found, taken + filtering)
    cells += [f"{taken + designing:.3g}", f"{max(lqg.regulator.residual, lqg.filter.residual):.0e}"]
    return [*cells, f"{1e3 * stepping:.2g}", *dense_lqg(dynamics, rest, eyes, lqg, taken + designing)]


def dense_filter(dynamics, rest, eyes, found: tc.HarmonicKalman, own: float) -> list[str]:
    if found.linear.nx > DENSE_UP_TO:
        return [""] * 3
    began = time.process_time()
    flexible = tc.linearize(dynamics, rest).flexible
    wanted = kalman(flexible.A, eyes.rows(flexible)[0], white_forces(flexible, 0.1), np.diag(eyes.noise**2))
    took = time.process_time() - began
    return [f"{took:.3g}", f"{took / own:.3g}", apart(found.dense(flexible)[0], wanted.gain)]


def dense_lqg(dynamics, rest, eyes, found: tc.HarmonicLQG, own: float) -> list[str]:
    model: HarmonicModel = found.linear
    if model.nx > DENSE_UP_TO:
        return [""] * 3
    began = time.process_time()
    linear = tc.linearize(dynamics, rest)
    wanted = tc.lqg(linear, eyes, dt=DT)
    took = time.process_time() - began
    gap = max(
        apart(found.regulator.dense(linear)[0], wanted.regulator.K),
        apart(found.filter.dense(linear)[0], wanted.filter.gain),
        key=float,
    )
    return [f"{took:.3g}", f"{took / own:.3g}", gap]


@one_blas_thread()
def main() -> None:
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    page.tell("riccati.md", "filters", HEAD, (row(*size) for size in SIZES))


if __name__ == "__main__":
    main()
