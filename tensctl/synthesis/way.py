"""What the ways between planned shapes lack of the limits that the shapes themselves keep.

    lack = max over the way of   tension_min - T,   T - tension_max,   lower - u,   u - upper,   clearance - d

Tensions and rest lengths are those of the moving path, with the rods' inertia; distances those of its nodes, the
splines that feedback follows. Where a limit is near, also those of the equilibrium half-way, through which the path's
rest lengths lead when it is infinitely slow; between shapes the two differ by what the splines are off balance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from tensctl.elements import rod_gaps
from tensctl.statics import settle
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.rod_room import pair_named
from tensctl.synthesis.shape_limits import ShapeLimits
from tensctl.threads import one_blas_thread

# Places of a way at which rods are looked at, both ends among them: between two a dip is deeper by 1/200 of itself.
_PLACES = 13
# And times at which tensions and inputs are, besides: peaks of inertia are narrow, and where a leg ends it goes on
# after the last of the places. 13 missed 3e-5 of the tension at a peak 10 ms wide; with 49 it is a sixteenth of that.
_TIMES = 49
# Limits, over their sizes, that are passed by less are kept.
_NONE = 5e-7
# A way that comes as near to a limit, over its size, is looked at in equilibrium too: splines are off by 1e-4.
_NEAR = 1e-3
# What shapes are asked to keep more for what a way between them lacks: a corner that is moved gives half of it back.
# With 1.1 the circle of the examples takes eleven plans, with 2 three.
_MORE = 2.0
# And this part of a size more, lest the last hundredth of a lack takes as many plans as the rest.
_MARGIN = 3e-5


@dataclass(frozen=True, eq=False)
class Lack:
    """What is lacking between a shape and the next.

    Attributes
    ----------
    limits : tuple of ShapeLimits
        What was asked of each way.
    shapes : tuple of ShapeLimits
        What the path lacks as it moves through each planned shape: what inertia passes a limit by.
    ways : tuple of ShapeLimits
        What each way lacks at the worst, its ends included; <= 0 where it keeps a limit.
    sizes : tuple of float
        What a lack of each kind is small or large against.
    path : ShapePath
    moving : bool
        Whether inertia counts.
    """

    limits: tuple[ShapeLimits, ...]
    shapes: tuple[ShapeLimits, ...]
    ways: tuple[ShapeLimits, ...]
    sizes: tuple[float, ...]
    path: ShapePath
    moving: bool

    def __bool__(self) -> bool:
        """Whether any way lacks anything."""
        return self.worst > _NONE

    @cached_property
    def worst(self) -> float:
        """Largest lack over its size."""
        return max(self._worst_of(way) for way in self.ways)

    @property
    def leg(self) -> int:
        """The leg on which most is lacking."""
        ways = np.cumsum([leg.steps for leg in self.path.legs])
        return int(np.searchsorted(ways, np.argmax([self._worst_of(way) for way in self.ways]), side="right"))

    def asked_more(self, limits: tuple[ShapeLimits, ...]) -> tuple[ShapeLimits, ...]:
        """Limits of all shapes, tighter by what they and the ways beside lack; the first is as it is.

        So is the last, the shape that is wanted, while the path counts as slow; where it moves and a limit acts in the
        end, only room there leaves any for inertia just before.
        """
        own = [self._counted(shape) for shape in self.shapes]
        between = [
            [np.maximum(lack - np.maximum(a, b), 0.0) for lack, a, b in zip(self._counted(way), *ends, strict=True)]
            for way, ends in zip(self.ways, pairwise(own), strict=True)
        ]
        tight = list(limits)
        for k in range(1, len(limits) if self.moving else len(limits) - 1):
            beside = [np.max(lacks, axis=0) for lacks in zip(*between[k - 1 : k + 1], strict=True)]
            more = [
                lack + _MORE * extra + _MARGIN * size * (lack + extra > 0)
                for lack, extra, size in zip(own[k], beside, self.sizes, strict=True)
            ]
            if any(part.any() for part in more):
                tight[k] = limits[k].tightened(self._from_where_it_is(k, limits[k], more))
        return tuple(tight)

    def _from_where_it_is(self, k: int, limits: ShapeLimits, more: list[np.ndarray]) -> ShapeLimits:
        """What is asked more of a shape on top of its limits: on top of what it has, where that is more."""
        now = self.path.equilibria[k]
        has = _passed(limits, now.tensions[None], now.inputs[None], _distances(self.path, [now.nodes], limits))
        return ShapeLimits(
            *(np.where(ask > 0, ask + np.maximum(-part, 0.0), 0.0) for ask, part in zip(more, has.parts, strict=True))
        )

    def said(self) -> str:
        """What is worst, when, and what the limit is."""
        k = int(np.argmax([self._worst_of(way) for way in self.ways]))
        relative = self._relative(self.ways[k])
        kind = int(np.argmax([lack.max(initial=-np.inf) for lack in relative]))
        at = int(relative[kind].argmax())
        start, end = self.path.time[k : k + 2]
        return f"between {start:.2f} and {end:.2f} s {self._named(k, kind, at)}"

    def _named(self, k: int, kind: int, at: int) -> str:
        structure, members = self.path.target.structure, self.path.target.potential.members
        lack, limit = self.ways[k].parts[kind][at], self.limits[k].parts[kind][at]
        reached = limit + lack if kind in (1, 3) else limit - lack
        if kind < 2:
            said = ("falls", "below tension_min") if kind == 0 else ("rises", "above its force_max")
            return f"{structure.tendon_labels[at]} {said[0]} to {reached:.4g} N, {said[1]} = {limit:g} N"
        if kind < 4:
            return f"the input of {members.gearing.labels[at]} comes to {reached:.4g} m, beyond its {limit:.4g} m"
        pair = pair_named(self.path.target, at)
        return f"rods {pair} come to {reached:.4g} m, nearer than target.clearance = {limit:g} m"

    def _relative(self, way: ShapeLimits) -> list[np.ndarray]:
        return [lack / size for lack, size in zip(way.parts, self.sizes, strict=True)]

    def _worst_of(self, way: ShapeLimits) -> float:
        return max(float(lack.max(initial=-np.inf)) for lack in self._relative(way))

    def _counted(self, lack: ShapeLimits) -> list[np.ndarray]:
        """What is lacking, and zero for what is kept or nearly so."""
        return [np.where(part > _NONE * size, part, 0.0) for part, size in zip(lack.parts, self.sizes, strict=True)]


@one_blas_thread()
def lacking(path: ShapePath, limits: tuple[ShapeLimits, ...], *, moving: bool) -> Lack:
    """What every way of a path lacks of its shapes' limits; a floor that the start has not counts from the next on.

    Parameters
    ----------
    path : ShapePath
    limits : tuple of ShapeLimits
        Of every shape; a way between two has the lower of their floors.
    moving : bool
        Whether the path is as fast as planned, or counts as infinitely slow, without inertia.
    """
    first = path.equilibria[0]
    strongest, longest = max(path.tensions.max(initial=0.0), 1e-300), float(first.structure.rod_lengths.mean())
    sizes = (strongest, strongest, longest, longest, longest)
    begins = np.where(first.tensions < limits[1].tension_min, -np.inf, limits[0].tension_min)
    floors = [begins, *(np.minimum(a.tension_min, b.tension_min) for a, b in pairwise(limits[1:]))]
    held = tuple(ShapeLimits(floor, *of.parts[1:]) for floor, of in zip(floors, limits[1:], strict=True))
    ways = tuple(_on_the_way(path, k, asked, sizes, moving=moving) for k, asked in enumerate(held))
    met = limits[0].clearance[None]  # planned shapes have their rods apart
    shapes = zip(limits, *_loads(path, path.time, moving=moving), strict=True)
    passed = tuple(_passed(asked, T[None], u[None], met) for asked, T, u in shapes)
    return Lack(held, passed, ways, sizes, path, moving)


def _loads(path: ShapePath, times: np.ndarray, *, moving: bool) -> tuple[np.ndarray, np.ndarray]:
    """Tensions and inputs."""
    if moving:
        return path.tensions_at(times), path.inputs_at(times)
    return path.balanced_tensions_at(times), path.balanced_inputs_at(times)


def _on_the_way(path: ShapePath, k: int, limits: ShapeLimits, sizes: tuple[float, ...], *, moving: bool) -> ShapeLimits:
    """What is lacking from planned shape k to the next."""
    places = path.time_of(np.linspace(k, k + 1, _PLACES))
    times = np.concatenate([places, np.linspace(path.time[k], path.time[k + 1], _TIMES)])
    clear = _distances(path, [path.nodes_at(t) for t in places], limits)
    lack = _passed(limits, *_loads(path, times, moving=moving), clear)
    if all((part <= -_NEAR * size).all() for part, size in zip(lack.parts, sizes, strict=True)):
        return lack
    middle = places[_PLACES // 2 : _PLACES // 2 + 1]
    tensions, inputs = _loads(path, middle, moving=moving)
    at_rest = settle(path.target.potential, start=path.nodes_at(middle[0]), inputs=path.balanced_inputs_at(middle[0]))
    tensions = at_rest.tensions + tensions - path.balanced_tensions_at(middle)
    slow = _passed(limits, tensions, inputs, _distances(path, [at_rest.nodes], limits))
    return ShapeLimits(*map(np.maximum, lack.parts, slow.parts))


def _passed(limits: ShapeLimits, tensions: np.ndarray, inputs: np.ndarray, clear: np.ndarray) -> ShapeLimits:
    """How far limits are passed at the worst of some moments."""
    return ShapeLimits(
        limits.tension_min - tensions.min(axis=0),
        tensions.max(axis=0) - limits.tension_max,
        limits.lower - inputs.min(axis=0),
        inputs.max(axis=0) - limits.upper,
        limits.clearance - clear.min(axis=0),
    )


def _distances(path: ShapePath, moments: list[np.ndarray], limits: ShapeLimits) -> Float[np.ndarray, "moments pairs"]:
    """Of all pairs of rods, where a distance is asked."""
    if not limits.clearance.size:
        return np.zeros((len(moments), 0))
    structure, members = path.target.structure, path.target.potential.members
    return np.stack([rod_gaps(structure.rods, members.radius, nodes).distance for nodes in moments])
