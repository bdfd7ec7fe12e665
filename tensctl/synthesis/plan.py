"""From a wanted shape, or several one after the other, to a path of equilibria at an allowed pace."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.statics import Equilibrium, find_equilibrium
from tensctl.synthesis.input_limits import input_range
from tensctl.synthesis.legs import Leg, legs_of
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.reference import Hold, refuse_beyond
from tensctl.synthesis.rod_room import crowded
from tensctl.synthesis.shape import ShapeProblem
from tensctl.synthesis.target import wanted_target
from tensctl.synthesis.tension_room import stalled
from tensctl.synthesis.weights import Size

if TYPE_CHECKING:
    from tensctl.scene import Scene, TargetStage


def plan_shape(
    scene: Scene,
    target: float | Mapping[str, object] | TargetStage | None = None,
    *,
    start: Equilibrium | None = None,
    tension_min: float | None = None,
    rate_max: float | None = None,
    u_max: Size | None = None,
) -> ShapePath:
    """Plan the equilibria that lead to a new shape, or through several, with the least change of rest lengths.

    Parameters
    ----------
    scene : Scene
        `[target]` gives `height_scale`, `twist`, `tip`, `tilt` or `nodes`, or several, with `start` and `duration`, or
        waypoints, and the `clearance` of rods; `[mpc]` gives `tension_min`, `rate_max` and `u_max`, `[actuators]` the
        stall limits `force_max`.
    target : float, or table with the keys of `[target]`, optional
        Height over the equilibrium's height; the scene's own target by default.
    start : Equilibrium, optional
        Where the path begins; the scene's equilibrium by default.
    tension_min : float, N, optional
    rate_max : float, m/s, optional
    u_max : number or table by tendon label, m, optional
        Largest change of a rest length from L0, either way.

    Raises
    ------
    SynthesisError
        A shape out of reach, a start beyond a stall limit or u_max or with rods too near, or a duration too short for
        the rate limit.
    """
    start = find_equilibrium(scene) if start is None else start
    if not start.stable:
        raise SynthesisError(f"a path starts from a stable equilibrium, and this one is: {start.stable}.")
    if beyond := stalled(start):
        raise SynthesisError(f"the path's start has {beyond}; raise that limit, or begin with longer rest lengths.")
    wanted = wanted_target(scene, target)
    if wanted.clearance is not None and (near := crowded(start, wanted.clearance)):
        raise SynthesisError(f"the path's start has {near}; ask for less, or begin with another shape.")
    if tension_min is None:
        tension_min = 0.0 if scene.mpc is None else scene.mpc.tension_min
    if scene.mpc is not None:
        rate_max = scene.mpc.rate_max if rate_max is None else rate_max
        u_max = scene.mpc.u_max if u_max is None else u_max
    members = start.potential.members
    refuse_beyond(Hold(start), members.gearing.labels, input_range(start.structure, members, u_max))
    legs, equilibria, ways = tuple(legs_of(wanted, start.structure, start.nodes)), [start], []
    for leg in legs:
        ways.append(leg.said(leg.begins(equilibria[-1].nodes)))
        equilibria += _along(leg, ShapeProblem(leg.features, tension_min, wanted.clearance, u_max), equilibria[-1])
    path = ShapePath(tuple(equilibria), legs, f"{', then '.join(ways)}; least rest-length change")
    if rate_max is not None:
        _check_pace(path, rate_max)
    return path


def _along(leg: Leg, problem: ShapeProblem, start: Equilibrium) -> list[Equilibrium]:
    """Planned equilibria of a leg; where there is none, how far the way leads and what is at its limit there."""
    begins, found = leg.begins(start.nodes), [start]
    for share in np.linspace(0, 1, leg.steps + 1)[1:]:
        try:
            found.append(problem.solve(found[-1], leg.values(begins, share)))
        except SynthesisError as error:
            done, where = (len(found) - 1) / leg.steps, "" if leg.key == "target" else f"{leg.key}: "
            raise SynthesisError(
                f"{where}{error} The way leads {100 * done:.0f} % there, where {problem.at_limit(found[-1])}."
            ) from None
    return found[1:]


def _check_pace(path: ShapePath, rate_max: float) -> None:
    for leg in path.legs:
        fastest = path.fastest_of(leg)
        if fastest > rate_max:
            raise SynthesisError(
                f"{leg.key}.duration = {leg.duration:g} s makes a rest length change at {fastest:.3g} m/s, above "
                f"rate_max = {rate_max:g} m/s; allow {leg.duration * fastest / rate_max:.3g} s or more."
            )
