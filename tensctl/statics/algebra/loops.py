"""The law of geometric connectivity and the count of nodes ([W] section 3).

    sum of all branch vectors in any loop = 0:   loops' e = 0          (12)
    n_p = 2 n_b0 + n~_p                                                (below "oriented graph")

with n_b0 bars that touch no other bar. [W] bounds n~_p by 2 (n_b - n_b0); since m >= 2 touching bars share a node, a
cluster of m has at most m + 1 <= 3m/2 nodes, so n~_p <= 3 (n_b - n_b0) / 2 holds: the printed bound is too wide once
bars touch. Nodes that end no bar at all come on top of both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy import sparse

from tensctl.statics.algebra.forest import spanning_forest
from tensctl.statics.algebra.network import Network


def loop_matrix(n_p: int, members: Int[np.ndarray, "members 2"]) -> sparse.csr_array:
    """Independent loops (members, r) with entries -1, 0, 1: column j walks once around loop j.

    r = members - n_p + pieces, exactly; incidence @ loops = 0 in integers. Each loop consists of one chord of the
    spanning forest and the way back through the tree.
    """
    forest = spanning_forest(n_p, members)
    tails, heads = members[forest.chords, 0], members[forest.chords, 1]
    back = forest.paths[tails] - forest.paths[heads]
    on_tree = sparse.csr_array(
        (np.ones(len(forest.tree), np.int64), (forest.tree, np.arange(len(forest.tree)))),
        shape=(len(members), len(forest.tree)),
    )
    on_chords = sparse.csr_array(
        (np.ones(len(forest.chords), np.int64), (forest.chords, np.arange(len(forest.chords)))),
        shape=(len(members), len(forest.chords)),
    )
    return sparse.csr_array(on_chords + on_tree @ back.T)


def loop_gaps(network: Network, s: Float[np.ndarray, "strings d"], b: Float[np.ndarray, "bars d"]) -> np.ndarray:
    """What the branch vectors leave open around each independent loop, (r, d) m; zero is the law (12)."""
    return loop_matrix(network.n_p, network.members).T @ np.vstack([s, b])


@dataclass(frozen=True)
class NodeCount:
    """Nodes by what meets there.

    Attributes
    ----------
    lone_bars : int
        n_b0, bars that touch no other bar; they bring 2 n_b0 nodes.
    of_touching_bars : int
        n~_p, nodes of the other bars.
    without_bar : int
        Nodes that only strings reach; [W] has none.
    """

    lone_bars: int
    of_touching_bars: int
    without_bar: int

    @property
    def n_p(self) -> int:
        """All nodes."""
        return 2 * self.lone_bars + self.of_touching_bars + self.without_bar


def node_count(network: Network) -> NodeCount:
    """Count the nodes the way [W] does."""
    ends = network.bars_at_node
    lone = (ends[network.bars] == 1).all(axis=1)
    without = int((ends == 0).sum())
    return NodeCount(int(lone.sum()), network.n_p - without - 2 * int(lone.sum()), without)
