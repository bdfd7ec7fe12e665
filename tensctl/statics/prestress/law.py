"""The tendon law solved for tension and for rest length, at a given length.

    T = k (l - L)  <->  L = l - T/k,      T = EA (l/L - 1)  <->  L = EA l/(EA + T)

T from L loses digits where the stretch is small: its error is 1e-16 k l, whatever T is.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.structure import Members


def tension_of(
    members: Members, length: Float[np.ndarray, " tendons"], rest: Float[np.ndarray, " tendons"]
) -> Float[np.ndarray, " tendons"]:
    """Tension by the tendon law, N, negative where the tendon would be slack."""
    k = members.stiffness
    return k * (length - rest) if members.law == "k" else k * (length / rest - 1.0)


def rest_length_of(
    members: Members, length: Float[np.ndarray, " tendons"], tensions: Float[np.ndarray, " tendons"]
) -> Float[np.ndarray, " tendons"]:
    """Rest length at which a tendon of the given length carries the given tension, m."""
    k = members.stiffness
    return length - tensions / k if members.law == "k" else k * length / (k + tensions)


def ceiling_of(members: Members) -> tuple[Float[np.ndarray, " tendons"], Float[np.ndarray, " tendons"]]:
    """Tension at which the rest length reaches its floor, as slope * length - shift."""
    slope = members.stiffness if members.law == "k" else members.stiffness / members.floors
    return slope, slope * members.floors
