"""Cables: tendons that run without friction through the nodes between their ends, with one tension all along.

    length l = sum of the segments' lengths,   energy V(l, L) as of any tendon

A tendon of two nodes has one segment, itself.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int

from tensctl.errors import StructureError

if TYPE_CHECKING:
    from tensctl.structure.structure import Structure

Path = tuple[int, ...]


def paths_of(tendons: Int[np.ndarray, "tendons 2"], vias: tuple[Path, ...]) -> tuple[Path, ...]:
    """All nodes of every tendon, from the first to the last."""
    between = vias or ((),) * len(tendons)
    return tuple((a, *via, b) for (a, b), via in zip(tendons.tolist(), between, strict=True))


def segments_of(paths: tuple[Path, ...]) -> tuple[Int[np.ndarray, "segments 2"], Int[np.ndarray, " segments"]]:
    """Pieces from node to node in order of the tendons, and the tendon that each is a piece of."""
    pieces = [pair for path in paths for pair in itertools.pairwise(path)]
    counts = [len(path) - 1 for path in paths]
    return np.array(pieces, int).reshape(-1, 2), np.repeat(np.arange(len(paths)), counts)


def refuse_cables(structure: Structure, what: str, instead: str) -> None:
    """Refuse a structure with cables where only tendons of two nodes are understood.

    Raises
    ------
    StructureError
        One sentence with the first cable, what is refused and what to do instead.
    """
    for label, via in zip(structure.tendon_labels, structure.vias, strict=False):
        if via:
            raise StructureError(f"tendon {label} is a cable of {len(via) + 2} nodes, and {what}; {instead}.")


def check_tendons(structure: Structure) -> None:
    """Check that no tendon stays where it is, and that no two tendons are one.

    Raises
    ------
    StructureError
        One sentence that names the first tendon that breaks a rule.
    """
    seen: dict[tuple, str] = {}
    for label, path in zip(structure.tendon_labels, structure.paths, strict=True):
        pieces = list(itertools.pairwise(path))
        twice = next((a for a, b in pieces if a == b), None)
        if twice is not None:
            name = structure.node_labels[twice]
            raise StructureError(
                f"tendon {label} starts and ends at {name}; give two different nodes."
                if len(path) == 2
                else f"tendon {label} passes node {name} twice in a row; name it once."
            )
        way = tuple(sorted((min(piece), max(piece)) for piece in pieces))
        if way in seen:
            same = "join the same two nodes" if len(path) == 2 else "run along the same nodes"
            raise StructureError(
                f"tendons {seen[way]} and {label} {same}; give one tendon with the sum of both stiffnesses."
            )
        seen[way] = label
