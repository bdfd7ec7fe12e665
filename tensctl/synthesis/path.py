"""A shape path: equilibria from one shape to another, over time.

What is wanted of the shape changes with the minimum-jerk profile s = 10 r^3 - 15 r^4 + 6 r^5, r = (t - start)/duration;
between the planned equilibria rest lengths and nodes follow cubic splines, nodes on the rods' manifold.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.statics import Equilibrium, find_equilibrium
from tensctl.synthesis.shape import ShapeProblem
from tensctl.synthesis.target import Feature, features_of, wanted_target
from tensctl.synthesis.tension_room import stalled

if TYPE_CHECKING:
    from tensctl.scene import Scene, TargetStage

# Planned equilibria along the way, the first and last included. With 9, the spline between two of them is within
# 7e-5 N of balance on the (3,1) mast that grows by a fifth.
_KNOTS = 9
# Half the time, s, over which reference velocities are differenced; splines make the error 1e-10 of the speed.
_TICK = 1e-5


@dataclass(frozen=True, eq=False)
class ShapePath:
    """Planned equilibria and when to be there.

    Attributes
    ----------
    equilibria : tuple of Equilibrium
        At equal steps of every feature, first to last.
    start, duration : float, s
    description : str
    features : tuple of Feature
        What was wanted: height, twist, tip, coordinates of nodes.
    """

    equilibria: tuple[Equilibrium, ...]
    start: float
    duration: float
    description: str
    features: tuple[Feature, ...] = ()

    @property
    def time(self) -> Float[np.ndarray, " k"]:
        """Times at which the planned equilibria are reached, s."""
        wanted = np.linspace(0, 1, len(self.equilibria))
        fine = np.linspace(0, 1, 4001)
        return self.start + self.duration * np.interp(wanted, _profile(fine), fine)

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

    def progress(self, t: float | np.ndarray) -> np.ndarray:
        """How much of the way is done at time t, 0 to 1."""
        return _profile(np.clip((np.asarray(t, float) - self.start) / self.duration, 0.0, 1.0))

    def inputs_at(self, t: float | np.ndarray) -> np.ndarray:
        """Reference rest-length change u, (nu,) or (..., nu) m."""
        return self._inputs(self.progress(t))

    def tensions_at(self, t: float | np.ndarray) -> np.ndarray:
        """Reference tensions, (nt,) or (..., nt) N."""
        return self._tensions(self.progress(t))

    def nodes_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """Reference nodes, m, with exact rod lengths."""
        manifold = self.target.potential.manifold
        return manifold.retract(self.equilibria[0].nodes, self._chart(self.progress(t)))

    def velocities_at(self, t: float) -> Float[np.ndarray, "nodes 3"]:
        """Reference node velocities, m/s."""
        return (self.nodes_at(t + _TICK) - self.nodes_at(t - _TICK)) / (2 * _TICK)

    def knot_at(self, t: float) -> int:
        """Index of the planned equilibrium nearest to the reference."""
        return int(np.rint(float(self.progress(t)) * (len(self.equilibria) - 1)))

    @cached_property
    def fastest(self) -> float:
        """Largest speed of a reference rest length, m/s."""
        t = self.start + self.duration * np.linspace(0, 1, 401)
        moved = np.abs(np.diff(self.inputs_at(t), axis=0)) * self.target.potential.members.gearing.largest
        return float(moved.max(initial=0.0) / (t[1] - t[0]))

    @cached_property
    def _inputs(self):
        return _spline(np.stack([e.inputs for e in self.equilibria]))

    @cached_property
    def _tensions(self):
        return _spline(self.tensions)

    @cached_property
    def _chart(self):
        manifold, first = self.target.potential.manifold, self.equilibria[0].nodes
        return _spline(np.stack([manifold.logarithm(first, e.nodes) for e in self.equilibria]))

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


def plan_shape(
    scene: Scene,
    target: float | Mapping[str, object] | TargetStage | None = None,
    *,
    start: Equilibrium | None = None,
    tension_min: float | None = None,
    rate_max: float | None = None,
) -> ShapePath:
    """Plan the equilibria that lead to a new shape, with the least change of rest lengths.

    Parameters
    ----------
    scene : Scene
        `[target]` gives `height_scale`, `twist`, `tip` or `nodes`, or several, with `start` and `duration`; `[mpc]`
        gives `tension_min` and `rate_max`, and `[actuators]` the stall limits `force_max`.
    target : float, or table with the keys of `[target]`, optional
        Height over the equilibrium's height; the scene's own target by default.
    start : Equilibrium, optional
        Where the path begins; the scene's equilibrium by default.
    tension_min : float, N, optional
    rate_max : float, m/s, optional

    Raises
    ------
    SynthesisError
        A shape out of reach, a start beyond a stall limit, or a duration too short for the rate limit.
    """
    start = find_equilibrium(scene) if start is None else start
    if not start.stable:
        raise SynthesisError(f"a path starts from a stable equilibrium, and this one is: {start.stable}.")
    if beyond := stalled(start):
        raise SynthesisError(f"the path's start has {beyond}; raise that limit, or begin with longer rest lengths.")
    wanted = wanted_target(scene, target)
    if tension_min is None:
        tension_min = 0.0 if scene.mpc is None else scene.mpc.tension_min
    if rate_max is None and scene.mpc is not None:
        rate_max = scene.mpc.rate_max
    asked = features_of(wanted, start.structure, start.nodes)
    features, ends = tuple(feature for feature, _ in asked), np.array([end for _, end in asked])
    begins = np.array([feature.of(start.nodes) for feature in features])
    problem, equilibria = ShapeProblem(features, tension_min), [start]
    for share in np.linspace(0, 1, _KNOTS)[1:]:
        equilibria.append(_next(problem, equilibria[-1], begins + share * (ends - begins), share))
    ways = [_way(*way) for way in zip(features, begins, ends, strict=True)]
    text = f"{'; '.join(ways)}; least rest-length change"
    path = ShapePath(tuple(equilibria), wanted.start, wanted.duration, text, features)
    if rate_max is not None and path.fastest > rate_max:
        needed = wanted.duration * path.fastest / rate_max
        raise SynthesisError(
            f"target.duration = {wanted.duration:g} s makes a rest length change at {path.fastest:.3g} m/s, above "
            f"rate_max = {rate_max:g} m/s; allow {needed:.3g} s or more."
        )
    return path


def _way(feature: Feature, begin: float, end: float) -> str:
    """In words, "height 1.3548 m to 1.6258 m"; rounding shows no minus zero."""
    name, unit = feature.name.split(", ")
    return f"{name} {round(begin, 4) + 0.0:.4f} {unit} to {round(end, 4) + 0.0:.4f} {unit}"


def _next(problem: ShapeProblem, now: Equilibrium, values: np.ndarray, share: float) -> Equilibrium:
    """The next planned equilibrium; where there is none, how far the way leads and what is at its limit there."""
    try:
        return problem.solve(now, values)
    except SynthesisError as error:
        done = share - 1 / (_KNOTS - 1)
        raise SynthesisError(
            f"{error} The way leads {100 * done:.0f} % there, where {problem.at_limit(now)}."
        ) from None


def _profile(r: np.ndarray) -> np.ndarray:
    return r**3 * (10 - 15 * r + 6 * r**2)


def _spline(values: np.ndarray):
    from scipy.interpolate import CubicSpline

    return CubicSpline(np.linspace(0, 1, len(values)), values, axis=0)
