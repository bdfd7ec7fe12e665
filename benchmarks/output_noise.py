"""What sensors' noise leaves of the shape that predictive control holds from sensors, with wrong stiffness and loads.

    python benchmarks/output_noise.py          # prints the table; some minutes
    python benchmarks/output_noise.py --docs   # also renews it in docs/mpc_output.md

Masts with pinned bases, lengths and tensions of all tendons read with noise, N = 10, dt = 0.02 s. Four structures each:
every stiffness 5 % too high or too low, and stiffness off by up to 5 % with a load of 0.1 N in each direction, at
random, on each top node. Seconds 7 to 10: the mean error of nodes in what lengths show, which is what tendons can move;
and how far nodes go about their mean.
"""

from __future__ import annotations

import numpy as np
import page

import tensctl as tc

SIZES, NOISES, DRIFTS, SEEDS = ((3, 1), (3, 2)), (1e-4, 5e-4), (1.0, 0.3), range(4)
# Directions of the shape that lengths show less than this part of the best are none.
_SHOWN = 1e-6


def scene(size: tuple[int, int], **given) -> tc.Scene:
    return tc.Scene(structure={"kind": "shell", "n": size[0], "m": size[1], "pins": ["P1_*_1"]}, **given)


class Mast:
    """A mast as its controller knows it."""

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size
        self.dynamics, self.rest = tc.build_dynamics(scene(size)), tc.find_equilibrium(scene(size))
        self.linear = tc.linearize(self.dynamics, self.rest, outputs=("nodes",)).flexible
        lengths = tc.linearize(self.dynamics, self.rest, outputs=("lengths",)).flexible
        _, values, directions = np.linalg.svd(lengths.C)
        shown = directions[: np.count_nonzero(values > _SHOWN * values[0])]
        self.show = self.linear.C @ shown.T @ shown

    def wrong(self, seed: int, loaded: bool) -> tc.Dynamics:
        """The structure as it is."""
        rng, tendons = np.random.default_rng(seed), self.dynamics.structure.tendon_labels
        off = rng.uniform(-0.05, 0.05, len(tendons)) if loaded else rng.choice([-0.05, 0.05], len(tendons))
        members = self.dynamics.members
        given = {
            "stiffness": dict(zip(tendons, (members.stiffness * (1 + off)).tolist(), strict=True)),
            "rest_length": dict(zip(tendons, members.rest_lengths.tolist(), strict=True)),
        }
        top = [label for label in self.dynamics.structure.node_labels if label.startswith("P4_")]
        loads = {label: (0.1 * rng.standard_normal(3)).tolist() for label in top} if loaded else {}
        return tc.build_dynamics(scene(self.size, tendons=given, loads=loads))

    def errors(self, noise: float, drift: float, seed: int, loaded: bool) -> tuple[float, float]:
        """Mean error in what tendons can move, and the way of nodes about their mean, m."""
        eyes = tc.sensors(self.dynamics.structure, lengths=noise, tensions=100 * noise, seed=seed)
        controller = tc.OutputMPC(self.linear, eyes, horizon=10, tension_min=0.3, drift=drift)
        run = tc.simulate(
            self.wrong(seed, loaded), (self.rest.nodes, 0 * self.rest.nodes), controller=controller, t_end=10.0
        )
        late = run.nodes[run.time >= 7]
        mean = late.mean(axis=0)
        error = (self.show @ self.linear.state_of(mean, 0 * mean)).reshape(-1, 3)
        return (
            float(np.linalg.norm(error, axis=1).max()),
            float(np.linalg.norm(late - mean, axis=2).max()),
        )


def rows():
    for size in SIZES:
        mast = Mast(size)
        for noise in NOISES:
            for drift in DRIFTS:
                found = [mast.errors(noise, drift, seed, loaded) for loaded in (False, True) for seed in SEEDS]
                mean, way = 1e3 * np.array(found).max(axis=0)
                yield [f"({size[0]},{size[1]})", 1e3 * noise, drift, len(found), f"{mean:.2g}", f"{way:.2g}"]


if __name__ == "__main__":
    head = ["mast", "noise of lengths, mm", "drift", "runs", "worst mean error, mm", "farthest from the mean, mm"]
    page.tell("mpc_output.md", "noise", head, rows())
