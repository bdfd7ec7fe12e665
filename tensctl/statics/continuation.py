"""Equilibria followed while loads and rest lengths change, round folds and through slack-taut changes.

Steps of pseudo-arclength along the curve g(xi, lambda) = 0 (see `curve`); one that does not close is halved. At each
point the signs of pivots count the negative eigenvalues of H. When their number changes and t_lambda changes sign, the
curve has folded: stability is lost or won and no rest is near beyond. When it changes alone, other rests cross or begin
there (or, at a slack-taut change, stiffness jumped). Two folds within one step pass unseen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float, Int

from tensctl.elements import Potential
from tensctl.statics.curve import Curve, Place, advanced, landed, placed
from tensctl.statics.equilibrium import Equilibrium, newton_of, settle
from tensctl.statics.newton import Newton
from tensctl.statics.stability import whole_definiteness

if TYPE_CHECKING:
    from tensctl.scene import Scene

# Up to so many Newton steps back to the curve the next step is longer, though never ten times the first one.
_EASY = 5
_LONGEST = 10.0
_SHORTEST = 1e-7
# Bisections of the arclength that find a fold, where lambda is flat: 26 halvings leave rounding of lambda.
_BISECTIONS = 26


@dataclass(frozen=True)
class PathEvent:
    """Something that happens between two points of a path.

    Attributes
    ----------
    kind : "fold", "branch point", "slack" or "taut"
    at : float
        lambda there: to rounding at a fold; otherwise of the first point after it.
    index : int
        The first point after it.
    members : tuple of str
        Tendons that went slack or taut.
    """

    kind: Literal["fold", "branch point", "slack", "taut"]
    at: float
    index: int
    members: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class EquilibriumPath:
    """Rests along a curve.

    Attributes
    ----------
    parameter : (points,)
        lambda of each.
    equilibria : tuple of Equilibrium
    negative : (points,) int
        Negative eigenvalues of each Hessian.
    events : tuple of PathEvent
    finished : bool
        Whether the wanted lambda was reached.
    """

    parameter: Float[np.ndarray, " points"]
    equilibria: tuple[Equilibrium, ...]
    negative: Int[np.ndarray, " points"]
    events: tuple[PathEvent, ...]
    finished: bool

    @property
    def folds(self) -> tuple[PathEvent, ...]:
        """Where the curve turns back."""
        return tuple(event for event in self.events if event.kind == "fold")


def follow(
    scene: Scene | Potential,
    *,
    loads: Float[np.ndarray, "nodes 3"] | None = None,
    inputs: Float[np.ndarray, " inputs"] | None = None,
    start: Equilibrium | None = None,
    to: float = 1.0,
    step: float = 0.1,
    max_points: int = 200,
) -> EquilibriumPath:
    """Follow the rest of a scene from lambda = 0 until lambda = `to`, round folds if there are any.

    Parameters
    ----------
    scene : Scene or Potential
    loads : (N, 3) array, N, optional
        Loads that grow with lambda, on top of the scene's. When neither loads nor inputs are given, the scene's own
        loads and weight grow from nothing.
    inputs : (nu,) array, m, optional
        Rest-length change u of the acting tendons at lambda = 1.
    start : Equilibrium, optional
        Where to begin; found from the structure's own nodes by default.
    to : float
        Where to end. A path that folds back and comes as far on the other side of 0 ends there, not finished.
    step : float
        First arclength: lambda, and displacement over the mean rod length (root mean square), count alike.
    max_points : int
        Points after which to give up.

    Returns
    -------
    EquilibriumPath
        Unstable rests are followed too; `events` says where folds are and which tendons went slack or taut.

    Raises
    ------
    EquilibriumError
        When there is no rest at lambda = 0.
    """
    potential = scene if isinstance(scene, Potential) else Potential.of(scene)
    newton = Newton() if isinstance(scene, Potential) else newton_of(scene)
    curve = _curve(potential, loads, inputs, newton.tol)
    points, events = [_first(curve, start, newton, np.sign(to))], []
    length, sense, finished = step, np.sign(to), False
    while len(points) < max_points and not finished and sense * points[-1].parameter > -abs(to):
        ahead = _next(curve, points[-1], length, _SHORTEST * step)
        if ahead is None:
            break
        new, corrections, taken = ahead
        end = _reached(curve, points[-1], new, taken, to)
        new, finished = end or new, end is not None
        events += _events(curve, points[-1], new, taken, len(points))
        points.append(new)
        length = min(taken * (1.5 if corrections <= _EASY else 0.7), _LONGEST * step)
    return _path(points, events, finished=finished)


def _curve(potential: Potential, loads, inputs, tol: float) -> Curve:
    members = potential.members
    shortening = np.zeros(len(members.rest_lengths))
    if inputs is not None:
        shortening[members.inputs] = members.gearing.spread(inputs)
    if loads is None and inputs is None:
        return Curve(potential, np.zeros_like(members.forces), members.forces, shortening, tol)
    extra = np.zeros_like(members.forces) if loads is None else np.asarray(loads, float)
    return Curve(potential, members.forces, extra, shortening, tol)


def _first(curve: Curve, start: Equilibrium | None, newton: Newton, sense: float) -> Place:
    """The rest at lambda = 0; met by plain Newton from a given one, so an unstable start is kept."""
    nodes = None if start is None else start.nodes
    rest = settle(curve.potential_at(0.0), start=nodes, newton=newton)
    return placed(curve, curve.at(rest.nodes, 0.0), 0.0, np.zeros_like(rest.nodes), sense)


def _next(curve: Curve, place: Place, length: float, shortest: float) -> tuple[Place, int, float] | None:
    """The next point, the Newton steps back to the curve, and the arclength, halved as often as it takes."""
    while length >= shortest:
        moved = advanced(curve, place, length)
        if moved is not None:
            return *moved, length
        length *= 0.5
    return None


def _reached(curve: Curve, old: Place, new: Place, length: float, to: float) -> Place | None:
    """The rest at the wanted lambda, if it is passed between two points, even on the way to a fold between them."""
    sense, furthest = np.sign(to), new
    if old.change * new.change < 0:
        furthest = _bisected(curve, old, length, lambda place: place.change * old.change > 0) or old
    if sense * (furthest.parameter - to) < 0:
        return None

    def short_of_it(place: Place) -> bool:
        return sense * (place.parameter - to) < 0 and place.change * old.change > 0

    return landed(curve, _bisected(curve, old, length, short_of_it) or old, to)


def _bisected(curve: Curve, old: Place, length: float, before: Callable[[Place], bool]) -> Place | None:
    """The last place within an arclength at which something is still so."""
    low, high, last = 0.0, length, None
    for _ in range(_BISECTIONS):
        middle = advanced(curve, old, 0.5 * (low + high))
        if middle is not None and before(middle[0]):
            low, last = 0.5 * (low + high), middle[0]
        else:
            high = 0.5 * (low + high)
    return last


def _events(curve: Curve, old: Place, new: Place, length: float, index: int) -> list[PathEvent]:
    labels = curve.potential.structure.tendon_labels
    before, after = old.point.terms.tensions > 0, new.point.terms.tensions > 0
    events: list[PathEvent] = []
    changes: tuple[tuple[Literal["slack", "taut"], np.ndarray], ...]
    changes = (("slack", before & ~after), ("taut", after & ~before))
    for kind, changed in changes:
        if changed.any():
            members = tuple(labels[t] for t in np.flatnonzero(changed))
            events.append(PathEvent(kind, new.parameter, index, members))
    if old.change * new.change < 0:
        turn = _bisected(curve, old, length, lambda place: place.change * old.change > 0)
        events.append(PathEvent("fold", (turn or old).parameter, index))
    elif _negative(old) != _negative(new):
        events.append(PathEvent("branch point", new.parameter, index))
    return events


def _negative(place: Place) -> int:
    return whole_definiteness(place.point).negative


def _path(points: list[Place], events: list[PathEvent], *, finished: bool) -> EquilibriumPath:
    rests = [Equilibrium(p.point.potential, p.point.nodes, p.point.rest_lengths, 0) for p in points]
    return EquilibriumPath(
        parameter=np.array([place.parameter for place in points]),
        equilibria=tuple(rests),
        negative=np.array([rest.definiteness.negative for rest in rests]),
        events=tuple(events),
        finished=finished,
    )
