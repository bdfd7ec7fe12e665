"""Tracking error beside step time: nonlinear MPC against MPC with the linear model of the target.

    python benchmarks/nonlinear_mpc.py          # prints the table
    python benchmarks/nonlinear_mpc.py --docs   # also renews it in docs/nonlinear_mpc.md
    python benchmarks/nonlinear_mpc.py --sizes  # steps of larger shells instead, N = 5, with --docs too

The target is asked for at once, as a step of the reference. (3,1) and (3,2) masts on pinned bases and one of Class 2,
whose rods share nodes, k = 100 N/m, horizon 10, dt = 0.02 s, floors of 0.1 N, at most 0.5 m/s; 2 s of the full
structure, 3 s from random starts at rest in which 3 to 8 tendons are slack (means over four of them). "Error" is the
largest distance of a node from its target: mean over time, and at the end. "Slack" counts samples at which an actuated
tendon carries less than 0.09 N. Times are those of the thread, not of the clock; one core, one BLAS thread.
"""

from __future__ import annotations

import argparse
import os
import time
from functools import partial

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page

import tensctl as tc
from tensctl.synthesis.qp_anew import answer
from tensctl.threads import one_blas_thread

_FLOOR = 0.1
_SETTINGS = {"horizon": 10, "dt": 0.02, "tension_min": _FLOOR, "rate_max": 0.5}
_MASTS = (
    ("(3,1), 10 % taller", tc.shell(3, 1, pins=["P1_*_1"]), {"height_scale": 1.1}),
    ("(3,1), 30 % taller", tc.shell(3, 1, pins=["P1_*_1"]), {"height_scale": 1.3}),
    ("(3,2), turned 0.4 rad", tc.shell(3, 2, pins=["P1_*_1"]), {"twist": -0.4}),
    ("(3,2), turned 1.0 rad", tc.shell(3, 2, pins=["P1_*_1"]), {"twist": -1.0}),
    ("Class 2 (3,2), 30 % taller", tc.shell(3, 2, cls=2, pins=["P1_*_1"]), {"height_scale": 1.3}),
    ("Class 2 (3,2), turned 0.8 rad", tc.shell(3, 2, cls=2, pins=["P1_*_1"]), {"twist": 0.8}),
)
_REACH, _STARTS = 0.13, 4


class Timed:
    """A controller whose steps are timed by the thread's own clock."""

    def __init__(self, controller) -> None:
        self.controller, self.dt, self.times = controller, controller.dt, []

    def reset(self) -> None:
        """Begin anew."""
        self.controller.reset()

    def step(self, t, measurement):
        """The controller's own command."""
        began = time.thread_time()
        u = self.controller.step(t, measurement)
        self.times.append(1e3 * (time.thread_time() - began))
        return u


def measured(dynamics, start, target, controller, seconds: float) -> list[float]:
    """Mean and last error (mm), share of samples with a slack tendon (%), median and worst step (ms)."""
    timed = Timed(controller)
    controller.step(0.0, tc.Measurement(target.nodes, 0 * target.nodes, target.lengths, target.tensions, target.inputs))
    run = tc.simulate(dynamics, start, controller=timed, t_end=seconds, rate_max=_SETTINGS["rate_max"])
    error = 1e3 * run.distance_to(target.nodes)
    slack = (run.tensions[:, dynamics.members.inputs] < 0.9 * _FLOOR).any(axis=1)
    assert all(record.kkt < 1e-6 or record.status.endswith("bounded") for record in controller.records)
    mean = np.trapezoid(error, run.time) / seconds
    return [mean, error[-1], 100 * slack.mean(), float(np.median(timed.times)), max(timed.times)]


def controllers(dynamics, target):
    """Linear and nonlinear controllers of the same problem."""
    yield "MPC, linear at the target", tc.MPC(tc.linearize(dynamics, target, outputs=()), **_SETTINGS)
    for iterations in (1, 3):
        name = f"nonlinear, {iterations} iteration{'s' * (iterations > 1)}"
        yield name, tc.NonlinearMPC(dynamics, target, **_SETTINGS, iterations=iterations)


