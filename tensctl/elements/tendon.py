"""The tendon: an elastic cable that pulls or does nothing.

With d = p_head - p_tail, l = |d| and rest length L, for constant stiffness k ([S] 5.1-5.3) or constant EA:

    energy   V = k (l - L)^2 / 2      or   EA (l - L)^2 / (2 L),   0 while l <= L
    tension  T = max(0, k (l - L) + c dl/dt)   or with EA (l / L - 1),   0 while l <= L
    force on the tail +T d/l, on the head -T d/l

This is the only statement of the tendon's physics; statics, models and linearisations are made from it.
"""

from __future__ import annotations

from functools import cache

import casadi as ca

from tensctl.structure import Law


def _symbols() -> tuple[ca.SX, ca.SX, ca.SX]:
    return ca.SX.sym("d", 3), ca.SX.sym("L"), ca.SX.sym("k")


def _length(d: ca.SX) -> ca.SX:
    """|d|, with finite derivatives where both ends meet (such a tendon is slack)."""
    square = ca.dot(d, d)
    return ca.sqrt(ca.if_else(square > 0, square, 1.0)) * ca.if_else(square > 0, 1.0, 0.0)


def _elastic_tension(length: ca.SX, L: ca.SX, k: ca.SX, law: Law) -> ca.SX:
    return k * (length - L) if law == "k" else k * (length / L - 1)


@cache
def tendon_energy(law: Law) -> ca.Function:
    """Elastic energy V(d, L, k), J."""
    d, L, k = _symbols()
    length = _length(d)
    density = k / 2 if law == "k" else k / (2 * L)
    energy = ca.if_else(length > L, density * (length - L) ** 2, 0.0)
    return ca.Function(f"tendon_energy_{law}", [d, L, k], [energy], ["d", "L", "k"], ["V"])


@cache
def tendon_statics(law: Law) -> ca.Function:
    """Everything that statics and linearisation ask of a tendon, derived from its energy.

    Returns
    -------
    casadi.Function
        (d (3) m, L m, k) -> (V J, T N, g = dV/dd (3) N, K = d2V/dd2 (3, 3) N/m, G = -d2V/dd dL (3) N/m).
        The force on the tail is +g, on the head -g; G du is the growth of g when the rest length shrinks by du.
    """
    d, L, k = _symbols()
    energy = tendon_energy(law)(d, L, k)
    stiffness, pull = ca.hessian(energy, d)
    length = _length(d)
    tension = ca.if_else(length > L, _elastic_tension(length, L, k, law), 0.0)
    shortening = -ca.jacobian(pull, L)
    return ca.Function(
        f"tendon_statics_{law}",
        [d, L, k],
        [energy, tension, pull, stiffness, shortening],
        ["d", "L", "k"],
        ["V", "T", "g", "K", "G"],
    )


@cache
def tendon_tension(law: Law, *, damped: bool, clamped: bool = True) -> ca.Function:
    """Tension T(d, v, L, k, c), N, of a tendon whose ends separate at velocity v.

    Without `damped` the inputs v and c are left out; without `clamped` a taut damper may push, as some codes have it.
    """
    d, L, k = _symbols()
    length = _length(d)
    tension = _elastic_tension(length, L, k, law)
    if not damped:
        T = ca.if_else(length > L, tension, 0.0)
        return ca.Function(f"tendon_tension_{law}", [d, L, k], [T], ["d", "L", "k"], ["T"])
    v, c = ca.SX.sym("v", 3), ca.SX.sym("c")
    tension = tension + c * ca.dot(d, v) / length
    T = ca.if_else(length > L, ca.fmax(0.0, tension) if clamped else tension, 0.0)
    return ca.Function(f"tendon_tension_{law}_damped", [d, v, L, k, c], [T], ["d", "v", "L", "k", "c"], ["T"])
