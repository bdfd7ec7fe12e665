"""A shape path: equilibria from one shape to another, over time.

What is wanted of the shape changes leg by leg (`synthesis.legs`); between the planned equilibria rest lengths and nodes
follow cubic splines over their number, one a leg, nodes on the rods' manifold. To move, rest lengths and tensions also
carry the rods' inertia (`synthesis.inertia`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.statics import Equilibrium
from tensctl.synthesis.inertia import inertial
from tensctl.synthesis.legs import Leg, profile
from tensctl.synthesis.target import Feature
from tensctl.synthesis.tension_room import stalled

# Half the time, s, over which reference velocities are differenced; splines make the error 1e-10 of the speed.
_TICK = 1e-5


# Frames of a leg when a path is played: 0.03 s each on a leg of 2 s, and rods keep their lengths between two of them.
_FRAMES = 60


@dataclass(frozen=True, eq=False)
class Frames:
    """A path as it is played.

    Attributes
    ----------
    time : (t,) s
    nodes : (t, N, 3) m
    tensions : (t, nt) N
    """

    time: Float[np.ndarray, " t"]
    nodes: Float[np.ndarray, "t nodes 3"]
    tensions: Float[np.ndarray, "t tendons"]


@dataclass(frozen=True, eq=False)
class ShapePath:
    """Planned equilibria and when to be there.

    Attributes
    ----------
    equilibria : tuple of Equilibrium
        At equal steps of each leg, first to last; a leg's last is the next one's first.
    legs : tuple of Leg
        What was wanted, one after the other.
    description : str
    """

    equilibria: tuple[Equilibrium, ...]
    legs: tuple[Leg, ...]
    description: str

    @property
    def start(self) -> float:
        """When the motion begins, s."""
        return self.legs[0].start

    @property
    def duration(self) -> float:
        """Of all legs, s."""
        return sum(leg.duration for leg in self.legs)

    @cached_property
    def ends(self) -> float:
        """When the motion is over for good, s."""
        return self.start + self.duration

    @property
    def features(self) -> tuple[Feature, ...]:
        """What was wanted in the end: height, twist, tip, tilt, coordinates of nodes."""
        return self.legs[-1].features

    @cached_property
    def time(self) -> Float[np.ndarray, " k"]:
        """Times at which the planned equilibria are reached, s."""
        return self.time_of(np.arange(len(self.equilibria)))

    @property
    def nodes(self) -> Float[np.ndarray, "k nodes 3"]:
        """Planned nodes, m."""
        return np.stack([e.nodes for e in self.equilibria])

    @property
    def tensions(self) -> Float[np.ndarray, "k tendons"]:
        """Planned tensions, N."""
        return np.stack([e.tensions for e in self.equilibria])

    @property
    def rest_lengths(self) -> Float[np.ndarray, "k tendons"]:
        """Planned rest lengths, m."""
        return np.stack([e.rest_lengths for e in self.equilibria])

    @property
    def target(self) -> Equilibrium:
        """The last equilibrium."""
        return self.equilibria[-1]

    @property
    def target_nodes(self) -> Float[np.ndarray, "nodes 3"]:
        """The wanted nodes, m."""
        return self.target.nodes

    def place(self, t: float | np.ndarray) -> np.ndarray:
        """Where the reference is at time t, in planned equilibria: 0 at the first, k - 1 at the last."""
        return sum((leg.steps * leg.share(t) for leg in self.legs), np.zeros(np.shape(t)))

    def time_of(self, place: np.ndarray) -> np.ndarray:
        """When the reference is at a place on the path, s: the inverse of `place`."""
        fine, time, first = np.linspace(0, 1, 4001), np.full(np.shape(place), self.start), 0
        for leg in self.legs:
            share = np.clip((place - first) / leg.steps, 0, 1)
            time += leg.duration * np.interp(share, profile(fine), fine)
            first += leg.steps
        return time

    def progress(self, t: float | np.ndarray) -> np.ndarray:
        """How much of the way is done at time t, 0 to 1."""
        return self.place(t) / (len(self.equilibria) - 1)

    def motion(self, t: float) -> tuple[float, float, float]:
        """Place, its speed and its rate of speed at time t, in planned equilibria, 1/s and 1/s^2."""
        speed, change = np.sum([leg.steps * leg.rates(t) for leg in self.legs], axis=0)
        return float(self.place(t)), float(speed), float(change)

    def inputs_at(self, t: float | np.ndarray) -> np.ndarray:
        """Reference rest-length change u, (nu,) or (..., nu) m, inertia included."""
        if self._over(t):
            return _held(self.target.inputs, t)
        return self.balanced_inputs_at(t) + self._moving(self._sample(t))[..., : self.target.inputs.size]

    def balanced_inputs_at(self, t: float | np.ndarray) -> np.ndarray:
        """Rest-length change with which the reference would be at rest, (nu,) or (..., nu) m."""
        return self._inputs(self.place(t))

    def tensions_at(self, t: float | np.ndarray) -> np.ndarray:
        """Reference tensions, (nt,) or (..., nt) N, inertia included; negative where a motion is too fast."""
        if self._over(t):
            return _held(self.target.tensions, t)
        return self.balanced_tensions_at(t) + self._moving(self._sample(t))[..., self.target.inputs.size :]

    def balanced_tensions_at(self, t: float | np.ndarray) -> np.ndarray:
        """Tensions with which the reference would be at rest, (nt,) or (..., nt) N."""
        return self._tensions(self.place(t))

    def nodes_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """Reference nodes, m, with exact rod lengths."""
        return self.target_nodes if self._over(t) else self.nodes_of(self.place(t))

    def nodes_of(self, place: float | np.ndarray) -> Float[np.ndarray, "nodes 3"]:
        """Nodes at a place on the path, m; a little beyond its ends too."""
        return self._placed(self._chart(place))

    def velocities_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """Reference node velocities, m/s."""
        if t <= self.start or self._over(t):
            return np.zeros_like(self.target_nodes)
        return (self.nodes_at(t + _TICK) - self.nodes_at(t - _TICK)) / (2 * _TICK)

    def knot_at(self, t: float) -> int:
        """Index of the planned equilibrium nearest to the reference."""
        return len(self.equilibria) - 1 if self._over(t) else round(float(self.place(t)))

    @cached_property
    def played(self) -> Frames:
        """The reference at equal steps of time on each leg, tensions at rest."""
        legs = [leg.start + leg.duration * np.arange(_FRAMES) / _FRAMES for leg in self.legs]
        time = np.append(np.concatenate(legs), self.ends)
        return Frames(time, np.stack([self.nodes_at(t) for t in time]), self.balanced_tensions_at(time))

    @cached_property
    def fastest(self) -> float:
        """Largest speed of a reference rest length, m/s."""
        return max(self.fastest_of(leg) for leg in self.legs)

    def fastest_of(self, leg: Leg) -> float:
        """Largest speed of a reference rest length on one leg, m/s."""
        t = leg.moments(2001)
        speed = np.abs(np.diff(self.inputs_at(t), axis=0)) / np.diff(t)[:, None]
        return float((speed * self.target.potential.members.gearing.largest).max(initial=0.0))

    def _sample(self, t: float | np.ndarray) -> np.ndarray:
        """Number of the sample of inertia at time t."""
        spent = (leg.samples * np.clip((np.asarray(t, float) - leg.start) / leg.duration, 0, 1) for leg in self.legs)
        return sum(spent, np.zeros(np.shape(t)))

    @cached_property
    def _moving(self):
        """What inertia adds to inputs and tensions, side by side, over the number of the sample."""
        legs = self.legs
        times = [leg.start + leg.duration * np.arange(leg.samples) / leg.samples for leg in legs]
        added = inertial(self, np.append(np.concatenate(times), self.ends))
        return _splines(np.hstack([added.inputs, added.tensions]), [leg.samples for leg in legs])

    @cached_property
    def _inputs(self):
        return self._spline(np.stack([e.inputs for e in self.equilibria]))

    @cached_property
    def _tensions(self):
        return self._spline(self.tensions)

    def _over(self, t: float | np.ndarray) -> bool:
        """Whether the path has come to its end by all of these times."""
        return bool(np.min(t) >= self.ends)

    @cached_property
    def _placed(self):
        return self.target.potential.manifold.retraction(self.equilibria[0].nodes)

    @cached_property
    def _chart(self):
        manifold, first = self.target.potential.manifold, self.equilibria[0].nodes
        return self._spline(np.stack([manifold.untied(first, e.nodes) for e in self.equilibria]))

    def _spline(self, values: np.ndarray):
        return _splines(values, [leg.steps for leg in self.legs])

    def verify(self, tension_min: float = 0.0) -> None:
        """Check that every planned equilibrium balances, holds and keeps its tensions, stall limits among them.

        Raises
        ------
        SynthesisError, EquilibriumError
            With the first that fails.
        """
        for k, equilibrium in enumerate(self.equilibria):
            equilibrium.verify()
            kept = ~equilibrium.structure.grounded_tendons
            lowest = equilibrium.tensions[kept].min(initial=np.inf)
            if beyond := stalled(equilibrium):
                raise SynthesisError(f"planned shape {k} has {beyond}.")
            if not equilibrium.stable or (k > 0 and lowest < tension_min * (1 - 1e-6)):
                raise SynthesisError(
                    f"planned shape {k} is {equilibrium.stable}, its lowest tension {lowest:.3g} N; "
                    f"stable and at least {tension_min:g} N are expected."
                )


def _held(last: np.ndarray, t: float | np.ndarray) -> np.ndarray:
    return np.broadcast_to(last, (*np.shape(t), last.size))


def _splines(values: np.ndarray, steps: list[int]):
    """Cubic splines over the number of the value, one for so many steps each."""
    from scipy.interpolate import CubicSpline, PPoly

    pieces, first = [], 0
    for count in steps:
        numbers = np.arange(first, first + count + 1)
        pieces.append(CubicSpline(numbers, values[numbers], axis=0).c)
        first += count
    return PPoly(np.concatenate(pieces, axis=1), np.arange(first + 1.0))
