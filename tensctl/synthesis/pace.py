"""Whether a path has enough time: speeds of rest lengths against their limit, tensions in motion against their floor.

T = T_rest + dT / f^2,   du/dt = v / f + dv / f^3,   P = T du/dt   for a leg that takes f times as long

A controller keeps the speeds of motors within what their power allows; a path that is faster would leave it behind.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.structure import Members
from tensctl.synthesis.input_limits import powered_rates
from tensctl.synthesis.legs import Leg
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.reference import Reference
from tensctl.synthesis.target import Feature, Linear

# Moments of a leg that are looked at, and the largest factor on its duration that is worth telling.
_MOMENTS = 201
_LONGEST = 1e3
# Times that are told are a little longer, lest three digits are too few.
ABOVE = 1.005
# Moments between which power is the mean, and how near the time that would do is found.
_FINE, _CLOSE = 2001, 1.0005
# Speeds beyond their limit by this part are at it, to rounding.
_ROUNDED = 1e-9
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
            needed = f"{ABOVE * leg.duration * fastest / rate_max:.3g}"
            raise SynthesisError(
                f"{leg.key}.duration = {leg.duration:g} s makes a rest length change at {fastest:.3g} m/s, above "
                f"rate_max = {rate_max:g} m/s; allow {needed} s or more"
                f"{_tighten_first(path, leg, tension_min, f' and duration = {needed}')}."
            )


def refuse_stronger(path: ShapePath, power_max: float) -> None:
    """Refuse a path on which a motor gives or takes more than so much power, W.

    Raises
    ------
    SynthesisError
        With the first leg that asks for it, the motor, and the time that would do.
    """
    for leg in path.legs:
        t, powers = _powers(path, leg)
        asked = powers(1.0)
        if asked.max(initial=0.0) <= power_max:
            continue
        at, motor = np.unravel_index(asked.argmax(), asked.shape)
        needed = ABOVE * leg.duration * _longer(lambda f, of=powers: of(f).max() > power_max)
        label = path.target.potential.members.gearing.labels[motor]
        raise SynthesisError(
            f"{leg.key}.duration = {leg.duration:g} s asks {asked.max():.3g} W of actuator {label} at {t[at]:.2f} s, "
            f"above actuators.power_max = {power_max:g} W; allow {needed:.3g} s or more."
        )


def refuse_outrun(reference: Reference, members: Members) -> None:
    """Refuse a planned path on which a motor would have to be faster than its power lets it be.

    Parameters
    ----------
    reference : Reference
        Only a ShapePath says how fast it means to be.
    members : Members

    Raises
    ------
    SynthesisError
        With the first leg that is, the actuator, both speeds, and the time that would do.
    """
    limits = powered_rates(members)
    if not isinstance(reference, ShapePath) or not np.isfinite(limits).any():
        return
    for leg in reference.legs:
        speeds = _speeds(reference, leg)
        asked = speeds(1.0).max(axis=0)
        worst = int((asked / limits).argmax())
        if asked[worst] <= limits[worst] * (1 + _ROUNDED):
            continue
        needed = ABOVE * leg.duration * _longer(lambda f, of=speeds: bool((of(f) > limits).any()))
        raise SynthesisError(
            f"{leg.key}.duration = {leg.duration:g} s asks {asked[worst]:.3g} m/s of actuator "
            f"{members.gearing.labels[worst]}, whose limit is {limits[worst]:.3g} m/s (actuators.power_max = "
            f"{members.power_max:g} W over its {members.stall[worst]:.3g} N with every tendon at force_max), so the "
            f"controller would stay behind; allow {needed:.3g} s or more, or raise that limit."
        )


def _longer(beyond: Callable[[float], bool]) -> float:
    """The least factor on a leg's duration at which nothing is beyond its limit any more."""
    low, high = 1.0, 2.0
    while beyond(high):
        low, high = high, 2 * high
    while high > low * _CLOSE:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return high


