"""The way from a start to a rest: in one sector when everything is symmetric, on the whole structure otherwise.

What was found in a sector is laid out in full and balanced there: the residual is that of the structure as given. When
only the loads break the symmetry, the rest under their symmetric part is found in a sector and is where the whole
structure starts from.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.statics.newton import Newton, Whole
from tensctl.statics.sector import Sector
from tensctl.statics.symmetry import CyclicSymmetry, find_symmetry

# Stiffnesses up to this ratio over the median need no detour, and each stage of the detour is this much stiffer.
_GRADED = 100.0
_SOFTER = 100.0
# Residual at which a stage ends: the next one moves further than this anyway.
_ROUGH = 1e-6
# Below this many degrees of freedom a whole step costs as little as looking for a symmetry.
_WORTH_IT = 60


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended.

    Attributes
    ----------
    nodes : (N, 3) m
    iterations : int
    symmetry : CyclicSymmetry or None
        The symmetry that the rest has and by which it was found.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    iterations: int
    symmetry: CyclicSymmetry | None


def search(
    potential: Potential, start: np.ndarray | None, rest: np.ndarray, newton: Newton, *, symmetric: bool = True
) -> Found:
    """Go down to a rest from the given nodes, the structure's own by default."""
    nodes = potential.structure.nodes if start is None else start
    if not symmetric or potential.manifold.size <= _WORTH_IT:
        return _whole(potential, nodes, rest, newton)
    symmetry = find_symmetry(potential, nodes, rest)
    if symmetry is not None:
        guess, steps = _in_sector(potential, symmetry, nodes, rest, newton)
        point = Whole(potential, rest).at(guess)
        if Whole(potential, rest).residual(point) <= newton.tol:
            return Found(guess, steps, symmetry)
        polished = _whole(potential, guess, rest, newton)
        return Found(polished.nodes, steps + polished.iterations, symmetry)
    apart_from_loads = find_symmetry(potential, nodes, rest, loads=False) if start is None else None
    if apart_from_loads is None:
        return _whole(potential, nodes, rest, newton)
    guess, steps = _in_sector(potential, apart_from_loads, nodes, rest, newton)
    found = _whole(potential, guess, rest, newton)
    return Found(found.nodes, steps + found.iterations, None)


def _whole(potential: Potential, nodes: np.ndarray, rest: np.ndarray, newton: Newton) -> Found:
    """Descend on the whole structure, its stiffest members taken softer at first where stiffnesses differ a lot."""
    steps = 0
    for softened in _softened(potential, rest):
        point, tried = replace(newton, tol=max(newton.tol, _ROUGH)).minimise(softened, nodes, rest)
        nodes, steps = point.nodes, steps + tried
    point, tried = newton.minimise(potential, nodes, rest)
    return Found(point.nodes, steps + tried, None)


def _softened(potential: Potential, rest: np.ndarray) -> Iterator[Potential]:
    """The structure with stiffnesses of at most 1e2, 1e4, ... times the median one, below the largest.

    A descent with a stiff member has to go round in steps that keep its length: at a ratio of 1e6 it took more than
    200. From the rest with a member a hundred times softer it takes a few, because the length is nearly right.
    """
    members = potential.members
    axial = members.stiffness if members.law == "k" else members.stiffness / rest
    if axial.size == 0:
        return
    cap = _GRADED * float(np.median(axial))
    while cap < axial.max():
        stiffness = members.stiffness * np.minimum(1.0, cap / axial)
        yield replace(potential, members=replace(members, stiffness=stiffness))
        cap *= _SOFTER


def _in_sector(
    potential: Potential, symmetry: CyclicSymmetry, nodes: np.ndarray, rest: np.ndarray, newton: Newton
) -> tuple[np.ndarray, int]:
    """All nodes at the rest of one sector, with the rod lengths and pins of the structure as given."""
    sector = Sector.of(potential, symmetry, rest)
    point, steps = newton.descend(sector, sector.restrict(nodes))
    full = symmetry.expand(point.nodes)
    pinned = potential.structure.pinned
    full[pinned] = nodes[pinned]
    return potential.manifold.retract(full, np.zeros(potential.manifold.size)), steps
