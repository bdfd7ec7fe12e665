"""The rod: rigid, uniform, slender, without spin about its axis ([S] Theorem 3.1).

A free rod moves with q1 = p1 + p2 and q2 = p2 - p1; end forces f1, f2 give, with no mass matrix to invert,

    q1'' = (2/m) (f1 + f2)
    q2'' = (6/m) (I - q2 q2'/|q2|^2) (f2 - f1) - (|q2'|^2/|q2|^2) q2

A rod with one end on the ground turns about it with inertia m L^2/3; only the force f on the free end acts:

    q2'' = (3/m) (I - q2 q2'/|q2|^2) s f - (|q2'|^2/|q2|^2) q2,    s = +1 for a free head, -1 for a free tail

The skew square uses the actual |q2|^2: with the nominal L^2 a length error grows without bound.
"""

from __future__ import annotations

from enum import IntEnum
from functools import cache

import casadi as ca


class Hold(IntEnum):
    """How the ground holds a rod."""

    FREE = 0
    TAIL = 1
    HEAD = 2
    FIXED = 3


def _turning(q2: ca.SX, v2: ca.SX, force: ca.SX, over_mass: ca.SX) -> ca.SX:
    square = ca.dot(q2, q2)
    across = force - q2 * (ca.dot(q2, force) / square)
    return over_mass * across - (ca.dot(v2, v2) / square) * q2


@cache
def rod_acceleration(hold: Hold) -> ca.Function:
    """Acceleration of one rod.

    Returns
    -------
    casadi.Function
        Free: (q1, q2, v2 (3) m, m/s; f1, f2 (3) N; m kg) -> (a1, a2 (3) m/s^2).
        One end held: (q2, v2, f, m) -> a2, with f the force on the free end.
    """
    q2, v2, m = ca.SX.sym("q2", 3), ca.SX.sym("v2", 3), ca.SX.sym("m")
    if hold is Hold.FREE:
        f1, f2 = ca.SX.sym("f1", 3), ca.SX.sym("f2", 3)
        outputs = [2 / m * (f1 + f2), _turning(q2, v2, f2 - f1, 6 / m)]
        return ca.Function("rod_free", [q2, v2, f1, f2, m], outputs, ["q2", "v2", "f1", "f2", "m"], ["a1", "a2"])
    if hold is Hold.FIXED:
        raise ValueError("a rod with both ends on the ground does not move and has no acceleration.")
    f = ca.SX.sym("f", 3)
    sign = 1 if hold is Hold.TAIL else -1
    return ca.Function(
        f"rod_held_{hold.name.lower()}",
        [q2, v2, f, m],
        [_turning(q2, v2, sign * f, 3 / m)],
        ["q2", "v2", "f", "m"],
        ["a2"],
    )


@cache
def rod_energy(hold: Hold) -> ca.Function:
    """Kinetic energy of one rod, J: m |q1'|^2/8 + m |q2'|^2/24 when free, m |q2'|^2/6 about a held end."""
    v2, m = ca.SX.sym("v2", 3), ca.SX.sym("m")
    if hold is not Hold.FREE:
        return ca.Function("rod_energy_held", [v2, m], [m / 6 * ca.dot(v2, v2)], ["v2", "m"], ["E"])
    v1 = ca.SX.sym("v1", 3)
    energy = m / 8 * ca.dot(v1, v1) + m / 24 * ca.dot(v2, v2)
    return ca.Function("rod_energy_free", [v1, v2, m], [energy], ["v1", "v2", "m"], ["E"])
