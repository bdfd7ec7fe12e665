"""How far tensions are within their limits, as lengths: linear in nodes and rest lengths for slack tendons too.

    room    l - L - T_min/k >= 0,   -(l - L - T_max/k) >= 0          (law EA: T L/EA for T/k)

Every tendon between moving nodes has a floor; those with a stall limit, `actuators.force_max`, have a second row.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from tensctl.statics import Equilibrium, stretch_map

# Part of a stall limit by which a tension may pass it and still count as at it.
_ROUNDING = 1e-6


def room(now: Equilibrium, least: Float[np.ndarray, " nt"], most: Float[np.ndarray, " nt"]) -> Float[np.ndarray, " r"]:
    """Room of each limit, m: floors first, then stall limits; both in N by tendon."""
    low, high = _beyond(now, least), _beyond(now, most)
    return np.concatenate([low[~now.structure.grounded_tendons], -high[limited(now)]])


def room_slope(
    now: Equilibrium, reach: Float[np.ndarray, "size nu"], least: Float[np.ndarray, " nt"],
    most: Float[np.ndarray, " nt"],
) -> Float[np.ndarray, "r nu"]:  # fmt: skip
    """Growth of the room per unit of rest-length shortening, where nodes move by `reach` of it."""
    stretch, kept, stalls = stretch_map(now) @ reach, ~now.structure.grounded_tendons, limited(now)
    return np.vstack([_slope(now, stretch, least)[kept], -_slope(now, stretch, most)[stalls]])


def limited(now: Equilibrium) -> Bool[np.ndarray, " tendons"]:
    """Which tendons have a stall limit."""
    return np.isfinite(now.potential.members.force_max)


def stalled(now: Equilibrium) -> str | None:
    """The tendon farthest beyond its stall limit, in words; None when every actuator can hold its own."""
    over = now.tensions / now.potential.members.force_max
    worst = int(over.argmax()) if over.size else 0
    if not over.size or over[worst] <= 1 + _ROUNDING:
        return None
    limit = now.potential.members.force_max[worst]
    return f"{now.tensions[worst]:.4g} N in {now.structure.tendon_labels[worst]}, above its force_max = {limit:g} N"


def _beyond(now: Equilibrium, tensions: np.ndarray) -> np.ndarray:
    members = now.potential.members
    extra = tensions / members.stiffness * (1.0 if members.law == "k" else now.rest_lengths)
    return now.lengths - now.rest_lengths - extra


def _slope(now: Equilibrium, stretch: np.ndarray, tensions: np.ndarray) -> np.ndarray:
    members, slope = now.potential.members, stretch.copy()
    share = np.ones_like(tensions) if members.law == "k" else 1 + tensions / members.stiffness
    inputs, gearing = members.inputs, members.gearing
    slope[inputs, gearing.motor] += gearing.ratio * share[inputs]
    return slope
