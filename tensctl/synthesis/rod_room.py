"""How far rods are beyond the distance that they have to keep from each other, and which are nearest.

room    d_ab - clearance >= 0,   rows for pairs that one step could bring together
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from tensctl.elements import RodGaps, rod_gaps
from tensctl.statics import Equilibrium

# Pairs whose room is below this part of the mean rod length have a row: no step moves a node as far.
_SOON = 0.1
# Part of the clearance by which a pair may be nearer and still keeps it.
_ROUNDING = 1e-6


def gaps_of(now: Equilibrium) -> RodGaps:
    """Distances of all pairs of rods, m."""
    return rod_gaps(now.structure.rods, now.potential.members.radius, now.nodes)


def missing(now: Equilibrium, clearance: Float[np.ndarray, " pairs"]) -> float:
    """By how much two rods are too near at the worst, m."""
    return float((clearance - gaps_of(now).distance).max(initial=0.0))


def near_pairs(now: Equilibrium, clearance: Float[np.ndarray, " pairs"]) -> Int[np.ndarray, " r"]:
    """Pairs that one step could bring together; none without a clearance."""
    if not clearance.size:
        return np.zeros(0, int)
    return np.flatnonzero(gaps_of(now).distance < clearance + _SOON * now.structure.rod_lengths.mean())


def rows(
    now: Equilibrium, reach: Float[np.ndarray, "size nu"], pairs: Int[np.ndarray, " r"]
) -> tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r nu"]]:
    """Distances of some pairs, m, and their growth per unit of rest-length shortening."""
    gaps = gaps_of(now)
    return gaps.distance[pairs], gaps.slope(pairs, len(now.nodes)) @ (now.point.tangent @ reach)


def nearest(now: Equilibrium) -> tuple[float, str]:
    """Distance of the nearest two rods, m, and which they are; infinite without a pair."""
    gaps = gaps_of(now)
    if not gaps.distance.size:
        return np.inf, ""
    return gaps.least, pair_named(now, int(gaps.distance.argmin()))


def pair_named(now: Equilibrium, pair: int) -> str:
    """The rods of a pair, in words."""
    return " and ".join(now.structure.rod_labels[rod] for rod in gaps_of(now).pairs[pair])


def crowded(now: Equilibrium, clearance: float) -> str | None:
    """The nearest two rods where they are nearer than the clearance, in words."""
    distance, pair = nearest(now)
    if distance >= clearance * (1 - _ROUNDING):
        return None
    return f"rods {pair} only {distance:.4g} m apart, nearer than target.clearance = {clearance:g} m"


def at_clearance(now: Equilibrium, clearance: Float[np.ndarray, " pairs"]) -> str:
    """Pairs that are as near as they may be, in words; empty when there is none."""
    pairs = np.flatnonzero(gaps_of(now).distance <= clearance * (1 + 1e-4))
    names = [pair_named(now, pair) for pair in pairs[:2].tolist()]
    return f"rods {', '.join(names)}{' ...' * (len(pairs) > 2)} at target.clearance" if names else ""
