"""Legs of a path: what is wanted between two shapes, and when.

straight   h(r) = h0 + r (h1 - h0)
circle     h(r) = c + R(2 pi turns r) (h0 - c),   of two features; the others stay

What was named once is held until it is named anew. Along a leg r goes from 0 to 1 with the minimum-jerk profile
r = 10 s^3 - 15 s^4 + 6 s^5, s = (t - start)/duration, so each begins and ends at rest and the whole has continuous
accelerations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.scene import TargetStage, Waypoint
from tensctl.structure import Structure
from tensctl.synthesis.target import Feature, features_of, levers

# Planned equilibria along a straight leg, after the first. With 8, the spline between two of them is within 7e-5 N of
# balance on the (3,1) mast that grows by a fifth.
_STEPS = 8
# Planned equilibria a round.
_STEPS_A_ROUND = 24


@dataclass(frozen=True, eq=False)
class Leg:
    """What is wanted from one shape to the next.

    Attributes
    ----------
    key : str
        Where the scene asks for it: "target" or "target.waypoint[1]".
    features : tuple of Feature
    ends : (k,)
        Values of the features in the end.
    start, duration : float, s
    steps : int
        Planned equilibria after the first.
    round_about : (2,) int and (2,), optional
        Which two features go round which centre.
    turns : float
    """

    key: str
    features: tuple[Feature, ...]
    ends: Float[np.ndarray, " k"]
    start: float
    duration: float
    steps: int
    round_about: tuple[np.ndarray, np.ndarray] | None = None
    turns: float = 0.0

    def values(self, begins: Float[np.ndarray, " k"], share: float) -> Float[np.ndarray, " k"]:
        """Wanted values after a share of the way that begins with the given ones."""
        wanted = begins + share * (self.ends - begins)
        if self.round_about is not None:
            pair, centre = self.round_about
            angle = 2 * np.pi * self.turns * share
            cosine, sine = np.cos(angle), np.sin(angle)
            wanted[pair] = centre + np.array([[cosine, -sine], [sine, cosine]]) @ (begins[pair] - centre)
        return wanted

    def begins(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, " k"]:
        """Values of the features at the given nodes."""
        return np.array([feature.of(nodes) for feature in self.features])

    @property
    def levers(self) -> Float[np.ndarray, " k"]:
        """Metres per unit of each feature."""
        return levers(self.features)

    def share(self, t: float | np.ndarray) -> np.ndarray:
        """How much of the leg is done at time t, 0 to 1."""
        return profile(np.minimum(np.maximum((np.asarray(t, float) - self.start) / self.duration, 0.0), 1.0))

    def rates(self, t: float) -> Float[np.ndarray, " 2"]:
        """First and second rate of the share at time t, 1/s and 1/s^2."""
        s = float(np.clip((t - self.start) / self.duration, 0.0, 1.0))
        return np.array([30 * (s * (1 - s)) ** 2 / self.duration, 60 * s * (1 - s) * (1 - 2 * s) / self.duration**2])

    def moments(self, count: int) -> Float[np.ndarray, " count"]:
        """So many times of the leg, both ends among them, the closer the nearer to an end, s.

        Where a leg begins or ends inertia makes speeds jump, and the mean over an interval beside it is off by half the
        interval's acceleration: of 1001 times the first two are 2.5e-6 of the leg apart.
        """
        return self.start + self.duration * (1 - np.cos(np.pi * np.linspace(0, 1, count))) / 2

    @property
    def samples(self) -> int:
        """Steps in time between samples of inertia, whose acceleration has two lobes."""
        return 4 * self.steps

    def said(self, begins: Float[np.ndarray, " k"]) -> str:
        """In words, "height 1.3548 m to 1.6258 m"; what is held is not said again."""
        ways = []
        for feature, begin, end in zip(self.features, begins, self.ends, strict=True):
            name, unit = feature.name.split(", ")
            if abs(end - begin) * feature.lever > 1e-9:  # rounding shows no minus zero
                ways.append(f"{name} {round(begin, 4) + 0.0:.4f} {unit} to {round(end, 4) + 0.0:.4f} {unit}")
        if self.round_about is not None:
            kind = self.features[self.round_about[0][0]].name.split()[0]
            often = "once" if abs(self.turns) == 1 else f"{abs(self.turns):g} times"
            ways.append(f"{kind} {often} round, {'counter-' * (self.turns > 0)}clockwise")
        return "; ".join(ways) or "stays"


def profile(s: np.ndarray) -> np.ndarray:
    """Minimum jerk from 0 to 1."""
    return s**3 * (10 - 15 * s + 6 * s**2)


def legs_of(wanted: TargetStage, structure: Structure, nodes: np.ndarray) -> Iterator[Leg]:
    """Legs of a target, for a path that begins at the given nodes.

    Raises
    ------
    SynthesisError
        A feature that this structure does not have, or a circle with nothing to go round.
    """
    named: dict[str, tuple[Feature, float]] = {}
    start = wanted.start
    for k, shape in enumerate(wanted.waypoint or (wanted,)):
        key = f"target.waypoint[{k}]" if wanted.waypoint else "target"
        named |= {feature.name: (feature, end) for feature, end in features_of(shape, structure, nodes)}
        features, ends = tuple(feature for feature, _ in named.values()), np.array([end for _, end in named.values()])
        leg = Leg(key, features, ends, start, shape.duration or wanted.duration, _STEPS)
        if isinstance(shape, Waypoint) and shape.circle is not None:
            leg = _rounds(leg, shape.circle, shape.turns, nodes)
            named |= {f.name: (f, float(end)) for f, end in zip(leg.features, leg.ends, strict=True)}
        start += leg.duration
        yield leg


def _rounds(leg: Leg, kind: str, turns: float, nodes: np.ndarray) -> Leg:
    """The leg that takes a pair of features round their values at rest, a tilt round the upright."""
    pair = np.array([k for k, feature in enumerate(leg.features) if feature.name.startswith(f"{kind} ")], int)
    centre = np.zeros(2)
    if kind == "tip" and pair.size:
        centre = np.array([leg.features[k].of(nodes) for k in pair])
    if not pair.size or not np.abs(leg.ends[pair] - centre).max() > 0:
        raise SynthesisError(
            f"{leg.key} goes round a circle of no size; expected a waypoint before it that names a {kind}."
        )
    steps = max(_STEPS, int(np.ceil(_STEPS_A_ROUND * abs(turns))))
    whole = Leg(leg.key, leg.features, leg.ends, leg.start, leg.duration, steps, (pair, centre), turns)
    ends = whole.values(leg.ends, 1.0)
    return Leg(leg.key, leg.features, ends, leg.start, leg.duration, steps, (pair, centre), turns)
