"""LQR, LQG and predictive control as a scene asks for them."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SceneError
from tensctl.linear import HarmonicModel, LinearModel
from tensctl.linear.outputs import Mix, Output, safe_label, signal_labels
from tensctl.model import Dynamics
from tensctl.scene import LqgStage, LqrStage, MpcStage, Scene, SensorsStage
from tensctl.statics import Equilibrium
from tensctl.structure import Structure, build_members
from tensctl.structure.labels import by_label, matches
from tensctl.synthesis import (
    LQG,
    LQR,
    MPC,
    Cost,
    Courses,
    NonlinearMPC,
    OutputMPC,
    SampledLQR,
    Sensors,
    ShapePath,
    Weights,
    harmonic_weights,
    lqg,
    lqr,
    sensors,
    weights,
)
from tensctl.synthesis.input_limits import check_asked
from tensctl.synthesis.reference import Reference


def cost_of(asked: LqrStage | LqgStage, linear: LinearModel) -> Cost:
    """Energies by their weights, and what has an allowed size."""
    flexible = linear.flexible
    nx, nu = flexible.B.shape
    Q = asked.energy_weight * np.eye(nx)
    R = np.zeros((nu, nu))
    if asked.rest_lengths is None:
        R = asked.input_weight * np.diag(input_stiffness(flexible))
    if asked.nodes is None and asked.tensions is None and asked.rest_lengths is None:
        return Cost(Q, R, np.zeros((nx, nu)))
    # An infinite size costs nothing: the inputs' weight stands in R already.
    inputs = np.inf if asked.rest_lengths is None else asked.rest_lengths
    sized = weights(flexible, nodes=asked.nodes, tensions=asked.tensions, rest_lengths=inputs)
    return Cost(Q + sized.Q, R + sized.R, sized.N)


def harmonic_cost_of(asked: LqrStage | LqgStage, linear: HarmonicModel) -> tuple[Cost, ...]:
    """The same cost harmonic by harmonic.

    Raises
    ------
    SynthesisError
        When sizes differ from sector to sector.
    """
    inputs = np.inf if asked.rest_lengths is None else asked.rest_lengths
    own = asked.input_weight * input_stiffness(linear) if asked.rest_lengths is None else np.zeros(linear.nu)
    sized = harmonic_weights(linear, nodes=asked.nodes, tensions=asked.tensions, rest_lengths=inputs)
    return tuple(
        Cost(cost.Q + asked.energy_weight * np.eye(block.nx), cost.R + np.diag(own[linear.map.first(block.k)]), cost.N)
        for block, cost in zip(linear.blocks, sized, strict=True)
    )


def design_lqr(asked: LqrStage, linear: LinearModel) -> LQR | SampledLQR:
    """State feedback, sampled where the scene gives a period."""
    only, cost = asked.stabilisable_only, cost_of(asked, linear)
    if asked.dt is None:
        return lqr(linear, cost=cost, stabilisable_only=only)
    return lqr(linear, cost=cost, dt=asked.dt, stabilisable_only=only)


def design_lqg(asked: LqgStage, seen: SensorsStage, linear: LinearModel) -> LQG:
    """Output feedback from the scene's sensors."""
    return lqg(
        linear, eyes(seen, linear), cost=cost_of(asked, linear), force_noise=asked.force_noise, dt=asked.dt,
        order=asked.order, stabilisable_only=asked.stabilisable_only,
    )  # fmt: skip


def eyes(seen: SensorsStage, linear: LinearModel) -> Sensors:
    """The scene's sensors."""
    return sensors(
        linear.dynamics.structure, lengths=seen.lengths, tensions=seen.tensions, nodes=seen.nodes, seed=seen.seed
    )


def design_mpc(asked: MpcStage, linear: LinearModel, path: ShapePath | None) -> MPC:
    """Predictive control of the state."""
    return MPC(linear, path=path, **_common(asked, linear))


