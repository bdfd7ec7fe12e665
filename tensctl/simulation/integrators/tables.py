"""Symmetric compositions of kicks b and flights a for H = T + V.

              short steps              long steps
    order 2   1 flight (Verlet)        1 flight
    order 4   6 flights (SRKN6b)       10 flights
    order 6   11 flights (SRKN11b)     14 flights

Those for short steps are by S. Blanes and P. C. Moan (J. Comput. Appl. Math. 142, 2002, tables 3 and 4). Those for long
steps were made for this package: what the order's conditions leave free is spent on oscillations, whose cosine and sine
they follow up to omega h = 4.2 within 4e-5 and 1.2e-6, on the terms of the next order, which are 26 and 5 times smaller
than in the tables beside them, and on stability up to omega h = 6.2, without a gap at pi.

Runge-Kutta-Nystrom tables: they use that T is quadratic in the velocities, so that [V,[V,[V,T]]] = 0. This holds on the
rods' manifold too, where T is half the squared length of the velocity in a metric that depends on position alone.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

Order = Literal[2, 4, 6]


class Table(NamedTuple):
    """Kicks and flights in parts of a step; the last kick shares its force with the next step's first.

    Attributes
    ----------
    kicks : (s + 1,)
    drifts : (s,)
    widest : float
        Longest time between neighbouring kicks, in their order of time.
    """

    kicks: np.ndarray
    drifts: np.ndarray
    widest: float


def _symmetric(kicks: list[float], drifts: list[float], stages: int) -> Table:
    """The whole table from its first half, less the middle coefficients, which make the sums one."""
    if stages % 2:  # an odd number of flights: one stands alone in the middle
        kicks = [*kicks, 0.5 - sum(kicks)]
        kicks, drifts = kicks + kicks[::-1], [*drifts, 1 - 2 * sum(drifts), *drifts[::-1]]
    else:
        drifts = [*drifts, 0.5 - sum(drifts)]
        kicks, drifts = [*kicks, 1 - 2 * sum(kicks), *kicks[::-1]], drifts + drifts[::-1]
    times = np.sort(np.cumsum([0.0, *drifts]))
    return Table(np.array(kicks), np.array(drifts), float(np.diff(times).max()))


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

LONG: dict[Order, Table] = {
    2: TABLES[2],
    4: _symmetric(
        [0.0363035273313216, 0.13732367888067074, 0.22691558407311183, -0.09553703757786021, 0.12683309943008433],
        [0.10150698793124692, 0.1284748109799246, -0.028264976823512818, 0.15130113316784982],
        10,
    ),
    6: _symmetric(
        [
            0.02705497050484025,
            0.09033946542948922,
            0.2062155207570143,
            -0.1146584479940199,
            0.14808010360618581,
            0.13783282792010695,
            -0.024773424793735566,
        ],
        [
            0.07520378192856879,
            0.06987603139538899,
            -0.009742621184417965,
            0.14078044593170858,
            0.15093693066563282,
            0.1800416440241869,
        ],
        14,
    ),
}
