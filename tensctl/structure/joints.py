"""Joints: pairs of nodes closed to one, and the tendons that then run side by side merged into one.

A merged node or tendon keeps the labels of its parts, joined with "+": `t1_2_2+t4_2_2`. Patterns match any part, and a
number for a tendon is meant for each part, so two tendons of 100 N/m side by side make one of 200 N/m.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tensctl.structure.pins import split
from tensctl.structure.structure import Structure


def joined(structure: Structure, pairs: Iterable[tuple[int, int]]) -> Structure:
    """Close pairs of nodes, given by index, to one node each; the structure's nodes must coincide there.

    The structure is in space and without cables, as shells are.
    The merged node takes the first one's place in the order of nodes; a merged tendon keeps the first one's direction.
    """
    group = np.arange(len(structure.nodes))
    for a, b in pairs:
        group[group == max(group[a], group[b])] = min(group[a], group[b])
    kept, place = np.unique(group, return_inverse=True)
    tendon_labels, tendons = _merged_tendons(structure, place)
    pinned, guides = split(np.array([structure.held[group == k].any(axis=0) for k in kept]))
    return Structure(
        nodes=np.stack([structure.nodes[group == k].mean(axis=0) for k in kept]),
        rods=place[structure.rods],
        tendons=tendons,
        node_labels=tuple("+".join(structure.node_labels[a] for a in np.flatnonzero(group == k)) for k in kept),
        rod_labels=structure.rod_labels,
        tendon_labels=tendon_labels,
        pinned=pinned,
        guides=guides,
    )


def _merged_tendons(structure: Structure, place: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    parts: dict[frozenset[int], list[int]] = {}
    for t, ends in enumerate(place[structure.tendons]):
        parts.setdefault(frozenset(ends.tolist()), []).append(t)
    labels = tuple("+".join(structure.tendon_labels[t] for t in group) for group in parts.values())
    return labels, place[structure.tendons[[group[0] for group in parts.values()]]]
