"""How near members come to each other along a run, and which of them pass through each other.

Distance of two straight members x(s) = a + s u and y(t) = b + t v, s and t from 0 to 1: min |x - y|, less the rods'
radii. Thin members pass through each other when (u x v) . (b - a) changes sign while their lines meet inside both.
Members that share a node are no pair.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

if TYPE_CHECKING:
    from tensctl.simulation.segments import Found

# Room for pairs or passings found; when it is too small the kernel says how much is needed and runs once more.
_ROOM = 1024
# Differences of distances over the largest coordinate that are rounding.
_ROUNDING = 1e-14


@dataclass(frozen=True)
class Segments:
    """Straight members of one kind.

    Attributes
    ----------
    ends : (k, 2) int
        Nodes.
    radius : (k,) m
    near : (k,) m
        Two members whose distance is at most the larger of theirs count as close.
    """

    ends: Int[np.ndarray, "members 2"]
    radius: Float[np.ndarray, " members"]
    near: Float[np.ndarray, " members"]


@dataclass(frozen=True)
class Encounter:
    """Two members, by index, while they are close: when that begins, how near they come and when (s, m, s)."""

    first: int
    second: int
    begins: float
    distance: float
    time: float


@dataclass(frozen=True)
class Passing:
    """Two members, by index, that pass through each other, and when, s."""

    first: int
    second: int
    time: float


@dataclass(frozen=True, eq=False)
class Clearance:
    """Distances between members of two kinds along a run.

    Attributes
    ----------
    time : (t,) s
    distance : (t,) m
        Least at each time, between surfaces; infinite without a pair.
    pairs : (t, 2) int
        The two members that have it; -1 without a pair.
    encounters : tuple of Encounter
        Pairs that come close, in the order in which that begins.
    passings : tuple of Passing
        In the order of time.
    """

    time: Float[np.ndarray, " t"]
    distance: Float[np.ndarray, " t"]
    pairs: Int[np.ndarray, "t 2"]
    encounters: tuple[Encounter, ...]
    passings: tuple[Passing, ...]

    @property
    def least(self) -> float:
        """Least distance of all recorded times, m."""
        return float(self.distance.min())

    @property
    def least_at(self) -> int:
        """Index of the recorded time at which it occurs."""
        return int(self.distance.argmin())


def clearance(
    time: Float[np.ndarray, " t"],
    nodes: Float[np.ndarray, "t nodes 3"],
    velocities: Float[np.ndarray, "t nodes 3"],
    first: Segments,
    second: Segments | None = None,
) -> Clearance:
    """Distances among members of one kind, or between two kinds.

    Distances are those at recorded times. Between them motion is taken as the cubic that has the recorded positions
    and velocities, and a pair is seen to pass once in each quarter of an interval at most.
    """
    other = first if second is None else second
    places, rates = np.ascontiguousarray(nodes, float), np.ascontiguousarray(velocities, float)
    distance, pair, found = _watched(time, places, rates, first, other, same=second is None)
    rounding = _ROUNDING * float(np.abs(places).max(initial=0.0))
    return Clearance(time, distance, pair, _encounters(time, found, rounding), _passings(found))


def _watched(
    time: np.ndarray, nodes: np.ndarray, velocities: np.ndarray, first: Segments, second: Segments, *, same: bool
) -> tuple[np.ndarray, np.ndarray, Found]:
    """Least distance and its pair at each time, and everything that is close or passes."""
    from tensctl.simulation.segments import Found, Pairs, watch

    pairs = Pairs(first.ends, first.radius, first.near, second.ends, second.radius, second.near, same)
    count = len(time)
    distance, pair = np.empty(count), np.empty((count, 2), np.int64)
    close = passed = _ROOM
    while True:
        found = Found(
            when=np.empty(close, np.int64),
            close=np.empty((close, 2), np.int64),
            gap=np.empty(close),
            passed=np.empty((passed, 2), np.int64),
            moment=np.empty(passed),
        )
        met, went = watch(time, nodes, velocities, pairs, distance, pair, found)
        if met <= close and went <= passed:
            kept = Found(found.when[:met], found.close[:met], found.gap[:met], found.passed[:went], found.moment[:went])
            return distance, pair, kept
        close, passed = max(met, close), max(went, passed)


def _encounters(time: np.ndarray, found: Found, rounding: float) -> tuple[Encounter, ...]:
    """One entry a pair; what is found comes in the order of time, and what differs by rounding alone is no nearer."""
    best: dict[tuple[int, int], tuple[int, int]] = {}
    for k, (i, j) in enumerate(found.close.tolist()):
        begins, nearest = best.get((i, j), (k, k))
        best[i, j] = begins, k if found.gap[k] < found.gap[nearest] - rounding else nearest
    return tuple(
        Encounter(i, j, float(time[found.when[k]]), float(found.gap[n]), float(time[found.when[n]]))
        for (i, j), (k, n) in best.items()
    )


def _passings(found: Found) -> tuple[Passing, ...]:
    order = np.argsort(found.moment, kind="stable")
    return tuple(Passing(int(found.passed[k, 0]), int(found.passed[k, 1]), float(found.moment[k])) for k in order)
