"""Cyclic symmetry: turns by 2 pi/n about an axis that carry a scene onto itself.

A turn R about (centre, axis) is a symmetry when R p_i = p_pi(i) for a permutation pi of the nodes that carries rods to
rods and tendons to tendons of the same mass, stiffness and rest length, pins to pins, and R w_i = w_pi(i) for loads.
Only turns that move every node are used, so that the structure splits into n sectors of the same size.

Everything is compared to a tolerance relative to the structure's size and the largest value; the largest mismatch found
is kept. What is solved in one sector is therefore a structure within that distance of the one that was given, and the
answer is checked, and if need be improved, on the given one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import gcd

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from tensctl.elements import Potential

# Builders place nodes to a few 1e-16 of the size, files with nine digits to 1e-9.
_TOLERANCE = 1e-9
# Nodes of one ring agree in height and radius to this part of the size, or to the tolerance when that is larger.
_RING = 1e-6
_SMALLEST = 3


@dataclass(frozen=True, eq=False)
class CyclicSymmetry:
    """How a structure's n sectors are copies of each other.

    Attributes
    ----------
    order : int
        n, the number of sectors.
    axis : (3,)
        Unit vector.
    centre : (3,) m
        A point on the axis.
    nodes, rods, tendons : (n, N/n), (n, nr/n), (n, nt/n) int
        Row s holds the images under s turns of the members in row 0, the sector.
    mismatch : float
        Largest relative difference between a member and its image.
    """

    order: int
    axis: Float[np.ndarray, " 3"]
    centre: Float[np.ndarray, " 3"]
    nodes: Int[np.ndarray, "n sector_nodes"]
    rods: Int[np.ndarray, "n sector_rods"]
    tendons: Int[np.ndarray, "n sector_tendons"]
    mismatch: float

    @cached_property
    def turns(self) -> Float[np.ndarray, "n 3 3"]:
        """Rotation matrices of 0, 1, ... n - 1 turns."""
        return turn(self.axis, 2 * np.pi * np.arange(self.order) / self.order)

    @cached_property
    def turns_to(self) -> Int[np.ndarray, " nodes"]:
        """How many turns carry the sector to each node's."""
        turns = np.empty(self.nodes.size, int)
        turns[self.nodes] = np.arange(self.order)[:, None]
        return turns

    def expand(self, sector: Float[np.ndarray, "sector_nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """All nodes, from the sector's, which are given relative to the centre."""
        full = np.empty((self.nodes.size, 3))
        full[self.nodes] = np.einsum("sij,aj->sai", self.turns, sector) + self.centre
        return full

    def deviation(self, nodes: Float[np.ndarray, "nodes 3"]) -> float:
        """Largest distance of the nodes from being symmetric, relative to the structure's size."""
        own = nodes - self.centre
        images = np.einsum("sij,aj->sai", self.turns, own[self.nodes[0]])
        return float(np.abs(own[self.nodes] - images).max(initial=0.0) / np.ptp(nodes, axis=0).max())


def turn(axis: Float[np.ndarray, " 3"], angles: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k 3 3"]:
    """Rotation matrices about a unit vector."""
    cross = np.cross(np.eye(3), axis)
    flat = np.eye(3) - np.outer(axis, axis)
    return np.outer(axis, axis) + np.cos(angles)[:, None, None] * flat + np.sin(angles)[:, None, None] * cross


def find_symmetry(
    potential: Potential,
    nodes: Float[np.ndarray, "nodes 3"] | None = None,
    rest_lengths: Float[np.ndarray, " tendons"] | None = None,
    *,
    loads: bool = True,
    tol: float = _TOLERANCE,
) -> CyclicSymmetry | None:
    """The cyclic symmetry of largest order n >= 3, or nothing.

    Parameters
    ----------
    potential : Potential
    nodes, rest_lengths : optional
        Where to start from; the structure's own by default. They have to be symmetric too.
    loads : bool
        Whether the loads have to be symmetric.
    tol : float
        Largest relative mismatch allowed.

    Notes
    -----
    The centre is the mean of all nodes; the axis is looked for along the loads, the coordinate axes and the axes of
    inertia. Structures with shared nodes, guides or cables, and planar ones, are not looked at.
    """
    structure = potential.structure
    if not_split(potential) or len(structure.rods) < _SMALLEST:
        return None
    own = structure.nodes if nodes is None else nodes
    rest = potential.members.rest_lengths if rest_lengths is None else rest_lengths
    search = _Search(potential, own, rest, loads, tol)
    for axis in search.axes():
        ring = search.ring_size(axis)
        for n in (k for k in range(ring, _SMALLEST - 1, -1) if ring % k == 0):
            found = search.symmetry(axis, n)
            if found is not None:
                return found
    return None


def not_split(potential: Potential) -> str:
    """What a structure has that is not split into sectors, symmetric or not; empty when it has nothing of it."""
    structure = potential.structure
    has = {
        "nodes that rods share": structure.jointed,
        "guided nodes": structure.has_guides,
        "cables through several nodes": structure.has_cables,
        "a planar form": structure.planar,
    }
    return " and ".join(what for what, there in has.items() if there)


@dataclass(frozen=True, eq=False)
class _Search:
    potential: Potential
    nodes: np.ndarray
    rest: np.ndarray
    loads: bool
    tol: float

    @cached_property
    def centre(self) -> np.ndarray:
        return self.nodes.mean(axis=0)

    @cached_property
    def size(self) -> float:
        return float(np.ptp(self.nodes, axis=0).max())

    @cached_property
    def tree(self) -> cKDTree:
        return cKDTree(self.nodes - self.centre)

    def axes(self) -> list[np.ndarray]:
        """Directions worth trying, the likely ones first."""
        own = self.nodes - self.centre
        moments, inertia = np.linalg.eigh(own.T @ own)
        alone = 2 if moments[2] - moments[1] > moments[1] - moments[0] else 0
        candidates = [np.eye(3)[2], inertia[:, alone], np.eye(3)[0], np.eye(3)[1]]
        total = self.potential.members.forces.sum(axis=0)
        if self.loads and np.linalg.norm(total) > 0:
            candidates = [total / np.linalg.norm(total), *candidates]
        distinct: list[np.ndarray] = []
        for axis in candidates:
            if all(abs(axis @ other) < 1 - 1e-9 for other in distinct):
                distinct.append(axis)
        return distinct

    def ring_size(self, axis: np.ndarray) -> int:
        """Greatest common divisor of how many nodes share a height and a radius."""
        own = self.nodes - self.centre
        height = own @ axis
        radius = np.linalg.norm(own - np.outer(height, axis), axis=1)
        grid = max(_RING, 4 * self.tol) * self.size
        rings = np.round(np.column_stack([height, radius]) / grid + 0.123).astype(np.int64)
        _, counts = np.unique(rings, axis=0, return_counts=True)
        return gcd(*counts.tolist())

    def symmetry(self, axis: np.ndarray, n: int) -> CyclicSymmetry | None:
        """The symmetry with n turns about an axis, or nothing."""
        structure, members = self.potential.structure, self.potential.members
        rotation = turn(axis, np.array([2 * np.pi / n]))[0]
        turned = (self.nodes - self.centre) @ rotation.T
        near = self.tree.query(turned, distance_upper_bound=self.tol * self.size)
        gap, image = np.asarray(near[0]), np.asarray(near[1])
        if not np.isfinite(gap).all() or np.unique(image).size < image.size:
            return None
        rods, tendons = (_image(ends, image) for ends in (structure.rods, structure.tendons))
        if rods is None or tendons is None or (structure.pinned[image] != structure.pinned).any():
            return None
        forces = members.forces if self.loads else np.zeros_like(members.forces)
        mismatch = max(
            float(gap.max()) / self.size,
            _difference(members.mass[rods], members.mass),
            _difference(members.stiffness[tendons], members.stiffness),
            _difference(self.rest[tendons], self.rest),
            _difference(forces[image], forces @ rotation.T),
        )
        orbits = [_orbits(step, n) for step in (image, rods, tendons)]
        if mismatch > self.tol or orbits[0] is None or orbits[1] is None or orbits[2] is None:
            return None
        rods_in = orbits[1]
        nodes_in = _sector_nodes(orbits[0], structure.rods[rods_in[0]], image)
        return CyclicSymmetry(n, axis, self.centre, nodes_in, rods_in, orbits[2], mismatch)


def _difference(image: np.ndarray, own: np.ndarray) -> float:
    size = np.abs(own).max(initial=0.0)
    return float(np.abs(image - own).max() / size) if size > 0 else 0.0


def _image(ends: np.ndarray, image: np.ndarray) -> np.ndarray | None:
    """Where each member goes when its nodes do, or nothing when one goes where there is none."""
    count = image.size
    keys = ends.min(axis=1) * count + ends.max(axis=1)
    moved = image[ends]
    wanted = moved.min(axis=1) * count + moved.max(axis=1)
    order = np.argsort(keys)
    place = order[np.searchsorted(keys, wanted, sorter=order).clip(max=len(keys) - 1)] if len(keys) else order
    return place if np.array_equal(keys[place], wanted) else None


def _orbits(step: np.ndarray, n: int) -> np.ndarray | None:
    """Members by orbit, row s the image of row 0 under s turns; nothing when a turn leaves one where it is."""
    images = np.empty((n, step.size), int)
    images[0] = np.arange(step.size)
    for s in range(1, n):
        images[s] = step[images[s - 1]]
    if not np.array_equal(step[images[-1]], images[0]) or (images[1:] == images[0]).any():
        return None
    return images[:, images.min(axis=0) == images[0]]


def _sector_nodes(orbits: np.ndarray, rods: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Node orbits that begin with both ends of the sector's rods, then nodes without a rod."""
    n = len(orbits)
    ends = np.empty((n, rods.size), int)
    ends[0] = rods.ravel()
    for s in range(1, n):
        ends[s] = image[ends[s - 1]]
    alone = ~np.isin(orbits[0], ends)
    return np.hstack([ends, orbits[:, alone]])
