"""From results to what the report shows."""

from __future__ import annotations

import numpy as np

from tensctl import __version__
from tensctl.pipeline.certificate import Certificate
from tensctl.pipeline.followed import followed
from tensctl.pipeline.results import Results
from tensctl.report import Case, Check, Height, Limits, MpcCheck, Wanted
from tensctl.report import Push as ShownPush
from tensctl.simulation.parted import parting_told
from tensctl.structure import matches
from tensctl.synthesis import LQG, MPC, HarmonicLQG, NonlinearMPC, OutputMPC, shell_height, shell_rings

# Time after the last planned motion or push before the shape is judged, s.
_SETTLING = 3.0


def to_case(results: Results, seconds: dict[str, float]) -> Case:
    """Everything the report shows of these results."""
    return Case(
        title=results.scene.title or "tensctl run",
        version=__version__,
        structure=results.structure,
        scene_toml=results.scene.to_toml(),
        equilibrium=results.equilibrium,
        linear=results.linear,
        controllability=results.controllability,
        study=results.study,
        lqr=results.lqr,
        lqr_way="" if results.lqr_way is None else str(results.lqr_way),
        lqg=results.lqg,
        lqg_way="" if results.lqg_way is None else str(results.lqg_way),
        path=results.path,
        survey=results.survey,
        run=results.run,
        sanity=results.sanity,
        demand=results.demand,
        accuracy=results.accuracy,
        solvers=results.solvers,
        limits=_limits(results),
        shape_error=results.shape_error,
        path_error=results.path_error,
        clearance=None if results.scene.target is None else results.scene.target.clearance,
        wanted=_wanted(results),
        overpowered=results.overpowered,
        carried=results.carried,
        height=_height(results),
        mpc_check=_mpc_check(results),
        pushes=_pushes(results),
        explain=None if results.dynamics is None else results.dynamics.explain().terms,
        checks=checks(results),
        seconds=dict(seconds),
    )


def checks(results: Results) -> tuple[Check, ...]:
    """Numbers recomputed from the results' own inputs, with the bounds they have to keep."""
    found = [_below("equilibrium: unbalanced force over the largest", results.equilibrium.residual, 1e-9)]
    if results.lqr is not None:
        found.append(_below("LQR: Riccati residual over its terms", results.lqr.residual, 1e-9))
        found.append(_below("LQR: real part of the slowest pole, 1/s", results.lqr.slowest, 0.0))
    if results.scheduled is not None:
        found.append(_below("LQR along the path: worst Riccati residual", results.scheduled.residual, 1e-9))
        found.append(_below("LQR along the path: real part of the slowest pole, 1/s", results.scheduled.slowest, 0.0))
    if results.lqg is not None:
        found += _of_lqg(results.lqg)
    if results.path is not None:
        worst = max(e.residual for e in results.path.equilibria)
        found.append(_below("path: unbalanced force of the worst planned equilibrium", worst, 1e-9))
    if results.run is not None:
        found.append(_below("run: drift of a rod's length over itself", results.run.rod_drift, 1e-12))
    if results.demand is not None and results.demand.closed:
        demand = results.demand
        found.append(_below("actuators: work less change of energy, J", abs(demand.balance), demand.allowed()))
    if results.certificate is not None and results.run is not None:
        certificate = results.certificate
        answered = np.isfinite(results.run.kkt)
        solved = results.run.kkt[answered & ~results.run.bounded]
        found.append(_below("MPC: worst KKT residual", solved.max(initial=0.0), 1e-6))
        found.append(_below("MPC: steps without an acceptable answer", float((~answered).sum()), 0))
        found.append(_below("MPC: hard limits violated", certificate.violations, 0))
        found += _twice_stated(certificate)
    if results.shape_error is not None and _had_time(results):
        found.append(_below("closed loop: last distance to the wanted shape, m", *_still(results)))
    return tuple(found)


def _of_lqg(lqg: LQG | HarmonicLQG) -> list[Check]:
    found = [
        _below("LQG: regulator's Riccati residual over its terms", lqg.regulator.residual, 1e-9),
        _below("LQG: filter's Riccati residual over its terms", lqg.filter.residual, 1e-9),
        _below("LQG: real part of the loop's slowest pole, 1/s", lqg.slowest, 0.0),
        _below("LQG: residual of the loop's covariance over its terms", lqg.covariance_residual, 1e-9),
    ]
    if lqg.separation is not None:
        found.append(_below("LQG: loop's poles against regulator's and filter's, relative", lqg.separation, 1e-5))
    return found


