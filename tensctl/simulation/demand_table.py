"""What is asked of actuators, as aligned text and as plain numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from tensctl.simulation.demand import ActuatorDemand

# Lines that a terminal shows; the rest is counted.
_SHOWN = 40
_COLUMNS = (
    ("peak_force_N", "force [N]"),
    ("peak_force_at_s", "at [s]"),
    ("rms_force_N", "rms [N]"),
    ("holding_force_N", "holding [N]"),
    ("peak_speed_m_per_s", "speed [m/s]"),
    ("peak_power_W", "power [W]"),
    ("peak_power_at_s", "at [s]"),
    ("peak_braking_W", "braking [W]"),
    ("positive_work_J", "given [J]"),
    ("regenerated_work_J", "back [J]"),
    ("net_work_J", "net [J]"),
)


def table(demand: ActuatorDemand) -> str:
    """Peaks, rms and holding force, and work of each actuator, then of all together."""
    limited = bool(demand.load.value.any())
    names = (*(name for _, name in _COLUMNS), *(["of limit"] if limited else []))
    width = max(len("actuator"), *(len(label) for label in demand.labels))
    lines = [" ".join([f"{'actuator':{width}}", *(f"{name:>11}" for name in names)])]
    rows, places = _rows(demand), demand.most_powerful
    for k in places[:_SHOWN]:
        share = [f"{100 * demand.load.value[k]:9.0f} %"] if limited else []
        lines.append(" ".join([f"{demand.labels[k]:{width}}", *(f"{x:11.4g}" for x in rows[k]), *share]))
    if len(places) > _SHOWN:
        lines.append(f"and {len(places) - _SHOWN} less powerful ones")
    return "\n".join([*lines, *_together(demand)])


def record(demand: ActuatorDemand) -> dict:
    """Peaks and work as plain numbers for JSON."""
    supply, when = demand.peak_supply
    names = tuple(name for name, _ in _COLUMNS)
    rows = [dict(zip(names, row, strict=True)) for row in _rows(demand).tolist()]
    limits = {"largest_share_of_force_max": float(demand.load.value.max())} if demand.load.value.any() else {}
    return {
        "of": demand.of,
        "peak_supply_W": supply,
        "peak_supply_at_s": when,
        "net_work_J": float(demand.work.net.sum()),
        "net_work_error_J": float(demand.work_error.sum()),
        "energy_change_J": demand.energy_change,
        "only_actuators_work": demand.closed,
        **limits,
        "actuators": dict(zip(demand.labels, rows, strict=True)),
    }


def _rows(demand: ActuatorDemand) -> np.ndarray:
    """Numbers of each actuator, (nu, columns)."""
    d = demand
    return np.column_stack([
        *d.peak_force, d.rms_force, d.holding_force, d.peak_speed.value, *d.peak_power, d.peak_braking.value, *d.work,
    ])  # fmt: skip


def _together(demand: ActuatorDemand) -> list[str]:
    supply, when = demand.peak_supply
    given, back, net = (float(part.sum()) for part in demand.work)
    others = {
        "run": "" if demand.closed else "; the difference is what dampers, drag and pushes did",
        "path": "; the difference is inertia that no actuator balances",
        "slow path": ", infinitely slow",
    }
    stalls = [f"warning: {demand.stalls}"] if demand.stalls else []
    return [
        f"together at most {supply:.4g} W at {when:.4g} s; {given:.4g} J given, {-back:.4g} J taken back",
        f"net work {net:.4g} J, change of energy {demand.energy_change:.4g} J{others[demand.of]}",
        *stalls,
    ]
