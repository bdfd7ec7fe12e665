"""Groups of tendons that carry the same tension: by label, as given, or the orbits of a cyclic symmetry.

A structure is cyclic of order n about an axis when the turn Q by 2 pi/n maps nodes to nodes, pins to pins, rods to rods
and tendons to tendons. Averaging a prestress over the turns keeps its balance, so for symmetric loads tying the orbits
loses nothing in a convex goal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.spatial
from jaxtyping import Float, Int

from tensctl.errors import StructureError
from tensctl.structure import Structure, refuse_cables, refuse_partial
from tensctl.structure.labels import matches

Groups = Sequence[str] | Mapping[str, Sequence[str]] | Int[np.ndarray, " tendons"]

# A turned node lands on another when it is nearer than this part of the structure's size. Equilibria converged to 1e-9
# pass; a smaller number finds no symmetry in them, a larger one finds symmetry that their prestress does not have.
_LANDS = 1e-7


@dataclass(frozen=True, eq=False)
class CyclicOrbits:
    """A turn that maps a structure to itself.

    Attributes
    ----------
    order : int
        n of the turn by 2 pi/n.
    centre, axis : (3,) m, (3,)
    node_map, tendon_map : (N,), (nt,) int
        Where each node and tendon lands.
    misfit : float, m
        Largest distance between a turned node and the node that it lands on.
    """

    order: int
    centre: Float[np.ndarray, " 3"]
    axis: Float[np.ndarray, " 3"]
    node_map: Int[np.ndarray, " nodes"]
    tendon_map: Int[np.ndarray, " tendons"]
    misfit: float

    @property
    def groups(self) -> Int[np.ndarray, " tendons"]:
        """Orbits of the tendons, numbered in the order of their first tendon."""
        smallest, at = np.arange(self.tendon_map.size), self.tendon_map
        for _ in range(self.order - 1):
            smallest, at = np.minimum(smallest, at), self.tendon_map[at]
        return np.unique(smallest, return_inverse=True)[1]


def tendon_groups(structure: Structure, groups: Groups | None) -> Int[np.ndarray, " tendons"]:
    """Number the groups of tendons that share one tension; a tendon in no group is one by itself.

    Parameters
    ----------
    groups : patterns, table name -> patterns, (nt,) int, or None
        `["t5_*", "t8_*"]` makes two groups; `{"inner": ["t9_*", "t10_*"]}` makes one; None ties nothing.

    Raises
    ------
    StructureError
        A pattern that names nothing, a tendon in two groups, or an array of the wrong shape.
    """
    count = len(structure.tendons)
    if groups is None:
        return np.arange(count)
    if isinstance(groups, np.ndarray):
        if groups.shape != (count,) or groups.dtype.kind not in "iu":
            raise StructureError(
                f"groups have shape {groups.shape} and type {groups.dtype}; one integer a tendon is expected, "
                f"({count},)."
            )
        return np.unique(groups, return_inverse=True)[1]
    table = groups if isinstance(groups, Mapping) else {pattern: [pattern] for pattern in groups}
    owner = np.full(count, -1)
    for g, (name, patterns) in enumerate(table.items()):
        found = sorted({t for p in patterns for t in matches(structure.tendon_labels, p, f"group {name}")})
        taken = [t for t in found if owner[t] >= 0]
        if taken:
            raise StructureError(
                f"tendon {structure.tendon_labels[taken[0]]} is in the groups {list(table)[owner[taken[0]]]} and "
                f"{name}; one group a tendon is expected."
            )
        owner[found] = g
    alone = owner < 0
    owner[alone] = len(table) + np.arange(alone.sum())
    return np.unique(owner, return_inverse=True)[1]


def cyclic_orbits(
    structure: Structure,
    nodes: Float[np.ndarray, "nodes 3"] | None = None,
    *,
    axis: Sequence[float] | None = None,
    tol: float = _LANDS,
) -> CyclicOrbits | None:
    """The cyclic symmetry of highest order, or None when there is none.

    Parameters
    ----------
    nodes : (N, 3) m, optional
        The structure's own by default.
    axis : (3,), optional
        Direction of the axis; without it the coordinate axes and the principal axes through the mean node are tried,
        which misses a skew axis of a structure whose second moments are all equal.
    tol : float
        Part of the structure's size by which a turned node may miss.

    Raises
    ------
    StructureError
        For a structure with cables or guides, or in a plane.
    """
    refuse_cables(structure, "its cyclic symmetry is not looked for", "give the groups of tendons by label")
    refuse_partial(structure, "its cyclic symmetry is not looked for", "give the groups of tendons by label")
    nodes = structure.nodes if nodes is None else np.asarray(nodes, float)
    centred = nodes - nodes.mean(axis=0)
    size = np.linalg.norm(centred, axis=1).max(initial=0.0)
    best: CyclicOrbits | None = None
    for direction in _axes(centred, axis):
        for order in range(_largest_order(centred, direction, tol * size), (best.order if best else 1), -1):
            found = _turned(structure, nodes, direction, order, tol * size)
            if found is not None:
                best = found
                break
    return best


def _axes(centred: np.ndarray, axis: Sequence[float] | None) -> list[np.ndarray]:
    if axis is not None:
        return [np.asarray(axis, float) / np.linalg.norm(axis)]
    principal = np.linalg.svd(centred, full_matrices=True)[2]
    return [*np.eye(3)[::-1], *principal]


def _largest_order(centred: np.ndarray, axis: np.ndarray, tol: float) -> int:
    """No turn can have more nodes in its smallest orbit than there are off the axis."""
    off = np.linalg.norm(np.cross(centred, axis), axis=1) > tol
    return int(off.sum())


def _turned(structure: Structure, nodes: np.ndarray, axis: np.ndarray, order: int, tol: float) -> CyclicOrbits | None:
    centre = nodes.mean(axis=0)
    angle, skew = 2 * np.pi / order, np.cross(np.eye(3), axis)
    # Rodrigues' formula; np.cross(I, axis) is minus the skew matrix, which only changes the sense of the turn.
    Q = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    found = scipy.spatial.cKDTree(nodes).query(centre + (nodes - centre) @ Q.T)
    distance, lands = np.asarray(found[0], float), np.asarray(found[1], int)
    if distance.max(initial=0.0) > tol or np.unique(lands).size < lands.size:
        return None
    if not np.array_equal(structure.pinned[lands], structure.pinned) or _mapped(structure.rods, lands) is None:
        return None
    tendon_map = _mapped(structure.tendons, lands)
    if tendon_map is None:
        return None
    return CyclicOrbits(order, centre, axis, lands, tendon_map, float(distance.max(initial=0.0)))


def _mapped(members: np.ndarray, lands: np.ndarray) -> np.ndarray | None:
    """Where each member lands, or None when one lands where there is none."""
    place = {frozenset(ends): k for k, ends in enumerate(members.tolist())}
    found = [place.get(frozenset(ends), -1) for ends in lands[members].tolist()]
    return None if -1 in found else np.array(found, int)
