"""A study as plain numbers and words: what `summary.json` holds of it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tensctl.analysis.energies import ReachEnergies
from tensctl.analysis.losses import Loss
from tensctl.analysis.moving import Move
from tensctl.analysis.placement import Placement
from tensctl.analysis.reach import Reach
from tensctl.analysis.study import Study
from tensctl.analysis.verdict import ModalReport


def record(study: Study) -> dict:
    """Everything of a study that JSON can hold; SI units."""
    report = study.controllability
    parts = {
        "controllable_modes": list(report.controllable_modes),
        "uncontrollable_modes": list(report.uncontrollable_modes),
        "reasons": {str(mode.index): mode.reason for mode in report.modes if mode.reason},
        "modes": _modes(report, None if study.hautus is None else study.hautus.tolist()),
        "reach": _reach(study.reach),
        "control_ctrb": None if study.krylov is None else {"rank": study.krylov.rank, "states": study.krylov.states},
        "observability": None if study.observability is None else _modes(study.observability, None),
        "energies": None if study.energies is None else _energies(study.energies),
        "moves": [_move(one) for one in study.moves] or None,
        "placements": [_placement(one) for one in study.placements] or None,
        "redundancy": None if study.redundancy is None else [_loss(one) for one in study.redundancy.losses],
    }
    return {name: part for name, part in parts.items() if part is not None}


def write_record(study: Study, path: Path) -> None:
    """Write `record` as a JSON file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record(study), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _modes(report: ModalReport, hautus: list[float] | None) -> list[dict]:
    found = []
    for k, mode in enumerate(report.modes):
        entry = {
            "mode": mode.index,
            "kind": mode.kind,
            "frequency_Hz": mode.frequency,
            "multiplicity": mode.multiplicity,
            "gain": mode.gain,
            "distance_over_B" if report.question == "controllable" else "distance_over_C": mode.distance,
            "answer": mode.verdict,
            "strongest": dict(zip(mode.tendons, mode.shares, strict=True)),
            "reason": mode.reason,
        }
        found.append(entry if hautus is None else entry | {"distance_over_A_and_B": hautus[k]})
    return found


def _energies(energies: ReachEnergies) -> dict:
    return {
        "horizon_s": energies.gramian.horizon,
        "spread": finite(energies.gramian.spread),
        "residual": energies.gramian.residual,
        "Js_per_unit_of_output": dict(zip(energies.labels, map(finite, energies.outputs.tolist()), strict=True)),
        "Js_per_joule_of_mode": dict(zip(map(str, energies.modes), map(finite, energies.joules.tolist()), strict=True)),
    }


def _move(move: Move) -> dict:
    return {
        "node": move.equilibrium.structure.node_labels[move.node],
        "by_m": move.by.tolist(),
        "goal": move.goal,
        "found_by": move.how,
        "shorten_m": dict(move.tendons),
        "not_reached_m": move.residual.tolist(),
        "largest_other_displacement_m": float(np.delete(np.linalg.norm(move.displacements, axis=1), move.node).max()),
        "tension_changes_N": [float(move.tension_changes.min()), float(move.tension_changes.max())],
        "optimality": move.optimality,
    }


def _placement(placement: Placement) -> dict:
    return {
        "measure": placement.measure.name,
        "tendons": list(placement.tendons),
        "value": placement.value,
        "greedy": placement.greedy,
        "bound": placement.bound,
        "gap_of_all": placement.gap,
        "exact": placement.exact,
    }


def _loss(loss: Loss) -> dict:
    return {
        "tendons": list(loss.tendons),
        "cut": {
            "rest": loss.rest,
            "largest_displacement_m": finite(loss.moved),
            "slack_tendons": loss.slack,
            "lowest_frequency_Hz": loss.frequency,
            "driven_of": list(loss.driven_cut),
            "static_rank": loss.held_cut,
        },
        "jammed": {
            "driven_of": list(loss.driven_jammed),
            "static_rank": loss.held_jammed,
            "weakest_output": loss.worst[0],
            "part_left": finite(loss.worst[1]),
        },
        "note": loss.note,
    }


def finite(value: float) -> float | None:
    """The number, or None where it is infinite: JSON has no word for that."""
    return value if np.isfinite(value) else None


def _reach(reach: Reach) -> dict:
    return {
        "rank": reach.rank,
        "undecided": reach.undecided,
        "flexible_freedoms": reach.freedoms,
        "inputs": reach.inputs,
        "share_not_held_by_mode": dict(
            zip((str(mode.index) for mode in reach.linear.flexible.modes), reach.shares.tolist(), strict=True)
        ),
    }
