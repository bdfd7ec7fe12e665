"""From a wanted shape, or several one after the other, to a path of equilibria at an allowed pace."""

from __future__ import annotations

from collections.abc import Mapping

from tensctl.errors import SynthesisError
from tensctl.scene import Scene, TargetStage
from tensctl.scene.given import argument, check_kind
from tensctl.scene.tables import per_member
from tensctl.scene.values import Number
from tensctl.statics import Equilibrium, find_equilibrium
from tensctl.synthesis.all_along import plan_all_along
from tensctl.synthesis.input_limits import check_floor, input_range
from tensctl.synthesis.legs import legs_of
from tensctl.synthesis.pace import refuse_stronger
from tensctl.synthesis.path import ShapePath
from tensctl.synthesis.reference import Hold, refuse_beyond
from tensctl.synthesis.rod_room import crowded
from tensctl.synthesis.shape_limits import Asked
from tensctl.synthesis.target import wanted_target
from tensctl.synthesis.tension_room import stalled
from tensctl.synthesis.weights import Size


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
        stall limits `force_max` and the most power of a motor, `power_max`.
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
        A floor below 0, a shape out of reach, a start beyond a stall limit or u_max or with rods too near, or a
        duration too short for the rate or power limit.
    """
    check_kind(Scene, scene=scene)
    start = find_equilibrium(scene) if start is None else start
    check_kind(Equilibrium, start=start)
    if not start.stable:
        raise SynthesisError(f"a path starts from a stable equilibrium, and this one is: {start.stable}.")
    if beyond := stalled(start):
        raise SynthesisError(f"the path's start has {beyond}; raise that limit, or begin with longer rest lengths.")
    wanted = wanted_target(scene, target)
    if wanted.clearance is not None and (near := crowded(start, wanted.clearance)):
        raise SynthesisError(f"the path's start has {near}; ask for less, or begin with another shape.")
    if tension_min is None:
        tension_min = 0.0 if scene.mpc is None else scene.mpc.tension_min
    check_floor(tension_min)
    if scene.mpc is not None:
        rate_max = scene.mpc.rate_max if rate_max is None else rate_max
        u_max = scene.mpc.u_max if u_max is None else u_max
    if rate_max is not None:
        rate_max = argument("rate_max", rate_max, Number("m/s", above=0))
    if u_max is not None:
        u_max = argument("u_max", u_max, per_member(Number("m", above=0)))
    members = start.potential.members
    refuse_beyond(Hold(start), members.gearing.labels, input_range(start.structure, members, u_max))
    legs = tuple(legs_of(wanted, start.structure, start.nodes))
    path = plan_all_along(legs, start, Asked(tension_min, wanted.clearance, u_max), rate_max)
    if scene.actuators.power_max is not None:
        refuse_stronger(path, scene.actuators.power_max)
    return path
