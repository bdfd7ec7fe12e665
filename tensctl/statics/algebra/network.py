"""The graph of a tensegrity structure: nodes, bars and strings as pairs of node indices ([W] section 3).

    s = (C_s' x I_3) p,   b = (C_b' x I_3) p        (19); a member's vector points from its tail to its head

Nothing is asked of the bars: they may share nodes (class k, Definition 4), close loops or leave nodes to strings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Int
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from tensctl.errors import StructureError
from tensctl.statics.algebra.incidence_matrices import incidence
from tensctl.structure import Structure, refuse_cables

Pairs = np.ndarray | Sequence[Sequence[int]]


@dataclass(frozen=True, eq=False)
class Network:
    """Who is joined to whom; `Network.build` and `Network.of` make one from lists or from a structure.

    Attributes
    ----------
    n_p : int
        Nodes, counted from 0 in every index below ([W] counts from 1).
    bars, strings : (n_b, 2), (n_s, 2) int arrays
        Tail, then head.
    """

    n_p: int
    bars: Int[np.ndarray, "bars 2"]
    strings: Int[np.ndarray, "strings 2"]

    @classmethod
    def build(cls, n_p: int, bars: Pairs, strings: Pairs) -> Network:
        """Build a network from pairs of node indices and check every member; several components are allowed.

        Raises
        ------
        StructureError
            A member that names an unknown node, ends where it starts, or repeats another of its kind.
        """
        network = cls(int(n_p), _pairs(bars, "bar"), _pairs(strings, "string"))
        _check_members(network.n_p, network.bars, "bar", "leave one of them out")
        _check_members(network.n_p, network.strings, "string", "give one string with the sum of both coefficients")
        return network

    @classmethod
    def of(cls, structure: Structure) -> Network:
        """The network of a structure: rods are bars, tendons are strings.

        Pins are not part of it: what the ground does to a pinned node is a load w like any other.

        Raises
        ------
        StructureError
            For a structure with cables.
        """
        refuse_cables(structure, "a string of the network joins two nodes", "give each piece its own tendon")
        return cls.build(len(structure.nodes), structure.rods, structure.tendons)

    @property
    def n_b(self) -> int:
        """Bars."""
        return len(self.bars)

    @property
    def n_s(self) -> int:
        """Strings."""
        return len(self.strings)

    @property
    def members(self) -> Int[np.ndarray, "members 2"]:
        """Strings, then bars: the order of the branches in (18)."""
        return np.vstack([self.strings, self.bars])

    @cached_property
    def C_s(self) -> sparse.csr_array:
        """String incidence (n_p, n_s), S of (19)."""
        return incidence(self.n_p, self.strings)

    @cached_property
    def C_b(self) -> sparse.csr_array:
        """Bar incidence (n_p, n_b), B of (19)."""
        return incidence(self.n_p, self.bars)

    @property
    def bars_at_node(self) -> Int[np.ndarray, " nodes"]:
        """How many bars end at each node."""
        return np.bincount(self.bars.ravel(), minlength=self.n_p)

    @property
    def class_k(self) -> int:
        """The class k: at most k bars meet at a node.

        Definition 4 prints "only k", which no class 2 structure with a free bar end would satisfy.
        """
        return int(self.bars_at_node.max(initial=0))

    def verify(self) -> None:
        """Check what sections 4 and 5 of [W] rely on: members as in `build`, bars and strings there, one piece.

        Raises
        ------
        StructureError
            One sentence that names the rule, what was given and what to try.
        """
        type(self).build(self.n_p, self.bars, self.strings)
        if not (self.n_b and self.n_s):
            raise StructureError(
                f"the network has {self.n_b} bars and {self.n_s} strings; prestress needs at least one of each."
            )
        pieces, piece = connected_components(_adjacency(self.n_p, self.members), directed=False)
        if pieces > 1:
            example = int((piece != piece[0]).argmax())
            raise StructureError(
                f"the network falls into {pieces} pieces (node {example} is not joined to node 0); one piece is "
                "expected, so join them by a member or treat each piece as a network of its own."
            )


def component_labels(n_p: int, members: Int[np.ndarray, "members 2"]) -> tuple[int, Int[np.ndarray, " nodes"]]:
    """How many connected pieces nodes and members form (a node without member is one), and the piece of each node."""
    count, labels = connected_components(_adjacency(n_p, members), directed=False)
    return int(count), labels


def _adjacency(n_p: int, members: np.ndarray) -> sparse.csr_array:
    ones = np.ones(len(members), np.int8)
    return sparse.csr_array((ones, (members[:, 0], members[:, 1])), shape=(n_p, n_p))


def _pairs(members: Pairs, noun: str) -> np.ndarray:
    pairs = np.array(members, int)
    pairs = pairs.reshape(0, 2) if pairs.size == 0 else pairs
    if pairs.ndim != 2 or pairs.shape[1] != 2:
        raise StructureError(f"{noun}s have shape {pairs.shape}; one (tail, head) pair a {noun} is expected.")
    pairs.setflags(write=False)
    return pairs


def _check_members(n_p: int, pairs: np.ndarray, noun: str, remedy: str) -> None:
    seen: dict[frozenset[int], int] = {}
    for k, (tail, head) in enumerate(pairs.tolist()):
        if not (0 <= tail < n_p and 0 <= head < n_p):
            raise StructureError(
                f"{noun} {k} joins nodes {tail} and {head}; the network has {n_p} nodes, counted from 0, "
                "so give indices below that."
            )
        if tail == head:
            raise StructureError(f"{noun} {k} starts and ends at node {tail}; give two different nodes.")
        ends = frozenset((tail, head))
        if ends in seen:
            raise StructureError(f"{noun}s {seen[ends]} and {k} join the same nodes {tail} and {head}; {remedy}.")
        seen[ends] = k
