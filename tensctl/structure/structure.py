"""A tensegrity structure: nodes, rigid rods, tendons and the nodes held by the ground.

Member vectors point from tail to head: d = p_head - p_tail ([S] 2.1, [W] section 2).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from tensctl.errors import StructureError
from tensctl.structure.cables import Path, check_tendons, paths_of, segments_of
from tensctl.structure.pins import check_held, letters


@dataclass(frozen=True, eq=False)
class Structure:
    """What is built: geometry and topology, no material.

    Attributes
    ----------
    nodes : (N, 3) array, m
        Initial node positions.
    rods, tendons : (nr, 2), (nt, 2) int arrays
        Node indices, tail then head.
    node_labels, rod_labels, tendon_labels : tuples of str
    pinned : (N,) bool array
        Nodes held by the ground in every direction.
    vias : one tuple of node indices a tendon, or empty
        The nodes that a cable runs through between its tail and its head; none for a tendon of two nodes.
    guides : (N, 3) bool array
        Directions in which the ground holds a node that is not pinned.
    planar : bool
        All nodes have z = 0 and stay there: the third dimension is left out.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    rods: Int[np.ndarray, "rods 2"]
    tendons: Int[np.ndarray, "tendons 2"]
    node_labels: tuple[str, ...]
    rod_labels: tuple[str, ...]
    tendon_labels: tuple[str, ...]
    pinned: Bool[np.ndarray, " nodes"]
    vias: tuple[Path, ...] = ()
    guides: Bool[np.ndarray, "held 3"] = field(default_factory=lambda: np.zeros((0, 3), bool))
    planar: bool = False

    def __post_init__(self) -> None:
        """Nothing is held in part unless it is said."""
        if not len(self.guides):
            object.__setattr__(self, "guides", np.zeros((len(self.nodes), 3), bool))

    @cached_property
    def held(self) -> Bool[np.ndarray, "nodes 3"]:
        """Directions in which the ground holds each node."""
        return self.guides | self.pinned[:, None]

    @cached_property
    def free(self) -> Bool[np.ndarray, "nodes 3"]:
        """Directions in which each node can move; never z when planar."""
        return ~self.held & np.array([True, True, not self.planar])

    @property
    def dimension(self) -> int:
        """3, or 2 when planar."""
        return 2 if self.planar else 3

    @property
    def has_guides(self) -> bool:
        """Whether a node is held in some directions only."""
        return bool(self.guides.any())

    @property
    def rod_vectors(self) -> Float[np.ndarray, "rods 3"]:
        """Rod vectors q2 = p2 - p1 ([S] Theorem 3.1), m."""
        return self.nodes[self.rods[:, 1]] - self.nodes[self.rods[:, 0]]

    @cached_property
    def rod_lengths(self) -> Float[np.ndarray, " rods"]:
        """Rod lengths, m; rods are rigid, so these hold for ever."""
        return np.linalg.norm(self.rod_vectors, axis=1)

    @property
    def tendon_lengths(self) -> Float[np.ndarray, " tendons"]:
        """Tendon lengths at the initial nodes, m."""
        return self.lengths_at(self.nodes)

    @property
    def has_cables(self) -> bool:
        """Whether a tendon runs through more than two nodes."""
        return any(self.vias)

    @cached_property
    def paths(self) -> tuple[Path, ...]:
        """All nodes of every tendon, from tail to head."""
        return paths_of(self.tendons, self.vias)

    @cached_property
    def segments(self) -> Int[np.ndarray, "segments 2"]:
        """Pieces of tendons from node to node, in order of the tendons; without cables the tendons themselves."""
        return segments_of(self.paths)[0] if self.has_cables else self.tendons

    @cached_property
    def segment_tendon(self) -> Int[np.ndarray, " segments"]:
        """The tendon that each segment is a piece of."""
        return segments_of(self.paths)[1] if self.has_cables else np.arange(len(self.tendons))

    @property
    def segment_labels(self) -> tuple[str, ...]:
        """Labels of the tendons that the segments are pieces of."""
        return tuple(self.tendon_labels[t] for t in self.segment_tendon)

    def lengths_at(self, nodes: Float[np.ndarray, "*t nodes 3"]) -> Float[np.ndarray, "*t tendons"]:
        """Tendon lengths at other nodes, m: of a cable the sum over its segments."""
        ends = self.segments
        each = np.linalg.norm(nodes[..., ends[:, 1], :] - nodes[..., ends[:, 0], :], axis=-1)
        return self.over_segments(np.add, each) if self.has_cables else each

    def over_segments(self, combine: np.ufunc, values: np.ndarray) -> np.ndarray:
        """Values of segments, along the last axis, taken together to one a tendon."""
        first = np.searchsorted(self.segment_tendon, np.arange(len(self.tendons)))
        return combine.reduceat(values, first, axis=-1) if first.size else values

    @property
    def grounded_tendons(self) -> Bool[np.ndarray, " tendons"]:
        """Tendons all of whose nodes are pinned: their length never changes, so they move nothing."""
        return np.asarray(self.over_segments(np.logical_and, np.all(self.pinned[self.segments], axis=1)))

    @property
    def jointed(self) -> bool:
        """Whether rods share a node that is not on the ground."""
        ends = np.bincount(self.rods.ravel(), minlength=len(self.nodes))
        return bool((ends[~self.pinned] > 1).any())

    def as_recipe(self) -> dict:
        """The structure as the scene's `kind = "network"` or "planar": tables by label, exact to the last bit."""
        named = self.node_labels
        points = self.nodes[:, : self.dimension]
        return {
            "kind": "planar" if self.planar else "network",
            "nodes": {label: p.tolist() for label, p in zip(named, points, strict=True)},
            "rods": _named_nodes(self.rod_labels, self.rods, named),
            "tendons": _named_nodes(self.tendon_labels, self.paths, named),
            "pins": self._pins(),
        }

    def _pins(self) -> list[str] | dict[str, str]:
        """Labels of pinned nodes, or held directions by label where some are held in part."""
        at = self.held & np.array([True, True, not self.planar])
        table = {label: letters(row) for label, row in zip(self.node_labels, at, strict=True) if row.any()}
        return table if self.has_guides else list(table)

    def verify(self) -> None:
        """Check the structure against the rules that every later stage relies on.

        Raises
        ------
        StructureError
            One sentence that names the first member that breaks a rule.
        """
        _check_finite(self)
        _check_rods(self)
        check_tendons(self)
        _check_nodes(self)
        check_held(self)


