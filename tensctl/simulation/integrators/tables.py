"""Symmetric compositions of kicks b and flights a for H = T + V, from S. Blanes and P. C. Moan.

    order 2    kick 1/2, flight 1, kick 1/2 (Stormer, Verlet)
    order 4    SRKN6b, 6 flights
    order 6    SRKN11b, 11 flights          (J. Comput. Appl. Math. 142, 2002, tables 3 and 4)

Runge-Kutta-Nystrom tables: they use that T is quadratic in the velocities, so that [V,[V,[V,T]]] = 0. This holds on the
rods' manifold too, where T is half the squared length of the velocity in a metric that depends on position alone.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

Order = Literal[2, 4, 6]


class Table(NamedTuple):
    """Kicks (s + 1,) and flights (s,) in parts of a step; the last kick shares its force with the next step's first."""

    kicks: np.ndarray
    drifts: np.ndarray


def _symmetric(kicks: list[float], drifts: list[float], stages: int) -> Table:
    """The whole table from its first half, less the middle coefficients, which make the sums one."""
    kicks, drifts = list(kicks), list(drifts)
    if stages % 2:  # an odd number of flights: one stands alone in the middle
        kicks.append(0.5 - sum(kicks))
        return Table(np.array(kicks + kicks[::-1]), np.array([*drifts, 1 - 2 * sum(drifts), *drifts[::-1]]))
    drifts.append(0.5 - sum(drifts))
    return Table(np.array([*kicks, 1 - 2 * sum(kicks), *kicks[::-1]]), np.array(drifts + drifts[::-1]))


TABLES: dict[Order, Table] = {
    2: _symmetric([], [], 1),
    4: _symmetric(
        [0.0829844064174052, 0.396309801498368, -0.0390563049223486], [0.245298957184271, 0.604872665711080], 6
    ),
    6: _symmetric(
        [0.0414649985182624, 0.198128671918067, -0.0400061921041533, 0.0752539843015807, -0.0115113874206879],
        [0.123229775946271, 0.290553797799558, -0.127049212625417, -0.246331761062075, 0.357208872795928],
        11,
    ),
}
