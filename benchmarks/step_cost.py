"""Cost of one step from (3,1) to (100,50): force kernel and whole stage of the splitting, beside what the core can do.

    python benchmarks/step_cost.py          # a line a size
    python benchmarks/step_cost.py --docs   # also renews the table in docs/integrators.md

A stage is: rods fly, nodes are placed, tendons pull, rods are kicked. The limit beside it is measured in the same run:
a loop over the same tendons that gathers both ends, computes the stretch with its square root and division and adds it
up, without what makes a simulation: no scatter, no slack, no rods. Memory is the largest of the whole process
(`ru_maxrss`).
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np
import page
from clock import memory

import tensctl as tc
from tensctl.jit import jit
from tensctl.model.kernel import springs
from tensctl.simulation.integrators.pulls import tendon_forces
from tensctl.simulation.integrators.rows import fill, place_rows, push_rows, rows_of

# Shells that hold themselves up, as far as they are known; (100,50) is taken with the slack that comes.
SIZES = {
    (3, 1): ({}, 0.8),
    (8, 4): ({}, 0.8),
    (20, 10): ({"overlap": 0.15}, 0.8),
    (50, 40): ({"radius": 1.25, "overlap": 0.05, "twist": 1.6}, 0.9),
    (100, 50): ({"radius": 1.25, "overlap": 0.05, "twist": 1.6}, 0.9),
}
# Force evaluations that a measurement takes at least, and tendons that it visits in all.
_LEAST, _VISITS = 20, 2_000_000
_REPEATS = 5
# Length of the short run whose time is taken away from that of a long one, s.
_SHORT = 0.01


@jit
def stream(data, place, rest, count):
    """The least a tendon force can cost: two gathers, a square root, a division, one sum."""
    one, two, total = np.uint64(1), np.uint64(2), 0.0
    for turn in range(count):
        shift = 1e-300 * turn
        for t in range(rest.size):
            a, b = data.tail_at[t], data.head_at[t]
            x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
            length = np.sqrt(x * x + y * y + z * z + shift)
            total += data.stiffness[t] * (length - rest[t]) / length
    return total


@jit
def forces_only(rows, place, rest, load, count):
    """The splitting's tendon forces on all rod ends, again and again."""
    force, gap, spring, span = np.zeros_like(load), np.zeros_like(rest), np.zeros_like(rest), np.zeros(3 * rest.size)
    springs(rows, rest, np.ones_like(rest), spring)
    for _ in range(count):
        tendon_forces(rows, place, rest, spring, 0.0, load, span, force, gap)
    return force[0]


@jit
def right_hand_side(rows, place, q, rest, load, count):
    """Nodes, forces and accelerations."""
    force, push, at = np.zeros_like(load), np.zeros(6 * rows.row), np.zeros(6 * rows.row)
    gap, spring, span = np.zeros_like(rest), np.zeros_like(rest), np.zeros(3 * rest.size)
    fill(rows, q, at)
    springs(rows, rest, np.ones_like(rest), spring)
    for _ in range(count):
        place_rows(rows, at, place)
        tendon_forces(rows, place, rest, spring, 0.0, load, span, force, gap)
        push_rows(rows, at, force, push)
    return push[0]


def least(call: Callable[[int], object], count: int) -> float:
    """Least time of one turn of a loop, s; compiled code warm."""
    call(1)
    best = np.inf
    for _ in range(_REPEATS):
        began = time.process_time()
        call(count)
        best = min(best, (time.process_time() - began) / count)
    return best


def stage(dynamics: tc.Dynamics, count: int) -> float:
    """Time of one stage inside `simulate`: a long run less a short one over the evaluations between them, s."""
    first = simulated(dynamics, _SHORT)[1]
    long = _SHORT * (1 + 10 * count / first)
    (spent, made), (longer, more) = (min(simulated(dynamics, end) for _ in range(3)) for end in (_SHORT, long))
    return (longer - spent) / (more - made)


def simulated(dynamics: tc.Dynamics, end: float) -> tuple[float, int]:
    """Processor time and evaluations of a run from the initial nodes."""
    began = time.process_time()
    run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=[0.0, end], tol=1e-4, method="splitting4")
    return time.process_time() - began, run.evaluations


def one(n: int, m: int) -> list[str]:
    """A row of the table."""
    shape, ratio = SIZES[n, m]
    dynamics = tc.build_dynamics(tc.Scene(structure=tc.shell(n, m, **shape), tendons={"rest_ratio": ratio}))
    kernel, rest = dynamics.kernel, dynamics.members.rest_lengths
    tendons = len(dynamics.structure.tendons)
    count = max(_LEAST, _VISITS // tendons)
    rows = rows_of(dynamics)
    place, load = rows.nodal(dynamics.structure.nodes), rows.nodal(dynamics.members.forces)
    q = dynamics.rod_coordinates(dynamics.structure.nodes)
    spent = (
        least(lambda c: stream(kernel, dynamics.structure.nodes.ravel(), rest, c), count),
        least(lambda c: forces_only(rows, place, rest, load, c), count),
        least(lambda c: right_hand_side(rows, place, q, rest, load, c), count),
        stage(dynamics, count),
    )
    cells = [f"{1e9 * s / tendons:.2f}" for s in spent]
    return [f"({n},{m})", str(tendons), *cells, f"{1e6 * spent[-1]:.3g}", f"{memory():.0f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--one", nargs=2, type=int, metavar=("N", "M"), help="one size, in this process")
    parser.add_argument("--docs", action="store_true", help="renew the table in docs/integrators.md")
    asked = parser.parse_args()
    if asked.one:
        print("\t".join(one(*asked.one)))
        return
    rows = []
    for n, m in SIZES:
        # Each size in a process of its own, so that memory is its own.
        command = [sys.executable, __file__, "--one", str(n), str(m)]
        rows.append(subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip().split("\t"))
        print(*rows[-1], sep="\t", flush=True)
    head = [
        "shell", "tendons", "limit, ns a tendon", "forces, ns a tendon", "right-hand side, ns a tendon",
        "stage, ns a tendon", "stage, us", "memory, MB",
    ]  # fmt: skip
    made = page.table(head, rows)
    print(f"\n{made}")
    if asked.docs:
        page.write("integrators.md", {"step cost": made})


if __name__ == "__main__":
    main()
