"""Whether a path has enough time: speeds of rest lengths against their limit, tensions in motion against their floor.

T(t) = T_rest + dT / f^2   for a leg that takes f times as long
"""

from __future__ import annotations

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.synthesis.legs import Leg
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.target import Feature, Linear

# Moments of a leg that are looked at, and the largest factor on its duration that is worth telling.
_MOMENTS = 201
_LONGEST = 1e3
# Times that are told are a little longer, lest three digits are too few.
_ABOVE = 1.005
# Room below this part of the largest tension is none.
_NONE = 1e-6


def refuse_faster(path: ShapePath, rate_max: float, tension_min: float = 0.0) -> None:
    """Refuse a path on which a rest length is faster than a limit, m/s; a floor, N, may be why.

    Raises
    ------
    SynthesisError
        With the first leg that is, and the time that would do.
    """
    for leg in path.legs:
        fastest = path.fastest_of(leg)
        if fastest > rate_max:
            needed = f"{_ABOVE * leg.duration * fastest / rate_max:.3g}"
            raise SynthesisError(
                f"{leg.key}.duration = {leg.duration:g} s makes a rest length change at {fastest:.3g} m/s, above "
                f"rate_max = {rate_max:g} m/s; allow {needed} s or more"
                f"{_tighten_first(path, leg, tension_min, needed)}."
            )


def _tighten_first(path: ShapePath, leg: Leg, tension_min: float, needed: str) -> str:
    """What to try besides where a leg is fast because it begins with less tension than its floor, in words."""
    start = path.equilibria[0]
    below = np.where(start.structure.grounded_tendons, np.inf, start.tensions)
    if leg is not path.legs[0] or below.min(initial=np.inf) >= tension_min:
        return ""
    label = start.structure.tendon_labels[int(below.argmin())]
    return (
        f"; or tighten first, since the start has {below.min():.3g} N in {label}, below tension_min = {tension_min:g} "
        f"N: put a waypoint with {_as_it_is(leg.features[0], start.nodes)} and duration = {needed} before the others"
    )


def _as_it_is(feature: Feature, nodes: np.ndarray) -> str:
    """What a waypoint would say to keep a feature at its value at rest."""
    kind, *_ = feature.name.split(", ")[0].split(" ")
    known = {
        "height": "height_scale = 1.0",
        "twist": "twist = 0.0",
        "tip": "tip = [0.0, 0.0]",
        "tilt": "tilt = [0.0, 0.0]",
    }
    if kind in known:
        return known[kind]
    assert isinstance(feature, Linear)
    node = int(np.abs(feature.gradient).sum(axis=1).argmax())
    return f"nodes.{kind} = [{', '.join(f'{value:.6g}' for value in nodes[node])}]"


def too_quick(path: ShapePath, tension_min: float) -> str | None:
    """The first leg whose motion takes a tension below its floor, and what time would do; None where none does."""
    kept = ~path.target.structure.grounded_tendons
    labels = np.array(path.target.structure.tendon_labels)[kept]
    for leg in path.legs:
        t = leg.start + leg.duration * np.linspace(0, 1, _MOMENTS)
        rest, moving = path.balanced_tensions_at(t)[:, kept], path.tensions_at(t)[:, kept]
        room, taken = rest - tension_min, rest - moving
        tight = room > _NONE * rest.max(initial=1e-300)  # a floor that rest itself does not keep says nothing of pace
        factor = np.sqrt(np.max(taken[tight] / room[tight], initial=0.0))
        if factor > 1 + 1e-6:
            at, tendon = np.unravel_index(np.where(tight, moving, np.inf).argmin(), moving.shape)
            remedy = f"allow {leg.duration * factor:.3g} s or more" if factor < _LONGEST else "raise the prestress"
            return (
                f"{leg.key}.duration = {leg.duration:g} s is quick for this prestress: inertia would take "
                f"{labels[tendon]} to {moving[at, tendon]:.3g} N at {t[at]:.2f} s, below {tension_min:g} N; {remedy}."
            )
    return None
