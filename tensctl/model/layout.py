"""Where the kernel keeps nodes: as the structure has them, or every rod end by itself where rods share nodes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from tensctl.elements import JointedManifold, RodManifold
from tensctl.structure import Structure


@dataclass(frozen=True, eq=False)
class Layout:
    """Nodes of the kernel.

    Attributes
    ----------
    rods : (nr, 2) int
        Kernel nodes of each rod.
    place : (N,) int
        The kernel node that stands for each node: tendons and loads act there.
    anchor : (K, 3) m
        Kernel nodes as the structure has them.
    """

    rods: Int[np.ndarray, "rods 2"]
    place: Int[np.ndarray, " nodes"]
    anchor: Float[np.ndarray, "places 3"]

    @classmethod
    def of(cls, structure: Structure, manifold: RodManifold | JointedManifold) -> Layout:
        """Layout of a structure."""
        if isinstance(manifold, RodManifold):
            return cls(structure.rods, np.arange(len(structure.nodes)), structure.nodes)
        bare = np.flatnonzero(manifold.shown < 0)
        place = manifold.shown.copy()
        place[bare] = manifold.end_node.size + np.arange(bare.size)
        anchor = structure.nodes[np.concatenate([manifold.end_node, bare])]
        return cls(manifold.ends.rods, place, anchor)

    @cached_property
    def _of_nodes(self) -> bool:
        """Whether kernel nodes are the structure's, in its order; as many in another order are not."""
        return np.array_equal(self.place, np.arange(len(self.anchor)))

    def spread(self, forces: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "places 3"]:
        """Nodal forces where the kernel has them."""
        if self._of_nodes:
            return forces
        spread = np.zeros_like(self.anchor)
        spread[self.place] = forces
        return spread
