"""A thousand random motions in which tendons go slack and taut, to see whether the event-aware splitting stalls.

    python benchmarks/switching.py [--count 1000] [--seed 0]

Each scene: a shell or prism of random size, stiffness, prestress (some start slack, some with every tendon on its
boundary), mass, weight, speed and spin. Reported: runs that failed, how many switches there were, the drift of energy
over its scale, and times.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np

import tensctl as tc
from tensctl.simulation import total_energy


@dataclass
class Tally:
    """What happened to the scenes."""

    failures: list[str]
    switches: list[int]
    drifts: list[float]
    seconds: list[float]


def random_scene(rng: np.random.Generator) -> tuple[tc.Scene, float]:
    """A scene, and how fast it is thrown."""
    n = int(rng.integers(3, 6))
    structure = (
        {"kind": "shell", "n": n, "m": int(rng.integers(1, 3))} if rng.random() < 0.7 else {"kind": "prism", "n": n}
    )
    stiffness = 10 ** rng.uniform(0, 5)
    ratio = float(rng.choice([rng.uniform(0.6, 0.99), 1.0, rng.uniform(1.0, 1.2)]))
    scene = tc.Scene(
        structure=structure,
        tendons={"stiffness": stiffness, "rest_ratio": ratio},
        rods={"mass": 10 ** rng.uniform(-2, 2)},
        gravity={"g": 9.8} if rng.random() < 0.3 else None,
    )
    return scene, float(rng.choice([0.0, 0.3, 3.0]))


def thrown(dynamics: tc.Dynamics, speed: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and velocities of the structure thrown with a spin, each rod turned a little on its own."""
    nodes = dynamics.structure.nodes
    manifold = dynamics.potential.manifold
    nodes = manifold.retract(nodes, 0.02 * rng.standard_normal(manifold.size))
    own = (manifold.tangent(nodes) @ (speed * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return nodes, own + np.cross(speed * rng.standard_normal(3), nodes)


def one(seed: int, tally: Tally) -> None:
    """Run one scene and count it."""
    rng = np.random.default_rng(seed)
    scene, speed = random_scene(rng)
    dynamics = tc.build_dynamics(scene)
    start = thrown(dynamics, speed, rng)
    omega = np.sqrt(dynamics.members.stiffness.max() / dynamics.members.mass.min())
    began = time.perf_counter()
    try:
        run = tc.simulate(dynamics, start, timepts=np.linspace(0, min(1.0, 200 / omega), 21), tol=1e-8)
    except tc.SimulationError as error:
        tally.failures.append(f"seed {seed}: {error}")
        return
    tally.seconds.append(time.perf_counter() - began)
    energy = total_energy(dynamics, run)
    kinetic = 0.5 * dynamics.members.mass.sum() * (run.velocities**2).sum(axis=2).max()
    scale = max(np.abs(energy).max(), kinetic, 1e-300)
    tally.drifts.append(float(np.ptp(energy) / scale))
    tally.switches.append(run.switches)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    tally = Tally([], [], [], [])
    for seed in range(asked.seed, asked.seed + asked.count):
        one(seed, tally)
    print(f"scenes {asked.count}, failed or stalled {len(tally.failures)}")
    print(
        f"switches: {sum(tally.switches)}, most in one scene {max(tally.switches)}, none in {tally.switches.count(0)}"
    )
    worst, middle = np.max(tally.drifts), np.median(tally.drifts)
    print(
        f"energy drift over its scale: median {middle:.1e}, largest {worst:.1e} (scene {int(np.argmax(tally.drifts))})"
    )
    print(f"seconds a run: median {np.median(tally.seconds):.4f}, longest {np.max(tally.seconds):.3f}")
    print("\n".join(tally.failures))


if __name__ == "__main__":
    main()
