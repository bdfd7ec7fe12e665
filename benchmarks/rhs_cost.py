"""Cost of one right-hand side inside the compiled loop: forces of all tendons and accelerations of all rods.

python benchmarks/rhs_cost.py
"""

import time

import numpy as np

import tensctl as tc
from tensctl.jit import jit
from tensctl.model.kernel import elastic_forces, place_nodes, pushes


@jit
def repeat(data, q, rest, external, count):
    """Evaluate the undamped right-hand side again and again."""
    nodes, forces, push = data.anchor.copy(), np.zeros_like(external), np.zeros_like(q)
    taut = np.zeros(rest.size, np.int64)
    total = 0.0
    for _ in range(count):
        q[0, 0] += 1e-12
        place_nodes(data, q, nodes)
        elastic_forces(data, nodes, rest, external, forces, taut)
        pushes(data, q, forces, push)
        total += push[0, 3]
    return total


def main() -> None:
    """Print a line for each size."""
    print(f"{'shell':>8} {'tendons':>8} {'rhs [us]':>9} {'ns a tendon':>12}")
    for n, m, rest_ratio, shape in (
        (3, 1, 0.8, {}),
        (8, 4, 0.8, {}),
        (20, 10, 0.8, {"overlap": 0.15}),
        (50, 40, 0.9, {"radius": 1.25, "overlap": 0.05, "twist": 1.6}),
    ):
        scene = tc.Scene(structure=tc.shell(n, m, **shape), tendons={"rest_ratio": rest_ratio})
        dynamics = tc.build_dynamics(scene)
        members, count = dynamics.members, max(20, 2_000_000 // len(dynamics.structure.tendons))
        arguments = (dynamics.kernel, dynamics.rod_coordinates(dynamics.structure.nodes))
        best = np.inf
        for repeats in (1, count, count, count, count, count):
            began = time.perf_counter()
            repeat(*arguments, members.rest_lengths, members.forces, repeats)
            best = min(best, (time.perf_counter() - began) / repeats) if repeats > 1 else best
        tendons = len(dynamics.structure.tendons)
        print(f"{f'({n},{m})':>8} {tendons:8d} {1e6 * best:9.3f} {1e9 * best / tendons:12.2f}")


if __name__ == "__main__":
    main()
