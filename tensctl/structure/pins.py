"""What the ground holds: whole nodes, or single directions of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import StructureError
from tensctl.structure.labels import matches

if TYPE_CHECKING:
    from tensctl.structure.structure import Structure

Pins = Iterable[str] | Mapping[str, str]


def holds(labels: Sequence[str], pins: Pins, axes: str = "xyz") -> tuple[np.ndarray, np.ndarray]:
    """What pins hold: nodes held in every direction, (N,) bool, and directions of others, (N, 3) bool.

    Parameters
    ----------
    labels : node labels
    pins : labels or patterns, or a table pattern -> directions
        In a table a later pattern wins. All directions of a node, or none named by a list, pin it whole.
    axes : str
        Directions that there are.

    Raises
    ------
    StructureError
        A pattern that names no node, or a direction that does not exist.
    """
    table = pins if isinstance(pins, Mapping) else dict.fromkeys(pins, axes)
    held = np.zeros((len(labels), 3), bool)
    for pattern, directions in table.items():
        if not directions or not set(directions) <= set(axes):
            raise StructureError(f'pins: {pattern} = "{directions}"; expected some of the letters in "{axes}".')
        held[matches(labels, pattern, "pins")] = [axis in directions for axis in "xyz"]
    return split(held, axes)


def split(held: np.ndarray, axes: str = "xyz") -> tuple[np.ndarray, np.ndarray]:
    """Held directions (N, 3) as nodes held in every direction, and what else is held of the others."""
    pinned = np.asarray(held[:, : len(axes)].all(axis=1))
    return pinned, held & ~pinned[:, None]


def letters(held: np.ndarray) -> str:
    """Directions of one node as a scene spells them."""
    return "".join(axis for axis, at in zip("xyz", held, strict=True) if at)


def check_held(structure: Structure) -> None:
    """Check that what the ground holds fits the nodes, and that a planar structure lies in its plane.

    Raises
    ------
    StructureError
        One sentence that names the first node that breaks a rule.
    """
    if structure.guides.shape != structure.nodes.shape:
        raise StructureError(
            f"guides have shape {structure.guides.shape}; three directions a node are expected, "
            f"{structure.nodes.shape}."
        )
    both = structure.pinned & structure.guides.any(axis=1)
    if both.any():
        label = structure.node_labels[int(both.argmax())]
        raise StructureError(f"node {label} is pinned and guided; pin it, or guide it in some directions.")
    if structure.planar:
        _check_planar(structure)


def refuse_partial(structure: Structure, what: str, instead: str) -> None:
    """Refuse guides and planar structures where only whole pins in space are understood.

    Raises
    ------
    StructureError
        One sentence with the first guided node, or the plane, what is refused and what to do instead.
    """
    if structure.has_guides:
        node = int(structure.guides.any(axis=1).argmax())
        held = letters(structure.guides[node])
        raise StructureError(f"node {structure.node_labels[node]} is held in {held} only, and {what}; {instead}.")
    if structure.planar:
        raise StructureError(f"the structure is planar, and {what}; {instead}.")


def _check_planar(structure: Structure) -> None:
    off = (structure.nodes[:, 2] != 0) | structure.guides[:, 2]
    if off.any():
        i = int(off.argmax())
        raise StructureError(
            f"node {structure.node_labels[i]} has z = {structure.nodes[i, 2]:g} m or is guided in z; a planar "
            'structure lies in z = 0 and has no third direction; use kind = "network" for one in space.'
        )
