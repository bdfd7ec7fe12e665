"""Spanning forest of a graph: a tree for every connected piece, and the way from its root to each node.

    p_i = p_root(i) + sum_k paths[i, k] e_tree[k],   paths in {-1, 0, 1}

Everything that [W] says about loops and ranks follows from it in integers: one more member than the forest, one loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int
from scipy import sparse


@dataclass(frozen=True, eq=False)
class Forest:
    """A tree for every connected piece, and what is left over.

    Attributes
    ----------
    tree : (k,) int
        Members of the forest, in the order in which breadth first search finds them.
    chords : (r,) int
        The other members; each closes one loop.
    roots : (c,) int
        Node of least index in each piece.
    root_of : (n_p,) int
        Position in `roots` of the piece of each node.
    paths : sparse int (n_p, k)
        Signed tree members from the root to each node.
    """

    tree: Int[np.ndarray, " tree"]
    chords: Int[np.ndarray, " chords"]
    roots: Int[np.ndarray, " pieces"]
    root_of: Int[np.ndarray, " nodes"]
    paths: sparse.csr_array


def spanning_forest(n_p: int, members: Int[np.ndarray, "members 2"]) -> Forest:
    """Breadth first forest from the nodes of least index; cost grows with nodes times depth."""
    ways = _ways(n_p, members)
    path: list[list[tuple[int, int]] | None] = [None] * n_p
    root_of = np.zeros(n_p, int)
    roots: list[int] = []
    tree: list[int] = []
    for root in range(n_p):
        if path[root] is not None:
            continue
        path[root] = []
        queue = [root]
        for node in queue:  # grows while it is walked through
            root_of[node] = len(roots)
            for other, member, sign in ways[node]:
                if path[other] is None:
                    path[other] = [*(path[node] or []), (len(tree), sign)]
                    tree.append(member)
                    queue.append(other)
        roots.append(root)
    chords = np.setdiff1d(np.arange(len(members)), tree)
    return Forest(np.array(tree, int), chords, np.array(roots, int), root_of, _matrix(path, len(tree)))


def _ways(n_p: int, members: np.ndarray) -> list[list[tuple[int, int, int]]]:
    """From each node: (node at the other end, member, +1 along the member's vector or -1 against it)."""
    ways: list[list[tuple[int, int, int]]] = [[] for _ in range(n_p)]
    for k, (tail, head) in enumerate(members.tolist()):
        ways[tail].append((head, k, 1))
        ways[head].append((tail, k, -1))
    return ways


def _matrix(path: list[list[tuple[int, int]] | None], width: int) -> sparse.csr_array:
    entries = [(i, k, sign) for i, steps in enumerate(path) for k, sign in steps or []]
    table = np.array(entries, np.int64).reshape(-1, 3)
    return sparse.csr_array((table[:, 2], (table[:, 0], table[:, 1])), shape=(len(path), width))
