"""A thousand variations of the (3,1) shell: at once, and one after the other, in one run.

    python benchmarks/batch.py [--count 1000]

"One after the other" is what a script without batches does: for every variation a model of its own and a call of
`simulate`. The ways take turns; times are the least of three. Batches and shared models give the same nodes bit for
bit; a model of its own has its own bound on frequencies, so its own steps.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from threadpoolctl import threadpool_limits

import tensctl as tc


def drawn(dynamics: tc.Dynamics, count: int) -> tc.Variations:
    """Stiffness and mass within 5 %, rest lengths within 1 %, and a random speed of the whole structure."""
    rng, members = np.random.default_rng(0), dynamics.members
    spin = rng.standard_normal((count, 1, 3))
    return tc.Variations(
        stiffness=members.stiffness * rng.uniform(0.95, 1.05, (count, members.stiffness.size)),
        rest_lengths=members.rest_lengths * rng.uniform(0.99, 1.01, (count, members.rest_lengths.size)),
        mass=members.mass * rng.uniform(0.95, 1.05, (count, members.mass.size)),
        velocities=np.cross(0.2 * spin, dynamics.structure.nodes[None]),
    )


def one_after_the_other(scene: tc.Scene, variations: tc.Variations, times: np.ndarray, tol: float) -> np.ndarray:
    """A scene, a model and a run for each variation."""
    labels = tc.build_structure(scene).tendon_labels
    rods = tc.build_structure(scene).rod_labels
    given, nodes = variations.given, []
    for k in range(len(given["mass"])):
        varied = scene.replaced(
            tendons={
                "stiffness": dict(zip(labels, given["stiffness"][k].tolist(), strict=True)),
                "rest_length": dict(zip(labels, given["rest_lengths"][k].tolist(), strict=True)),
            },
            rods={"mass": dict(zip(rods, given["mass"][k].tolist(), strict=True))},
        )
        dynamics = tc.build_dynamics(varied)
        run = tc.simulate(dynamics, (dynamics.structure.nodes, given["velocities"][k]), timepts=times, tol=tol)
        nodes.append(run.nodes)
    return np.stack(nodes)


def members_in_turn(dynamics: tc.Dynamics, variations: tc.Variations, times: np.ndarray, tol: float) -> np.ndarray:
    """The batch's own cheap models, but `simulate` one by one."""
    nodes = []
    for k in range(len(variations.given["mass"])):
        row = {name: array[k] for name, array in variations.given.items()}
        start = dynamics.structure.nodes, row.pop("velocities")
        nodes.append(tc.simulate(dynamics.varied(**row), start, timepts=times, tol=tol).nodes)
    return np.stack(nodes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    count = parser.parse_args().count
    scene = tc.Scene(structure=tc.shell(3, 1), tendons={"stiffness": 100.0, "rest_ratio": 0.8})
    dynamics, times, tol = tc.build_dynamics(scene), np.linspace(0, 1, 11), 1e-6
    variations = drawn(dynamics, count)
    ways = {
        "one after the other": lambda: one_after_the_other(scene, variations, times, tol),
        "shared models, in turn": lambda: members_in_turn(dynamics, variations, times, tol),
        "batch, one worker": lambda: tc.simulate_many(dynamics, variations, timepts=times, tol=tol, workers=1).nodes,
        "batch, two workers": lambda: tc.simulate_many(dynamics, variations, timepts=times, tol=tol, workers=2).nodes,
    }
    with threadpool_limits(1):
        reference = tc.simulate_many(dynamics, variations, timepts=times, tol=1e-11).nodes
        best, found = dict.fromkeys(ways, np.inf), {}
        for _ in range(3):
            for name, way in ways.items():
                began = time.perf_counter()
                found[name] = way()
                best[name] = min(best[name], time.perf_counter() - began)
    first = best["one after the other"]
    print(f"{count} variations of (3,1), 1 s each, tol = {tol:g}")
    print("| way | s | times faster | largest error, m | largest difference to the batch, m |\n|---|---|---|---|---|")
    for name, seconds in best.items():
        error = np.abs(found[name] - reference).max()
        difference = np.abs(found[name] - found["batch, two workers"]).max()
        print(f"| {name} | {seconds:.2f} | {first / seconds:.1f} | {error:.1e} | {difference:.1e} |")


if __name__ == "__main__":
    main()
