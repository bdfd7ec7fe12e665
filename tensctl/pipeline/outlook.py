"""What can be said of a scene's controllers before they are designed: how they are made, why, and what is left out."""

from __future__ import annotations

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.pipeline.way import unasked, way_of_lqg, way_of_lqr
from tensctl.scene import LqgStage, LqrStage, MpcStage, Scene
from tensctl.synthesis.condensed import stiffness_spread
from tensctl.synthesis.input_limits import powered_rates
from tensctl.synthesis.qp_solvers import first_choice, order_of
from tensctl.synthesis.sampling_limit import below_sampling_limit, refuse_short


def lqr_told(scene: Scene, linear: LinearModel) -> str | None:
    """Harmonic by harmonic or dense, and whether it runs; None without `[lqr]`."""
    if scene.lqr is None:
        return None
    if scene.target is None:
        return str(way_of_lqr(scene.lqr, linear)[0]) + _whether_run(scene, "lqr")
    along = ", in the run dense about every second shape of the path" if _controller(scene) == "lqr" else ""
    return _at_target(scene.lqr, linear) + along + _whether_run(scene, "lqr")


def lqg_told(scene: Scene, linear: LinearModel) -> str | None:
    """The same of `[lqg]`."""
    if scene.lqg is None or scene.sensors is None:
        return None
    if scene.target is None:
        return str(way_of_lqg(scene.lqg, scene.sensors, linear)[0]) + _whether_run(scene, "lqg")
    return _at_target(scene.lqg, linear) + _whether_run(scene, "lqg")


def _at_target(asked: LqrStage | LqgStage, linear: LinearModel) -> str:
    way = unasked(asked, linear)
    if way is not None:
        return f"about the target's shape, {way}"
    return (
        "about the target's shape, harmonic by harmonic where that and the weights repeat from sector to sector, else "
        "dense: decided when the target is planned"
    )


def mpc_told(scene: Scene, linear: LinearModel) -> str | None:
    """Size, solvers, limits and what is left out, a line each; None without `[mpc]`."""
    asked = scene.mpc
    if asked is None:
        return None
    seen = "the scene's sensors" if asked.feedback == "outputs" else "the state"
    period = f"{asked.horizon} periods of {asked.dt:g} s, {asked.horizon * len(linear.inputs)} variables"
    kept, left = _limits(scene, linear)
    lines = (
        f"{asked.model} model, {period}, from {seen}{_whether_run(scene, 'mpc')}",
        _solvers(asked, linear, planned=scene.target is not None),
        f"keeps {', '.join(kept)}",
        f"leaves out {', '.join(left)}" if left else "leaves nothing out",
    )
    return "\n     ".join(lines)


def _solvers(asked: MpcStage, linear: LinearModel, *, planned: bool) -> str:
    """Who is asked first and after it, and why; of a target the same rule decides once its shape is planned."""
    if asked.model == "nonlinear":
        return (
            "solver: daqp first, then primal and piqp where floors give way; none to choose, each step is a new problem"
        )
    try:
        model = below_sampling_limit(linear.flexible, asked.dt, asked.modes).actuated
        refuse_short(model.scales, asked.dt)
    except SynthesisError as refusal:
        return f"solver: none, since {refusal}"
    sizes, spread = (asked.horizon, len(model.inputs), len(model.A)), stiffness_spread(model)
    first, why = first_choice(*sizes, spread)
    if asked.solver != "auto":
        first, why = asked.solver, "asked for"
    after = list(dict.fromkeys(name for name, _ in order_of(first, sizes[0] * sizes[1], spread)))[1:]
    when = " at rest, and by the same rule at the target" if planned and asked.solver == "auto" else ""
    return f"solver: {first} first{when}, then {', '.join(after)}; {why}"


def _limits(scene: Scene, linear: LinearModel) -> tuple[list[str], list[str]]:
    """What is kept, and what the scene does not ask for or predictive control cannot keep."""
    asked, members = scene.mpc, linear.dynamics.members
    assert asked is not None
    stalling = int(np.isfinite(members.force_max).sum())
    powered, motors = int(np.isfinite(powered_rates(members)).sum()), members.gearing.size
    parts = [
        (True, f"rest-length floors, rate_max = {asked.rate_max:g} m/s", ""),
        (True, f"tension_min = {asked.tension_min:g} N (gives way where it cannot be kept)", ""),
        (asked.u_max is not None, "u_max", "a largest change of rest lengths (no u_max)"),
        (stalling > 0, f"force_max of {stalling} tendons (gives way likewise)", "stall limits (no force_max)"),
        (asked.delay > 0, f"a delay of {asked.delay:g} s", "computation delay (delay = 0)"),
        (members.lag > 0, f"actuator lag of {members.lag:g} s", "actuator lag"),
        (bool(asked.follow), f"{len(asked.follow)} followed outputs", "followed outputs"),
    ]
    kept = [said for there, said, _ in parts if there]
    left = [said for there, _, said in parts if not there]
    if np.isfinite(members.power_max):
        said = f"power_max = {members.power_max:g} W"
        if powered:
            kept.append(f"{said} of {powered} motors (no faster than power_max over their force at force_max)")
        if powered < motors:
            left.append(f"{said} of {motors - powered} motors, which have no force_max: runs beyond it are warned of")
    return kept, left


def _controller(scene: Scene) -> str:
    return "none" if scene.simulation is None else scene.simulation.controller


def _whether_run(scene: Scene, name: str) -> str:
    """What becomes of a design that no run is under."""
    if scene.simulation is None:
        return "; nothing is simulated"
    runs = scene.simulation.controller
    return "" if runs == name else f'; designed and judged, not run: simulation.controller is "{runs}"'