def _still(results: Results) -> tuple[float, float, str]:
    """Last distance to the wanted shape, and a millimetre beyond five deviations of what sensor noise keeps moving."""
    assert results.shape_error is not None
    assert results.scene.simulation is not None
    last = float(results.shape_error[-1])
    if results.lqg is None or results.scene.simulation.controller != "lqg":
        return last, 1e-3, ""
    shake = results.lqg.shake
    return last, 1e-3 + 5 * shake, f"sensor noise moves a node by {1e3 * shake:.2g} mm (standard deviation)"


def _twice_stated(certificate: Certificate) -> list[Check]:
    """The step that was stated again in cvxpy, when there was one to state."""
    if certificate.cost_difference is None or certificate.input_difference is None:
        return []
    note = f"step at {certificate.checked_at:.2f} s"
    return [
        _below("MPC: cost against cvxpy, relative", certificate.cost_difference, 1e-7, note),
        _below("MPC: first input against cvxpy, m", certificate.input_difference, 1e-7, note),
    ]


def _had_time(results: Results) -> bool:
    """Whether the run leaves the controller three seconds after the motion and the last push."""
    simulation = results.scene.simulation
    if simulation is None:
        return False
    busy = [push.stop for push in simulation.push if push.start < simulation.t_end]
    busy += [] if results.path is None else [results.path.start + results.path.duration]
    return simulation.t_end >= max(busy, default=0.0) + _SETTLING


def _below(name: str, value: float, bound: float, note: str = "") -> Check:
    return Check(name, float(value), float(bound), bool(value <= bound), note)


def _limits(results: Results) -> Limits | None:
    if results.mpc is None:
        return None
    members, mpc = results.equilibrium.potential.members, results.mpc
    return Limits(mpc.tension_min, members.floors, mpc.rate_max, mpc.floored)


def _height(results: Results) -> Height | None:
    if results.path is None or results.run is None or shell_rings(results.structure) is None:
        return None
    height = shell_height(results.structure)
    return Height(before=height.of(results.run.nodes[0]), after=height.of(results.run.nodes[-1]))


def _wanted(results: Results) -> tuple[Wanted, ...]:
    """What the target names, before, in the end and as wanted; without a run the end is that of the path."""
    path, run = results.path, results.run
    if path is None:
        return ()
    first, last = (path.equilibria[0].nodes, path.target_nodes) if run is None else (run.nodes[0], run.nodes[-1])
    found = []
    for feature, end in zip(path.features, path.legs[-1].ends, strict=True):
        name, unit = feature.name.split(", ")
        found.append(Wanted(name, unit, feature.of(first), feature.of(last), float(end)))
    return tuple(found)


def _mpc_check(results: Results) -> MpcCheck | None:
    mpc, certificate = results.mpc, results.certificate
    if mpc is None or certificate is None:
        return None
    return MpcCheck(
        solver=mpc.solver,
        horizon=mpc.horizon,
        dt=mpc.dt,
        variables=certificate.variables,
        constraints=certificate.constraints,
        cvxpy_difference=certificate.cost_difference,
        violations=certificate.violations,
        weighed=_weighed(results),
        travel=certificate.travel,
        feedback=_feedback(mpc),
        followed=tuple((f.label, f.reach, f.worst, f.rms) for f in followed(results)),
        parted=None if results.run is None else parting_told(results.run),
    )


def _feedback(mpc: MPC | NonlinearMPC) -> str:
    """What the controller sees, in words."""
    if not isinstance(mpc, OutputMPC):
        return "the whole state"
    model, seen = mpc.model, mpc.sensors.noise.size
    return (
        f"{seen} sensors, {len(mpc.tracked)} tracked; estimates {seen} constant disturbances, {model.forces} of them "
        f"forces (rank margin {model.rank_margin:.1e})"
    )


def _weighed(results: Results) -> str:
    """What the cost counts, in words."""
    asked = results.scene.mpc
    assert asked is not None
    energy = "energy of motion" if asked.rest_lengths is not None else "energy of motion and of rest-length changes"
    sizes = {"nodes": asked.nodes, "tensions": asked.tensions, "rest lengths by size": asked.rest_lengths}
    return ", ".join([energy, *(name for name, size in sizes.items() if size is not None)])


def _pushes(results: Results) -> tuple[ShownPush, ...]:
    simulation = results.scene.simulation
    if simulation is None:
        return ()
    labels = results.structure.node_labels
    return tuple(
        ShownPush(node, push.force, push.start, push.stop)
        for push in simulation.push
        for node in matches(labels, push.node, "simulation.push.node")
    )
