"""Several equilibria from several starts: a structure with slack and large motions can rest in more than one shape.

Starts are the structure's own nodes and random ones about it; every rest that is a saddle also sends two searches off,
one to each side of its most negative mode. Two rests are the same when a rigid motion that no load sees carries one
onto the other. A finite number of starts proves nothing about rests that were not found.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.errors import EquilibriumError
from tensctl.statics.equilibrium import Equilibrium, newton_of, settle
from tensctl.statics.newton import Newton
from tensctl.statics.rigid import unseen_motions
from tensctl.statics.stability import Stability, spectrum

if TYPE_CHECKING:
    from tensctl.scene import Scene

# Rests whose nodes agree to this part of the structure's size are one; searches end within 1e-9 of it.
_SAME = 1e-6
# Root mean square of the first random displacement, and how far off a saddle its two searches start, in rod lengths.
_NEAREST = 0.05
_OFF_SADDLE = 0.02


@dataclass(frozen=True, eq=False)
class Equilibria:
    """Distinct rests, the one of least energy first.

    Attributes
    ----------
    found : tuple of Equilibrium
    hits : tuple of int
        How many searches ended in each.
    failures : tuple of str
        What was said by searches that ended in none.
    """

    found: tuple[Equilibrium, ...]
    hits: tuple[int, ...]
    failures: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.found)

    def __iter__(self) -> Iterator[Equilibrium]:
        return iter(self.found)

    def __getitem__(self, index: int) -> Equilibrium:
        return self.found[index]


def find_equilibria(
    scene: Scene | Potential,
    *,
    starts: int | Sequence[Float[np.ndarray, "nodes 3"]] = 8,
    reach: float = 0.5,
    seed: int = 0,
) -> Equilibria:
    """Look for several rests of a scene.

    Parameters
    ----------
    scene : Scene or Potential
    starts : int or sequence of (N, 3) arrays, m
        Nodes to start from, or how many to make: the structure's own, and random ones about it.
    reach : float
        Root mean square displacement of the furthest random start, in mean rod lengths.
    seed : int
        Of the random starts.

    Returns
    -------
    Equilibria
        Each with its `energy` and its verdict `stable`.
    """
    potential = scene if isinstance(scene, Potential) else Potential.of(scene)
    newton = Newton() if isinstance(scene, Potential) else newton_of(scene)
    waiting = _starts(potential, starts, reach, seed) if isinstance(starts, int) else list(starts)
    found: list[Equilibrium] = []
    hits: list[int] = []
    failures: list[str] = []
    while waiting:
        try:
            rest = settle(potential, start=waiting.pop(0), newton=newton)
        except EquilibriumError as error:
            failures.append(str(error))
            continue
        known = next((k for k, other in enumerate(found) if same_rest(rest, other)), None)
        if known is not None:
            hits[known] += 1
            continue
        found.append(rest)
        hits.append(1)
        if rest.stable is Stability.NO:
            waiting += _sides(rest)
    order = np.argsort([rest.energy for rest in found], kind="stable")
    return Equilibria(tuple(found[k] for k in order), tuple(hits[k] for k in order), tuple(failures))


def same_rest(one: Equilibrium, other: Equilibrium) -> bool:
    """Whether a rigid motion that no load sees carries one rest onto the other, to 1e-6 of the size."""
    target, moved = other.nodes, one.nodes
    if unseen_motions(one.potential, one.nodes).names:
        centre, goal = moved.mean(axis=0), target.mean(axis=0)
        axes = one.structure.dimension
        left, _, right = np.linalg.svd((target - goal).T[:axes] @ (moved - centre)[:, :axes])
        turned = np.sign(np.linalg.det(left @ right))
        flip = np.diag(np.append(np.ones(axes - 1), turned))
        moved = moved.copy()
        moved[:, :axes] = (moved - centre)[:, :axes] @ (left @ flip @ right).T + goal[:axes]
    return bool(np.abs(moved - target).max() <= _SAME * np.ptp(target, axis=0).max())


def _starts(potential: Potential, count: int, reach: float, seed: int) -> list[np.ndarray]:
    rng, manifold, nodes = np.random.default_rng(seed), potential.manifold, potential.structure.nodes
    sizes = np.geomspace(min(_NEAREST, reach), reach, max(count - 1, 1))[: count - 1] * manifold.lengths.mean()
    return [nodes, *(manifold.retract(nodes, size * rng.standard_normal(manifold.size)) for size in sizes)]


def _sides(rest: Equilibrium) -> list[np.ndarray]:
    """Nodes to both sides of a saddle, along its most negative mode."""
    modes = spectrum(rest.point, 1)
    mode = modes.shapes[:, modes.rigid_count]
    step = _OFF_SADDLE * rest.potential.manifold.lengths.mean() * np.sqrt(mode.size) / np.linalg.norm(mode) * mode
    return [rest.potential.manifold.retract(rest.nodes, side * step) for side in (1.0, -1.0)]
