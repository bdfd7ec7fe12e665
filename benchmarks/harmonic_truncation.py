"""Balanced truncation of symmetric shells by harmonics, beside the dense one.

python benchmarks/harmonic_truncation.py           # prints the table
python benchmarks/harmonic_truncation.py --docs    # and writes it into docs/riccati.md

From all tendons to the lengths of the t5, 2 % damping stated, a fifth of the states kept. Processor time from the
linear model to the reduced one, one BLAS thread, both in one process. The error is the largest gain of the difference
at the modes' frequencies.
"""

import warnings

import numpy as np
import page
from clock import timed
from riccati import shell

import tensctl as tc
from tensctl.threads import one_blas_thread

SIZES = ((3, 1), (4, 2), (6, 3), (8, 4), (20, 10))
DENSE_UP_TO = 628
# Frequencies at which the error is looked for, at most.
LOOKED_AT = 40
HEAD = ["shell", "states", "kept", "by harmonics, s", "largest error", "bound", "dense, s", "times", "dense bound"]
HEAD += ["Hankel values differ by"]


def row(n: int, m: int) -> list[str]:
    scene = shell(n, m)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    model = tc.harmonics(dynamics, rest)
    outputs = tc.harmonic_outputs(model, ["lengths:t5_*"])
    took, less = timed(lambda: tc.harmonic_truncate(outputs, model.nx // 5, damping=0.02))
    omega = np.sqrt(model.omega2)
    error = max(less.error_at(w) for w in omega[:: max(1, omega.size // LOOKED_AT)])
    cells = [f"({n},{m})", str(model.nx), str(less.order), f"{took:.2g}", f"{error:.3g}", f"{less.bound:.4g}"]
    if model.nx > DENSE_UP_TO:
        return [*cells, "", "", "", ""]
    linear = tc.linearize(dynamics, rest, outputs=("lengths:t5_*",))
    long, dense = timed(lambda: tc.truncate(linear, less.order, damping=0.02))
    values = dense.truncated.values
    gap = np.abs(values - less.values).max() / values[0]
    return [*cells, f"{long:.2g}", f"{long / took:.3g}", f"{dense.bound:.4g}", f"{gap:.0e}"]


@one_blas_thread()
def main() -> None:
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    page.tell("riccati.md", "fewer", HEAD, (row(*size) for size in SIZES))


if __name__ == "__main__":
    main()
