"""The numbers of a run as JSON: small, stable names, SI units."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from tensctl import __version__
from tensctl.pipeline.results import Results

if TYPE_CHECKING:
    from tensctl.analysis import Study
    from tensctl.simulation import ActuatorDemand, Sanity
    from tensctl.synthesis import MPC, NonlinearMPC, PathSurvey
    from tensctl.synthesis.harmonic_margins import HarmonicSensitivity
    from tensctl.synthesis.margins import DiskMargin, Sensitivity


def summarise(results: Results, seconds: dict[str, float]) -> dict:
    """Everything a script would want to know without opening the run."""
    parts = {
        "title": results.scene.title,
        "version": __version__,
        "structure": _structure(results),
        "equilibrium": _equilibrium(results),
        "linear": _linear(results),
        "controllability": None if results.study is None else _study(results.study),
        "lqr": _lqr(results),
        "lqg": _lqg(results),
        "target": _target(results),
        "mpc": _mpc(results),
        "simulation": _simulation(results),
        "actuators": None if results.demand is None else _demand(results.demand),
        "sanity": None if results.sanity is None else _sanity(results.sanity),
        "accuracy": None if results.accuracy is None else results.accuracy.to_dict(),
        "solvers": None if results.solvers is None else results.solvers.to_dict(),
        "seconds": {name: round(value, 4) for name, value in seconds.items()},
    }
    return {name: part for name, part in parts.items() if part is not None}


def _demand(demand: ActuatorDemand) -> dict:
    from tensctl.simulation.demand_table import record

    return record(demand)


def _structure(results: Results) -> dict:
    structure = results.structure
    return {
        "nodes": len(structure.nodes),
        "rods": len(structure.rods),
        "tendons": len(structure.tendons),
        "inputs": results.equilibrium.potential.members.gearing.size,
        "degrees_of_freedom": results.equilibrium.potential.manifold.size,
    }


def _equilibrium(results: Results) -> dict:
    e = results.equilibrium
    return {
        "energy_J": e.energy,
        "residual": e.residual,
        "iterations": e.iterations,
        "stable": str(e.stable),
        "judged_in": "plane" if e.structure.planar else "space",
        "smallest_omega2": e.smallest,
        "tolerance_omega2": e.tolerance,
        "lowest_tension_N": float(e.tensions.min()) if e.tensions.size else None,
        "largest_tension_N": float(e.tensions.max(initial=0.0)),
    }


def _linear(results: Results) -> dict | None:
    linear = results.linear
    if linear is None:
        return None
    return {
        "states": len(linear.states),
        "flexible_states": len(linear.flexible.states),
        "outputs": len(linear.outputs),
        "rigid_body_modes": sum(mode.kind == "rigid-body" for mode in linear.modes),
        "frequencies_Hz": [mode.frequency for mode in linear.modes],
    }


def _study(study: Study) -> dict:
    from tensctl.analysis.record import record

    return record(study)


def _lqr(results: Results) -> dict | None:
    lqr, way = results.lqr, results.lqr_way
    if lqr is None or way is None:
        return None
    facts = {"way": way.taken, "why": way.why}
    facts |= {"riccati_residual": lqr.residual, "slowest_pole": lqr.slowest, "sample_time_s": lqr.dt}
    facts["gain_doubt"] = lqr.gain_doubt
    facts |= _margins(lqr.sensitivity, results)
    return facts | ({"left_out": [str(mode) for mode in lqr.left]} if lqr.left else {})


def _lqg(results: Results) -> dict | None:
    lqg, way = results.lqg, results.lqg_way
    if lqg is None or way is None:
        return None
    facts = {
        "way": way.taken,
        "why": way.why,
        "states": lqg.order,
        "measured": len(lqg.sensors.labels),
        "sample_time_s": lqg.dt,
        "regulator_riccati_residual": lqg.regulator.residual,
        "filter_riccati_residual": lqg.filter.residual,
        "regulator_gain_doubt": lqg.regulator_doubt,
        "filter_gain_doubt": lqg.filter.gain_doubt,
        "slowest_pole": lqg.slowest,
        "separation": lqg.separation,
        **_margins(lqg.sensitivity, results),
        "expected_cost_of_a_period": lqg.expected_cost,
        "node_deviation_from_sensor_noise_m": lqg.shake,
    }
    return facts | ({"left_out": [str(mode) for mode in lqg.left]} if lqg.left else {})


def _margins(sensitivity: Sensitivity | HarmonicSensitivity, results: Results) -> dict:
    """Disk margins, enclosed: of all inputs at once, and of the input that bears least alone; or why not."""
    assert results.linear is not None
    facts: dict = {}
    if sensitivity.costly:
        facts["disk_margin_left_out"] = sensitivity.costly
    else:
        facts |= _margin("disk_margin", sensitivity.all_inputs)
    if sensitivity.costly_alone:
        return facts | {"disk_margin_of_one_input_left_out": sensitivity.costly_alone}
    weakest, which = sensitivity.weakest_input
    label = results.linear.inputs[which].removeprefix("u_")
    return facts | _margin("disk_margin_of_one_input", weakest) | {"weakest_input": label}


def _margin(name: str, margin: DiskMargin) -> dict:
    """Its lower end, and what that allows, and its upper end."""
    low, high = margin.gain
    return {
        name: margin.alpha,
        f"{name}_at_most": margin.largest,
        f"{name}_gain": [low, high if np.isfinite(high) else None],
        f"{name}_phase_deg": margin.phase,
    }


def _target(results: Results) -> dict | None:
    path = results.path
    if path is None:
        return None
    from tensctl.synthesis import shell_height, shell_rings

    facts: dict = {}
    if shell_rings(results.structure) is not None:
        height = shell_height(results.structure)
        facts["height_before_m"] = height.of(path.equilibria[0].nodes)
        facts["height_wanted_m"] = height.of(path.target_nodes)
    return facts | {
        "wanted": {feature.name: feature.of(path.target_nodes) for feature in path.features},
        "largest_rest_length_change_m": float(np.abs(path.target.inputs).max()),
        "lowest_tension_N": float(path.tensions[:, ~path.target.structure.grounded_tendons].min()),
        "fastest_reference_m_per_s": path.fastest,
        "on_the_way": None if results.survey is None else _on_the_way(results.survey),
    }


def _on_the_way(survey: PathSurvey) -> dict:
    least = {name: survey.worst(name) for name in ("frequency", "stiffness", "tension", "moving_tension", "clearance")}
    found = {
        "lowest_frequency_Hz": least["frequency"].frequency,
        "least_stiffness_N_per_m": least["stiffness"].stiffness,
        "softest_node": least["stiffness"].softest,
        "lowest_tension_N": least["tension"].tension,
        "slackest_tendon": least["tension"].slackest,
        "lowest_tension_moving_N": least["moving_tension"].moving_tension,
        "least_drive": survey.worst("drive").drive,
    }
    if least["clearance"].nearest:
        found |= {"least_rod_distance_m": least["clearance"].clearance, "nearest_rods": least["clearance"].nearest}
    return found


def _mpc(results: Results) -> dict | None:
    mpc, run, certificate = results.mpc, results.run, results.certificate
    if mpc is None or run is None or certificate is None:
        return None
    from tensctl.pipeline.followed import followed
    from tensctl.synthesis import MPC

    return {
        "horizon": mpc.horizon,
        "dt_s": mpc.dt,
        "solver": mpc.solver,
        **({"solver_why": mpc.why} if isinstance(mpc, MPC) else {}),
        "variables": certificate.variables,
        "constraints": certificate.constraints,
        "statuses": dict(Counter(run.status[np.isin(run.time, run.sample_time)].tolist())),
        "median_step_s": float(np.median(run.solve_time)),
        "worst_step_s": float(run.solve_time.max()),
        "worst_kkt": float(run.kkt[np.isfinite(run.kkt) & ~run.bounded].max(initial=0.0)),
        "bounded_steps": int(run.bounded.sum()),
        "worst_kkt_of_bounded_steps": float(run.kkt[run.bounded].max(initial=0.0)),
        "relaxed_steps": int((run.relaxed > 0).sum()),
        "largest_relaxation_N": float(run.relaxed.max()),
        "largest_share_of_u_max": certificate.travel,
        "parted_steps": int((run.parted >= 0).sum()),
        "largest_margin_gap_N": float(np.nanmax(np.abs(run.margin_gap), initial=0.0)),
        "samples_below_tension_floor": certificate.below_floor,
        "hard_limit_violations": certificate.violations,
        "cvxpy_cost_difference": certificate.cost_difference,
        "cvxpy_input_difference_m": certificate.input_difference,
        "terminal_riccati_residual": certificate.riccati_residual,
        "followed": {f.label: {"reach": f.reach, "worst": f.worst, "rms": f.rms} for f in followed(results)},
    } | _from_sensors(mpc)


def _from_sensors(mpc: MPC | NonlinearMPC) -> dict:
    """What a controller sees, and what there is to say of one that estimates."""
    from tensctl.synthesis import OutputMPC

    if not isinstance(mpc, OutputMPC):
        return {"feedback": "states"}
    missed = None if mpc.target is None or not np.isfinite(mpc.target.missed) else mpc.target.missed
    return {
        "feedback": "outputs",
        "measured": mpc.sensors.noise.size,
        "tracked": len(mpc.tracked),
        "estimated_forces": mpc.model.forces,
        "rank_margin": mpc.model.rank_margin,
        "refused_measurements": mpc.estimate.rejected,
        "target_missed_deviations": missed,
    }


def _simulation(results: Results) -> dict | None:
    run, error = results.run, results.shape_error
    if run is None:
        return None
    facts = {
        "t_end_s": float(run.time[-1]),
        "method": run.method,
        "evaluations": run.evaluations,
        "switches": run.switches,
        "rod_length_drift": run.rod_drift,
    }
    if error is not None:
        facts |= {"final_shape_error_m": float(error[-1]), "largest_shape_error_m": float(error.max())}
    if results.path_error is not None:
        facts["farthest_from_path_m"] = float(results.path_error.max())
    if results.carried is not None:
        facts |= dict(zip(("centre_moved_m", "turned_rad"), results.carried, strict=True))
    return facts


def _sanity(sanity: Sanity) -> dict:
    rods, tendons = sanity.structure.rod_labels, sanity.structure.segment_labels
    most, since = sanity.most_slack
    facts: dict = {"warnings": list(sanity.warnings), "not_checked": list(sanity.not_checked)}
    for name, close, second in (("rod_rod", sanity.rods, rods), ("rod_tendon", sanity.tendons, tendons)):
        if close is not None and np.isfinite(close.least):
            first, other = close.pairs[close.least_at]
            facts |= {
                f"{name}_clearance_m": close.least,
                f"{name}_clearance_at_s": float(close.time[close.least_at]),
                f"{name}_clearance_of": [rods[first], second[other]],
                f"{name}_passings": len(close.passings),
            }
    largest = sanity.largest_compression
    if largest is not None:
        facts |= dict(zip(("rod_compression_N", "rod_compression_of", "rod_compression_at_s"), largest, strict=True))
    if sanity.buckling is not None:
        facts["largest_share_of_euler_load"] = float(sanity.buckling.share.max())
    return facts | {"largest_slack_fraction": most, "largest_slack_fraction_at_s": since}