def mast(structure: tc.Structure, target=None) -> tuple[tc.Dynamics, tc.Equilibrium, tc.Equilibrium]:
    """Dynamics, rest and target of a mast."""
    asked = None if target is None else target | {"duration": 60.0}
    scene = tc.Scene(structure=structure, tendons={"stiffness": 100.0, "rest_ratio": 0.8},
                     mpc={"tension_min": _FLOOR}, target=asked)  # fmt: skip
    rest = tc.find_equilibrium(scene)
    return tc.build_dynamics(scene), rest, rest if asked is None else tc.plan_shape(scene, start=rest).target


def shaken(rest: tc.Equilibrium, seed: int, reach: float = _REACH) -> tuple[np.ndarray, np.ndarray]:
    """Nodes away from rest, at rest."""
    manifold = rest.potential.manifold
    nodes = manifold.retract(rest.nodes, reach * np.random.default_rng(seed).standard_normal(manifold.size))
    return nodes, 0 * nodes


@one_blas_thread()
def sizes() -> str:
    """Median times of a step's parts on pinned shells near rest, N = 5, and of the linear controller's, ms."""
    rows = []
    for n, m in ((3, 1), (3, 2), (4, 2), (6, 3), (8, 4)):
        dynamics, rest, _ = mast(tc.shell(n, m, pins=["P1_*_1"]))
        ours, known = (make(**_SETTINGS | {"horizon": 5}) for make in (
            partial(tc.NonlinearMPC, dynamics, rest), partial(tc.MPC, tc.linearize(dynamics, rest, outputs=()))
        ))  # fmt: skip
        times = []
        for seed in range(5):
            nodes, velocities = shaken(rest, seed, 0.003)
            seen = tc.Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs)
            clock = [time.thread_time()]
            step = ours.linearised(0.0, seen)
            clock.append(time.thread_time())
            qp = step.qp()
            clock.append(time.thread_time())
            found = answer(qp, 5)
            clock.append(time.thread_time())
            known.step(0.0, seen)
            times.append(np.diff([*clock, time.thread_time()]))
            assert found is not None
            assert found[2] < 1e-9
        parts = 1e3 * np.median(times, axis=0)
        rows.append([f"({n},{m})", qp.f.size // 5, *(f"{part:.3g}" for part in (parts[:3].sum(), *parts))])
        print(*rows[-1], sep="  ", flush=True)
    return page.table(["shell", "inputs", "step, ms", "roll-out", "QP stated", "QP solved", "linear MPC"], rows)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--docs", action="store_true", help="renew the table of docs/nonlinear_mpc.md")
    arguments.add_argument("--sizes", action="store_true", help="steps of larger shells instead of motions")
    asked, rows = arguments.parse_args(), []
    if asked.sizes:
        table = sizes()
        if asked.docs:
            page.write("nonlinear_mpc.md", {"sizes": table})
        return

    def put(motion: str, name: str, numbers: list[float]) -> None:
        rows.append([motion, name, *(f"{n:.3g}" for n in numbers[:2]), f"{numbers[2]:.0f} %",
                     *(f"{n:.3g}" for n in numbers[3:])])  # fmt: skip
        print(*rows[-1], sep="  ", flush=True)

    for motion, structure, wanted in _MASTS:
        dynamics, rest, target = mast(structure, wanted)
        for name, controller in controllers(dynamics, target):
            put(motion, name, measured(dynamics, rest, target, controller, 2.0))
    dynamics, rest, target = mast(_MASTS[0][1])
    for name, controller in controllers(dynamics, target):
        runs = [measured(dynamics, shaken(rest, seed), rest, controller, 3.0) for seed in range(_STARTS)]
        put("(3,1), from slack", name, np.mean(runs, axis=0).tolist())
    if asked.docs:
        head = ["motion", "controller", "mean error, mm", "at the end", "slack", "median step, ms", "worst step"]
        page.write("nonlinear_mpc.md", {"motions": page.table(head, rows)})


if __name__ == "__main__":
    main()
