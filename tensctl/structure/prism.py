"""The n-strut prism: the simplest tensegrity, n rods between two regular polygons ([W] Examples 10 and 25)."""

from __future__ import annotations

import numpy as np

from tensctl.errors import StructureError
from tensctl.structure.pins import Pins, holds
from tensctl.structure.structure import Structure


def prism(
    n: int,
    *,
    radius: float = 1.0,
    height: float = 1.0,
    twist: float | None = None,
    pins: Pins = (),
) -> Structure:
    """Build an n-strut prism with 2n nodes, n rods and 3n tendons.

    Rod i runs from base node `a<i>` to top node `b<i>`, turned by `twist`; tendons are the base polygon
    `base<i>`, the top polygon `top<i>` and the verticals `side<i>` from base node i+1 to top node i.

    Parameters
    ----------
    n : int
        Rods, n >= 3.
    radius, height : float, m
    twist : float, rad, optional
        Default pi/2 + pi/n, the angle at which the prism holds prestress.
    pins : iterable of str, or table pattern -> directions
        Labels or patterns of nodes held by the ground; `{"a*": "z"}` holds one direction only.

    Raises
    ------
    StructureError
        For n < 3 or a dimension that is not positive.
    """
    if n < 3:
        raise StructureError(f"n = {n}: a prism has n >= 3 rods.")
    if not (radius > 0 and height > 0):
        raise StructureError(f"radius = {radius}, height = {height}: a prism needs both > 0 m.")
    twist = np.pi / 2 + np.pi / n if twist is None else twist
    base = 2 * np.pi * np.arange(n) / n
    node_labels = tuple(f"{ring}{i + 1}" for ring in "ab" for i in range(n))
    i, following = np.arange(n), (np.arange(n) + 1) % n
    pinned, guides = holds(node_labels, pins)
    structure = Structure(
        nodes=np.vstack([_ring(base, radius, 0.0), _ring(base + twist, radius, height)]),
        rods=np.column_stack([i, n + i]),
        tendons=np.vstack(
            [
                np.column_stack([i, following]),
                np.column_stack([n + i, n + following]),
                np.column_stack([following, n + i]),
            ]
        ),
        node_labels=node_labels,
        rod_labels=tuple(f"rod{k + 1}" for k in range(n)),
        tendon_labels=tuple(f"{kind}{k + 1}" for kind in ("base", "top", "side") for k in range(n)),
        pinned=pinned,
        guides=guides,
    )
    structure.verify()
    return structure


def _ring(angle: np.ndarray, radius: float, z: float) -> np.ndarray:
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(angle.size, z)])
