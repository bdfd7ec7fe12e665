"""Tensegrity shells of class 1 and 2 on a cylinder ([S] section 2).

In element ij, with theta = 2 pi (i-1)/n and z0 = (j-1)(2h - 2o), the nodes stand at (radius, angle, height)
P1 (R, theta, z0), P2 (R, theta + a, z0 + h), P3 (R, theta + a + pi/n, z0 + h - o), P4 (R, theta + pi/n, z0 + 2h - o).
"""

from __future__ import annotations

import numpy as np

from tensctl.errors import StructureError
from tensctl.structure.joints import joined
from tensctl.structure.pins import Pins, holds
from tensctl.structure.structure import Structure
from tensctl.structure.topology import class_two_joints, element_tendons, node_index


def shell(
    n: int,
    m: int,
    *,
    cls: int = 1,
    primal: bool = False,
    radius: float = 1.0,
    height: float = 1.0,
    overlap: float | None = None,
    twist: float | None = None,
    pins: Pins = (),
) -> Structure:
    """Build an (n, m) shell: n elements around, m stages high.

    Parameters
    ----------
    n, m : int
        Elements around (n >= 3) and stages (m >= 1).
    cls : int
        1: rods do not touch. 2: the stages' rods meet in ball joints ([S] 2.1).
    primal : bool
        Leave out t9 and t10; 8 n m tendons remain of n (10 m - 2) ([S] Definition 2.6).
    radius, height : float, m
        Cylinder radius R, rise h of each rod.
    overlap : float, m
        Overlap o of the two rods of an element; 0.3 in class 1. Class 2 closes for height/2 only.
    twist : float, rad
        Angle a by which a rod turns about the axis on its way up; 1.4 in class 1. Class 2 closes for 2 pi/n only.
    pins : iterable of str, or table pattern -> directions
        Labels or patterns of nodes held by the ground; `{"P1_*_1": "z"}` holds one direction only.

    Returns
    -------
    Structure
        4 n m nodes (`P1_i_j`..), 2 n m rods (`r1_i_j`, `r2_i_j`), tendons `t<alpha>_i_j` by j, then i, then alpha.
        In class 2, 2 n (m + 1) nodes and n (6m + 2) tendons; what was merged keeps both labels: `t1_2_2+t4_2_2`.

    Raises
    ------
    StructureError
        For a size, class or dimension that makes no shell.
    """
    _check(n, m, cls, radius, height)
    overlap, twist = _closing(n, cls, height, overlap, twist)
    node_labels = tuple(f"P{k}_{i}_{j}" for i, j in _elements(n, m) for k in (1, 2, 3, 4))
    labels, ends = _tendons(n, m, primal)
    pinned, guides = holds(node_labels, pins)
    structure = Structure(
        nodes=_cylinder(n, m, radius, height, overlap, twist),
        rods=np.arange(4 * n * m).reshape(-1, 2),
        tendons=ends,
        node_labels=node_labels,
        rod_labels=tuple(f"r{k}_{i}_{j}" for i, j in _elements(n, m) for k in (1, 2)),
        tendon_labels=labels,
        pinned=pinned,
        guides=guides,
    )
    if cls == 2:
        structure = joined(structure, class_two_joints(n, m))
    structure.verify()
    return structure


def _check(n: int, m: int, cls: int, radius: float, height: float) -> None:
    if n < 3:
        raise StructureError(f"n = {n}: a shell closes around its axis with n >= 3 elements.")
    if m < 1:
        raise StructureError(f"m = {m}: a shell has m >= 1 stages.")
    if cls not in (1, 2):
        raise StructureError(f"class = {cls}: a shell has class 1 (rods do not touch) or 2 (they meet in joints).")
    for name, value in (("radius", radius), ("height", height)):
        if not value > 0:
            raise StructureError(f"{name} = {value}: a shell needs a {name} > 0 m.")


def _closing(n: int, cls: int, height: float, overlap: float | None, twist: float | None) -> tuple[float, float]:
    """Overlap and twist, as given or as the class has them."""
    if cls == 1:
        return 0.3 if overlap is None else overlap, 1.4 if twist is None else twist
    wanted = {"overlap": (overlap, height / 2, "height/2"), "twist": (twist, 2 * np.pi / n, "2 pi/n")}
    for name, (given, needed, rule) in wanted.items():
        if given is not None and abs(given - needed) > 1e-9 * needed:
            raise StructureError(
                f"{name} = {given:g}: the joints of a class 2 shell close on the cylinder only for {name} = {rule} = "
                f"{needed:.6g}; leave it out, or set class = 1."
            )
    return height / 2, 2 * np.pi / n


def _elements(n: int, m: int) -> list[tuple[int, int]]:
    return [(i, j) for j in range(1, m + 1) for i in range(1, n + 1)]


def _cylinder(n: int, m: int, radius: float, height: float, overlap: float, twist: float) -> np.ndarray:
    i, j = np.array(_elements(n, m)).T
    theta, base = 2 * np.pi * (i - 1) / n, (j - 1) * (2 * height - 2 * overlap)
    angle = theta[:, None] + [0.0, twist, twist + np.pi / n, np.pi / n]
    z = base[:, None] + [0.0, height, height - overlap, 2 * height - overlap]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).reshape(-1, 3)


def _tendons(n: int, m: int, primal: bool) -> tuple[tuple[str, ...], np.ndarray]:
    labels, ends = [], []
    for i, j in _elements(n, m):
        for alpha, head, tail in element_tendons(j == 1, j == m, primal=primal):
            labels.append(f"t{alpha}_{i}_{j}")
            ends.append([node_index(end.number, i + end.di, j + end.dj, n) for end in (tail, head)])
    return tuple(labels), np.array(ends)
