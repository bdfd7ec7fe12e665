"""What it costs to look over a run of 501 records: distances, passings and rod forces.

python benchmarks/sanity_cost.py
"""

import time

import numpy as np

import tensctl as tc

SHELLS = ((3, 1, 0.3), (8, 4, 0.3), (20, 10, 0.15))


def cost(n: int, m: int, overlap: float) -> str:
    """One line of the table: the second of two calls, so that compiling does not count."""
    scene = tc.Scene(structure=tc.shell(n, m, overlap=overlap), drag={"coefficient": 0.5})
    dynamics = tc.build_dynamics(scene)
    run = tc.simulate(dynamics, dynamics.structure.nodes, timepts=np.linspace(0, 2, 501), tol=1e-5)
    tc.inspect_run(dynamics, run)
    began = time.perf_counter()
    sanity = tc.inspect_run(dynamics, run)
    seconds = time.perf_counter() - began
    rods, tendons = len(dynamics.structure.rods), len(dynamics.structure.tendons)
    pairs = rods * (rods - 1) // 2 + rods * tendons
    assert sanity.rods is not None
    return f"| ({n},{m}) | {pairs} | {seconds:.3f} | {1e3 * sanity.rods.least:.1f} | {len(sanity.rods.passings)} |"


if __name__ == "__main__":
    print("| shell | pairs | s | nearest rods, mm | passings |\n|---|---|---|---|---|")
    for shell in SHELLS:
        print(cost(*shell))