def _powers(
    path: ShapePath, leg: Leg
) -> tuple[Float[np.ndarray, " t"], Callable[[float], Float[np.ndarray, "t motors"]]]:
    """Moments of a leg, and the power of every motor between them, W, when it takes so many times as long."""
    t = leg.moments(_FINE)
    members = path.target.potential.members
    rest = path.balanced_tensions_at(t)
    parts = [(T[1:] + T[:-1]) / 2 for T in (rest, path.tensions_at(t) - rest)]
    force, added = (part[:, members.inputs] @ members.gearing.matrix for part in parts)
    speeds = _speeds(path, leg)
    return t, lambda f: np.abs(force + added / f**2) * speeds(f)


def _speeds(path: ShapePath, leg: Leg) -> Callable[[float], Float[np.ndarray, "t motors"]]:
    """Speeds of every motor between moments of a leg, m/s, when it takes so many times as long."""
    t = leg.moments(_FINE)
    still = path.balanced_inputs_at(t)
    speed, quicker = (np.diff(u, axis=0) / np.diff(t)[:, None] for u in (still, path.inputs_at(t) - still))
    return lambda f: np.abs(speed / f + quicker / f**3)


def _tighten_first(path: ShapePath, leg: Leg, tension_min: float, taking: str = "") -> str:
    """What to try besides where a leg is quick because it begins with less tension than its floor, in words."""
    start = path.equilibria[0]
    below = np.where(start.structure.grounded_tendons, np.inf, start.tensions)
    if leg is not path.legs[0] or below.min(initial=np.inf) >= tension_min:
        return ""
    label = start.structure.tendon_labels[int(below.argmin())]
    return (
        f"; or tighten first, since the start has {below.min():.3g} N in {label}, below tension_min = {tension_min:g} "
        f"N: put a waypoint with {_as_it_is(leg.features[0], start.nodes)}{taking} before the others"
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


def too_quick(path: ShapePath, tension_min: float, allow: str | None = None) -> str | None:
    """The first leg whose motion takes a tension below its floor, and what time would do; None where none does.

    The time is `allow`, or else that with which inertia would take what room there is.
    """
    labels = np.array(path.target.structure.tendon_labels)[~path.target.structure.grounded_tendons]
    for leg in path.legs:
        t, moving, tight, factor = _taken(path, leg, tension_min)
        if factor > 1 + 1e-6:
            at, tendon = np.unravel_index(np.where(tight, moving, np.inf).argmin(), moving.shape)
            allow = allow or f"{leg.duration * factor:.3g} s or more"
            remedy = f"allow {allow}" if factor < _LONGEST else "raise the prestress"
            return (
                f"{leg.key}.duration = {leg.duration:g} s is quick for this prestress: inertia would take "
                f"{labels[tendon]} to {_told_below(moving[at, tendon], tension_min)} N at {t[at]:.2f} s, below "
                f"{tension_min:g} N; {remedy}{_tighten_first(path, leg, tension_min)}."
            )
    return None


def room_factor(path: ShapePath, leg: Leg, tension_min: float) -> float:
    """How many times as long a leg has to take for inertia to leave tensions above their floor; 1 or less: it does."""
    return _taken(path, leg, tension_min)[-1]


def _taken(path: ShapePath, leg: Leg, tension_min: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Moments of a leg, tensions in motion, which of them have room at rest, and the factor that the time lacks."""
    kept = ~path.target.structure.grounded_tendons
    t = leg.start + leg.duration * np.linspace(0, 1, _MOMENTS)
    rest, moving = path.balanced_tensions_at(t)[:, kept], path.tensions_at(t)[:, kept]
    room, taken = rest - tension_min, rest - moving
    tight = room > _NONE * rest.max(initial=1e-300)  # a floor that rest itself does not keep says nothing of pace
    return t, moving, tight, float(np.sqrt(np.max(taken[tight] / room[tight], initial=0.0)))


def _told_below(value: float, floor: float) -> str:
    """A number with three digits, or as many as tell it from the floor that it is below."""
    return next((said for digits in range(3, 9) if float(said := f"{value:.{digits}g}") < floor), f"{value:g}")
