"""A structure of any form, in space or in a plane, from tables of nodes, rods and tendons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tensctl.errors import StructureError
from tensctl.structure.pins import holds
from tensctl.structure.structure import Structure

Nodes = Mapping[str, Sequence[float]] | np.ndarray | Sequence[Sequence[float]]
Members = Mapping[str, Sequence[str | int]] | np.ndarray | Sequence[Sequence[int]]
Pins = Iterable[str | int] | Mapping[str, str]


def network(nodes: Nodes, rods: Members, tendons: Members, pins: Pins = ()) -> Structure:
    """Build a structure from its nodes and members.

    Parameters
    ----------
    nodes : table name -> [x, y, z], or (N, 3) array, m
        Nodes of an array are named `1`, `2`, ...
    rods, tendons : table name -> [tail, head], or (k, 2) array of indices from 0
        Members of an array are named `r1`, ... and `t1`, ... A tendon of more than two nodes, [tail, ..., head], is a
        cable that runs through those between without friction.
    pins : iterable, or table label or pattern -> directions
        Labels, patterns or indices of nodes held by the ground; `{"a": "z"}` holds one direction only.

    Raises
    ------
    StructureError
        A member that names an unknown node, or any rule of `Structure.verify`.
    """
    return _built(nodes, rods, tendons, pins, planar=False)


def planar(nodes: Nodes, rods: Members, tendons: Members, pins: Pins = ()) -> Structure:
    """Build a structure in the plane z = 0; the third dimension is left out of every model of it.

    Parameters
    ----------
    nodes : table name -> [x, y], or (N, 2) array, m
    rods, tendons, pins
        As for `network`; directions are x and y.

    Raises
    ------
    StructureError
        As for `network`.
    """
    return _built(nodes, rods, tendons, pins, planar=True)


def _built(nodes: Nodes, rods: Members, tendons: Members, pins: Pins, *, planar: bool) -> Structure:
    node_labels, points = _points(nodes, 2 if planar else 3)
    rod_labels, rod_nodes = _members(rods, node_labels, "r", "rod")
    tendon_labels, tendon_nodes = _members(tendons, node_labels, "t", "tendon")
    vias = tuple(tuple(named[1:-1]) for named in tendon_nodes)
    pinned, guides = holds(node_labels, _named(pins, node_labels), "xy" if planar else "xyz")
    structure = Structure(
        nodes=points,
        rods=_ends(rod_nodes),
        tendons=_ends(tendon_nodes),
        node_labels=node_labels,
        rod_labels=rod_labels,
        tendon_labels=tendon_labels,
        pinned=pinned,
        vias=vias if any(vias) else (),
        guides=guides,
        planar=planar,
    )
    structure.verify()
    return structure


def _named(pins: Pins, node_labels: Sequence[str]) -> list[str] | dict[str, str]:
    if isinstance(pins, Mapping):
        return {str(label): directions for label, directions in pins.items()}
    return [node_labels[p] if isinstance(p, int | np.integer) else p for p in pins]


def _points(nodes: Nodes, dimension: int) -> tuple[tuple[str, ...], np.ndarray]:
    table = isinstance(nodes, Mapping)
    points = np.array(list(nodes.values()) if table else nodes, float)
    if points.ndim != 2 or points.shape[1] != dimension:
        many = "three" if dimension == 3 else "two"
        raise StructureError(f"nodes have shape {points.shape}; {many} coordinates a node are expected.")
    labels = nodes.keys() if isinstance(nodes, Mapping) else map(str, range(1, len(points) + 1))
    return tuple(labels), np.pad(points, ((0, 0), (0, 3 - dimension)))


def _members(members: Members, node_labels, prefix: str, noun: str) -> tuple[tuple[str, ...], list[list[int]]]:
    if isinstance(members, Mapping):
        names, given = list(members.keys()), list(members.values())
    else:
        given = [[int(i) for i in nodes] for nodes in members]
        names = [f"{prefix}{k + 1}" for k in range(len(given))]
    index = {label: i for i, label in enumerate(node_labels)}
    return tuple(names), [_nodes_of(name, nodes, index, noun) for name, nodes in zip(names, given, strict=True)]


def _ends(members: list[list[int]]) -> np.ndarray:
    return np.array([(nodes[0], nodes[-1]) for nodes in members], int).reshape(-1, 2)


def _nodes_of(name: str, named: Sequence[str | int], index: Mapping[str, int], noun: str) -> list[int]:
    if len(named) < 2 or (noun == "rod" and len(named) > 2):
        wanted = "two, a tail and a head" if noun == "rod" else "at least a tail and a head"
        raise StructureError(f"{noun} {name} names {len(named)} nodes; {wanted}, are expected.")
    places = []
    for node in named:
        position = index.get(node, -1) if isinstance(node, str) else int(node)
        if not 0 <= position < len(index):
            raise StructureError(f"{noun} {name} ends at node {node}, which is not among the {len(index)} nodes.")
        places.append(position)
    return places