def design_output_mpc(asked: MpcStage, seen: SensorsStage, linear: LinearModel, path: ShapePath | None) -> OutputMPC:
    """Predictive control from the scene's sensors, about where the structure starts: there its filter is right."""
    track = asked.track if asked.track else None
    return OutputMPC(
        linear, eyes(seen, linear), track=track, force_noise=asked.force_noise, drift=asked.drift, path=path,
        **_common(asked, linear),
    )  # fmt: skip


def nonlinear_mpc(asked: MpcStage, dynamics: Dynamics, reference: Reference | Equilibrium) -> NonlinearMPC:
    """Predictive control on the nonlinear structure."""
    return NonlinearMPC(
        dynamics, reference, horizon=asked.horizon, dt=asked.dt, tension_min=asked.tension_min, rate_max=asked.rate_max,
        u_max=asked.u_max, weights=mpc_weights(asked, dynamics.structure), delay=asked.delay,
        modes=asked.modes, iterations=asked.iterations,
    )  # fmt: skip


def _common(asked: MpcStage, linear: LinearModel) -> dict[str, Any]:
    """What both take."""
    names = ("horizon", "dt", "tension_min", "rate_max", "u_max", "solver", "delay", "modes", "preview")
    courses = {safe_label(request.output): (request.times, request.change) for request in asked.follow}
    return {name: getattr(asked, name) for name in names} | {
        "weights": mpc_weights(asked, linear.dynamics.structure),
        "signal": Courses(courses) if courses else None,
    }


def check_mpc(scene: Scene, structure: Structure) -> None:
    """Check the labels that `[mpc]` names, its delay and its weights, before anything is computed.

    Raises
    ------
    SceneError, StructureError, SynthesisError
        With the label that names nothing, or what is expected of delay and weights.
    """
    asked = scene.mpc
    if asked is None:
        return
    check_asked(asked.tension_min, asked.delay, asked.dt)
    mpc_weights(asked, structure)
    for name, sizes, labels in (
        ("u_max", asked.u_max, structure.tendon_labels),
        ("rest_lengths", asked.rest_lengths, build_members(scene, structure).gearing.labels),
    ):
        if sizes is not None:
            by_label(labels, sizes, f"mpc.{name}", np.inf)
    for k, request in enumerate(asked.follow):
        if safe_label(request.output) not in signal_labels(structure):
            raise SceneError(
                f'mpc.follow[{k}].output is "{request.output}"; expected the label of an output, like P4_1_1_x, '
                "l_t5_1_1 or T_t5_1_1."
            )
    if asked.feedback == "outputs" and scene.sensors is not None:
        seen = scene.sensors
        labels = sensors(structure, lengths=seen.lengths, tensions=seen.tensions, nodes=seen.nodes).labels
        for pattern in asked.track:
            matches(labels, pattern, "mpc.track")


def mpc_weights(asked: MpcStage, structure: Structure) -> Weights:
    """Energies by their weights, nodes and tensions that have a size, and what follows a course, by its own size."""
    outputs: dict[Output, float] = {}
    followed = {safe_label(request.output) for request in asked.follow}
    if asked.nodes is not None:
        size = by_label(structure.node_labels, asked.nodes, "mpc.nodes", np.inf)
        for k in np.flatnonzero(np.isfinite(size) & structure.free.any(axis=1)):
            label, axes = structure.node_labels[k], np.array(list("xyz"))[structure.free[k]]
            left = [f"{safe_label(label)}_{axis}" for axis in axes if f"{safe_label(label)}_{axis}" not in followed]
            names = [label] if len(left) == len(axes) else left
            outputs |= {f"nodes:{name}": float(size[k]) for name in names}
    if asked.tensions is not None:
        size = by_label(structure.tendon_labels, asked.tensions, "mpc.tensions", np.inf)
        for k in np.flatnonzero(np.isfinite(size) & ~structure.grounded_tendons):
            label = structure.tendon_labels[k]
            if f"T_{safe_label(label)}" not in followed:
                outputs[f"tensions:{label}"] = float(size[k])
    for request in asked.follow:
        outputs[Mix({request.output: {request.output: 1.0}})] = request.size
    return Weights(asked.energy_weight, asked.input_weight, outputs, asked.rest_lengths)
