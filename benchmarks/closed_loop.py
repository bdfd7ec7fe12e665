"""How much faster than real time a closed loop runs: the (3,1) mast that stands up and is pushed, sampled at 100 Hz.

python benchmarks/closed_loop.py [--docs]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from page import table, write

import tensctl as tc

DT, T_END, REPEATS = 0.01, 10.0, 5
SCENE = tc.Scene(
    structure={"kind": "shell", "n": 3, "m": 1, "pins": ["P1_*_1"]},
    rods={"mass": 1.0},
    tendons={"stiffness": 100.0, "rest_ratio": 0.8},
    target={"height_scale": 1.2, "duration": 3.0},
)


class Idle:
    """Leaves rest lengths as they are: what a loop costs without a controller."""

    dt = DT

    def step(self, t, measurement):
        """Where they are."""
        return measurement.inputs

    def reset(self):
        """Nothing to forget."""


def main():
    rest, dynamics = tc.find_equilibrium(SCENE), tc.build_dynamics(SCENE)
    path = tc.plan_shape(SCENE, start=rest, tension_min=0.1, rate_max=0.5)
    linear = tc.linearize(dynamics, path.target)
    push = tc.Push("P4_1_1", (5.0, 0.0, 0.0), 5.0, 5.1)
    controllers = {"none but a sample": Idle(), "LQR": tc.lqr(linear)}
    controllers |= {
        f"MPC, N = {N}": tc.MPC(linear, horizon=N, dt=DT, tension_min=0.1, rate_max=0.5, path=path) for N in (10, 20)
    }
    head, rows = (
        ["controller", "times faster than real time", "a period, ms", "mm from the wanted shape at the end"],
        [],
    )
    for name, controller in controllers.items():
        spent = []
        for _ in range(REPEATS + 1):
            began = time.process_time()
            run = tc.simulate(
                dynamics, rest, controller=controller, t_end=T_END, dt=DT, rate_max=0.5, pushes=[push], tol=1e-8
            )
            spent.append(time.process_time() - began)
        best = min(spent[1:])
        error = 1e3 * np.linalg.norm(run.nodes[-1] - path.target_nodes, axis=1).max()
        rows.append([name, f"{T_END / best:.0f}", f"{1e3 * best * DT / T_END:.2f}", f"{error:.3f}"])
        print(*rows[-1], sep="  ", flush=True)
    if "--docs" in sys.argv:
        write("mpc.md", {"closed loop": table(head, rows)})


if __name__ == "__main__":
    main()
