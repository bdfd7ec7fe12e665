"""What is said of a run that no real structure could follow, or that is not resolved, in sentences."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from tensctl.simulation.clearance import Clearance, Encounter, Passing

if TYPE_CHECKING:
    from tensctl.simulation.sanity import Sanity

# So many sentences of one kind, the earliest first; the rest are counted. A symmetric structure has many at once.
_TOLD = 4
# A distance below this part of a rod's length is rounding: members that meet.
MET = 1e-12
# More slack tendons than this part leave a net that holds little; below it slack tendons are nothing unusual.
_MOST_SLACK = 0.5
# Errors of steps that add up to more than this part of the longest rod are told; a plot shows ten times as much.
_VISIBLE = 1e-4


def warnings_of(sanity: Sanity) -> tuple[str, ...]:
    """All sentences: rods among each other, rods and tendons, buckling, slack tendons, accuracy."""
    rods, tendons = sanity.structure.rod_labels, sanity.structure.segment_labels
    rounding = MET * float(sanity.structure.rod_lengths.max(initial=0.0))
    found = _of_pairs(sanity.rods, rods, rods, "rods {} and {}", rounding)
    found += _of_pairs(sanity.tendons, rods, tendons, "rod {} and tendon {}", rounding)
    return (*found, *_of_buckling(sanity), *_of_slack(sanity), *_of_errors(sanity))


def nearer_than(sanity: Sanity, clearance: float) -> str | None:
    """By how much rods miss a distance, m, that they were asked to keep, in a sentence; None where they keep it."""
    rods = sanity.rods
    if rods is None or rods.least >= clearance:
        return None
    first, second = (sanity.structure.rod_labels[rod] for rod in rods.pairs[rods.least_at])
    return (
        f"rods {first} and {second} come to {rods.least:.4g} m at {rods.time[rods.least_at]:.4g} s, nearer than "
        f"target.clearance = {clearance:g} m: the path keeps it, and the run leaves the path a little; ask for more."
    )


def _of_pairs(close: Clearance | None, first, second, name: str, rounding: float) -> list[str]:
    if close is None:
        return []
    times = Counter((p.first, p.second) for p in close.passings)
    events: dict[tuple[int, int], Passing | Encounter] = {}
    for event in (*close.encounters, *close.passings):  # a passing says more than that the two came close
        key = (event.first, event.second)
        if not isinstance(event, Passing) or not isinstance(events.get(key), Passing):
            events[key] = event
    ordered = sorted(events.values(), key=_moment)
    told = [
        f"{name.format(first[event.first], second[event.second])} "
        + (_passed(event, times) if isinstance(event, Passing) else _met(event, rounding))
        for event in ordered[:_TOLD]
    ]
    return _and_more(told, len(ordered), "pair", "pairs") if told else []


def _moment(event: Passing | Encounter) -> float:
    return event.time if isinstance(event, Passing) else event.begins


def _passed(event: Passing, times: Counter) -> str:
    often = times[event.first, event.second]
    again = f", the first of {often} times" if often > 1 else ""
    return f"pass through each other at {event.time:.4g} s{again}; real ones would collide there."


def _met(event: Encounter, rounding: float) -> str:
    if event.distance > rounding:
        return f"come within {event.distance:.2g} m of each other at {event.time:.4g} s; give rods.radius to know more."
    if event.distance < -rounding:
        deepest = f"{-event.distance:.2g} m into each other at {event.time:.4g} s"
        return f"touch at {event.begins:.4g} s; {deepest}."
    return f"touch at {event.time:.4g} s."


def _of_buckling(sanity: Sanity) -> list[str]:
    if sanity.buckling is None:
        return []
    over, critical = sanity.buckling.overloads, sanity.buckling.critical
    told = [
        f"rod {sanity.structure.rod_labels[o.rod]} would buckle from {o.begins:.4g} s on: its Euler load is "
        f"{critical[o.rod]:.4g} N, and it carries up to {o.share * critical[o.rod]:.4g} N (at {o.time:.4g} s)."
        for o in over[:_TOLD]
    ]
    return _and_more(told, len(over), "rod", "rods") if told else []


def _of_slack(sanity: Sanity) -> list[str]:
    many = np.flatnonzero(sanity.slack > _MOST_SLACK)
    if not many.size:
        return []
    most, when = sanity.most_slack
    return [
        f"more than {_MOST_SLACK:.0%} of the tendons are slack from {sanity.time[many[0]]:.4g} s on, "
        f"{most:.0%} at {when:.4g} s."
    ]


def _of_errors(sanity: Sanity) -> list[str]:
    if not sanity.local_errors > _VISIBLE * sanity.structure.rod_lengths.max(initial=0.0):
        return []
    return [
        f"errors of single steps add up to {sanity.local_errors:.1e} m, and places at {sanity.time[-1]:.4g} s may be "
        "off by as much; use a smaller tol, and see whether they stay."
    ]


def _and_more(told: list[str], total: int, one: str, many: str) -> list[str]:
    left = total - len(told)
    return told if not left else [*told[:-1], f"{told[-1]} And {left} more {one if left == 1 else many}."]
