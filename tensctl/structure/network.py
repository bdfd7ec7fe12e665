"""A structure of any form, from tables of nodes, rods and tendons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tensctl.errors import StructureError
from tensctl.structure.labels import select
from tensctl.structure.structure import Structure

Nodes = Mapping[str, Sequence[float]] | np.ndarray | Sequence[Sequence[float]]
Members = Mapping[str, Sequence[str | int]] | np.ndarray | Sequence[Sequence[int]]


def network(nodes: Nodes, rods: Members, tendons: Members, pins: Iterable[str | int] = ()) -> Structure:
    """Build a structure from its nodes and members.

    Parameters
    ----------
    nodes : table name -> [x, y, z], or (N, 3) array, m
        Nodes of an array are named `1`, `2`, ...
    rods, tendons : table name -> [tail, head], or (k, 2) array of indices from 0
        Members of an array are named `r1`, ... and `t1`, ...
    pins : iterable
        Labels, patterns or indices of nodes held by the ground.

    Raises
    ------
    StructureError
        A member that names an unknown node, or any rule of `Structure.verify`.
    """
    node_labels, points = _points(nodes)
    rod_labels, rod_ends = _members(rods, node_labels, "r", "rod")
    tendon_labels, tendon_ends = _members(tendons, node_labels, "t", "tendon")
    held = [node_labels[p] if isinstance(p, int | np.integer) else p for p in pins]
    structure = Structure(
        nodes=points,
        rods=rod_ends,
        tendons=tendon_ends,
        node_labels=node_labels,
        rod_labels=rod_labels,
        tendon_labels=tendon_labels,
        pinned=select(node_labels, held, "pins"),
    )
    structure.verify()
    return structure


def _points(nodes: Nodes) -> tuple[tuple[str, ...], np.ndarray]:
    table = isinstance(nodes, Mapping)
    points = np.array(list(nodes.values()) if table else nodes, float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise StructureError(f"nodes have shape {points.shape}; three coordinates a node are expected.")
    labels = nodes.keys() if isinstance(nodes, Mapping) else map(str, range(1, len(points) + 1))
    return tuple(labels), points


def _members(members: Members, node_labels, prefix: str, noun: str) -> tuple[tuple[str, ...], np.ndarray]:
    if isinstance(members, Mapping):
        names, pairs = list(members.keys()), list(members.values())
    else:
        pairs = [list(pair) for pair in np.asarray(members, int).reshape(-1, 2).tolist()]
        names = [f"{prefix}{k + 1}" for k in range(len(pairs))]
    index = {label: i for i, label in enumerate(node_labels)}
    ends = [_ends(name, pair, index, noun) for name, pair in zip(names, pairs, strict=True)]
    return tuple(names), np.array(ends, int).reshape(-1, 2)


def _ends(name: str, pair: Sequence[str | int], index: Mapping[str, int], noun: str) -> list[int]:
    if len(pair) != 2:
        raise StructureError(
            f"{noun} {name} names {len(pair)} nodes; exactly two are supported yet, a tail and a head."
        )
    ends = []
    for end in pair:
        position = index.get(end, -1) if isinstance(end, str) else int(end)
        if not 0 <= position < len(index):
            raise StructureError(f"{noun} {name} ends at node {end}, which is not among the {len(index)} nodes.")
        ends.append(position)
    return ends