def lengths(nodes: Float[np.ndarray, "nodes 3"], members: Int[np.ndarray, "members 2"]) -> np.ndarray:
    """Member lengths, m, at the given nodes."""
    return np.linalg.norm(nodes[members[:, 1]] - nodes[members[:, 0]], axis=1)


def _named_nodes(labels, members, node_labels) -> dict[str, list[str]]:
    return {label: [node_labels[i] for i in nodes] for label, nodes in zip(labels, members, strict=True)}


def _check_finite(structure: Structure) -> None:
    bad = ~np.isfinite(structure.nodes).all(axis=1)
    if bad.any():
        i = int(bad.argmax())
        raise StructureError(
            f"node {structure.node_labels[i]} is at {structure.nodes[i].tolist()}; "
            "coordinates must be finite numbers in m."
        )


def _check_rods(structure: Structure) -> None:
    if not len(structure.rods):
        raise StructureError("the structure has no rod, so nothing in it moves; give at least one.")
    size = np.ptp(structure.nodes, axis=0).max(initial=0.0)
    for label, (a, b), length in zip(structure.rod_labels, structure.rods, structure.rod_lengths, strict=True):
        if not length > 1e-12 * size:
            names = f"{structure.node_labels[a]} and {structure.node_labels[b]}"
            raise StructureError(
                f"rod {label} has length {length:g} m between {names}; a rod needs two different places."
            )


def _check_nodes(structure: Structure) -> None:
    ends = np.bincount(structure.rods.ravel(), minlength=len(structure.nodes))
    for label, count, held in zip(structure.node_labels, ends, structure.pinned, strict=True):
        if count == 0 and not held:
            raise StructureError(
                f"node {label} belongs to no rod and is not pinned, so it has no mass; "
                "end a rod there or pin it to the ground."
            )
