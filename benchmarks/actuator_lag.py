"""What the lag of actuators costs a loop: the (3,1) mast stands up and is pushed, by designs with and without the lag.

python benchmarks/actuator_lag.py [--docs]
"""

from __future__ import annotations

import sys

import numpy as np
from page import table, write

import tensctl as tc

DT, LAGS = 0.02, (0.0, 0.05, 0.2)
PUSH = tc.Push("P4_1_1", (2.0, 0.0, 0.0), 5.0, 5.1)
HEAD = ["lag, s", "controller", "designed for", "off the path, mm", "pushed off, mm", "5 s later, mm"]


def mast(lag):
    """Its dynamics, rest and way up, where actuators lag."""
    scene = tc.Scene(
        structure={"kind": "shell", "n": 3, "m": 1, "pins": ["P1_*_1"]},
        rods={"mass": 1.0},
        tendons={"stiffness": 100.0, "rest_ratio": 0.8},
        actuators={"lag": lag},
        target={"height_scale": 1.2, "duration": 3.0},
    )
    rest, dynamics = tc.find_equilibrium(scene), tc.build_dynamics(scene)
    return dynamics, rest, tc.plan_shape(scene, start=rest, tension_min=0.1, rate_max=0.5)


def designs(dynamics, rest, path):
    """The same four controllers, for these dynamics."""
    linear, start = tc.linearize(dynamics, path.target), tc.linearize(dynamics, rest)
    eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=0.01)
    return {
        "scheduled LQR": tc.scheduled_lqr(path, dynamics, lambda one: tc.lqr(one, dt=DT)),
        "MPC, N = 20": tc.MPC(linear, horizon=20, dt=DT, path=path),
        "nonlinear MPC, N = 10": tc.NonlinearMPC(dynamics, path, horizon=10, dt=DT),
        "MPC from sensors, N = 20": tc.OutputMPC(start, eyes, horizon=20, dt=DT, path=path),
    }


def followed(dynamics, rest, path, controller):
    """Largest distances of a node to the path, mm: before the push, after it, and at the end."""
    run = tc.simulate(dynamics, rest, controller=controller, t_end=10.0, rate_max=0.5, pushes=[PUSH], tol=1e-8)
    wanted = np.array([path.nodes_at(t) for t in run.time])
    off = np.linalg.norm(run.nodes - wanted, axis=2).max(axis=1)
    return [f"{1e3 * x:.3g}" for x in (off[run.time < 5.0].max(), off[run.time >= 5.0].max(), off[-1])]


def main():
    blind = designs(*mast(0.0))
    rows = []
    for lag in LAGS:
        dynamics, rest, path = mast(lag)
        pairs = [("no lag", blind)] + [("the lag", designs(dynamics, rest, path))] * (lag > 0)
        for aware, made in pairs:
            for name, controller in made.items():
                rows.append([f"{lag:g}", name, aware, *followed(dynamics, rest, path, controller)])
                print(*rows[-1], sep="  ", flush=True)
    if "--docs" in sys.argv:
        write("actuators.md", {"lag": table(HEAD, rows)})


if __name__ == "__main__":
    main()
