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
