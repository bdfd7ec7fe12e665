"""Random pushes of closed loops, the same ones in every run."""

from collections.abc import Sequence

import numpy as np

import tensctl as tc


def random_pushes(nodes: Sequence[str], t_end: float) -> list[tc.Push]:
    """About every other second one of the nodes is pushed at random, with 1 to 20 N for 0.1 s."""
    rng, found, t = np.random.default_rng(2), [], 0.5
    while t < t_end:
        way = rng.standard_normal(3)
        force = 20 ** rng.random() * way / np.linalg.norm(way)
        found.append(tc.Push(str(rng.choice(nodes)), tuple(force), t, t + 0.1))
        t += rng.exponential(2.0)
    return found


def ring_pushes(nodes: Sequence[str], t_end: float, *, every_node: bool) -> list[tc.Push]:
    """About twice a second the top ring is pushed for 0.1 s, 1 to 20 N a node; or every node, each its own way."""
    rng, found, t = np.random.default_rng(2), [], 0.1
    stage = max(int(label.split("_")[2]) for label in nodes)
    plate = max(label.split("_")[0] for label in nodes if label.startswith("P"))
    ring = [label for label in nodes if label.startswith(f"{plate}_") and int(label.split("_")[2]) == stage]
    while t < t_end:
        way, size = rng.standard_normal(3), 20 ** rng.random()
        for node in nodes if every_node else ring:
            way = rng.standard_normal(3) if every_node else way
            found.append(tc.Push(node, tuple(size * way / np.linalg.norm(way)), t, t + 0.1))
        t += rng.exponential(0.5)
    return found
