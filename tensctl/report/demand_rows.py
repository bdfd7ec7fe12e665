"""Rows of the table of actuators, most powerful first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tensctl.report.tables import share_of_largest

if TYPE_CHECKING:
    from tensctl.simulation import ActuatorDemand

# Actuators that the table shows.
_SHOWN = 40


@dataclass(frozen=True)
class DemandRow:
    """One actuator: peaks with times, rms and holding force, work, all in SI units.

    Attributes
    ----------
    share : float
        Largest power, driving or braking, over that of the most powerful actuator.
    load : float
        Largest tension over its stall limit; 0 without one.
    """

    label: str
    force: float
    force_at: float
    rms: float
    holding: float
    speed: float
    power: float
    power_at: float
    braking: float
    share: float
    positive: float
    regenerated: float
    load: float


def demand_rows(demand: ActuatorDemand) -> tuple[DemandRow, ...]:
    """The most powerful actuators."""
    d, places = demand, demand.most_powerful[:_SHOWN]
    shares = share_of_largest(tuple(max(d.peak_power.value[k], d.peak_braking.value[k]) for k in places))
    return tuple(
        DemandRow(
            label=d.labels[k],
            force=float(d.peak_force.value[k]),
            force_at=float(d.peak_force.time[k]),
            rms=float(d.rms_force[k]),
            holding=float(d.holding_force[k]),
            speed=float(d.peak_speed.value[k]),
            power=float(d.peak_power.value[k]),
            power_at=float(d.peak_power.time[k]),
            braking=float(d.peak_braking.value[k]),
            share=share,
            positive=float(d.work.positive[k]),
            regenerated=float(d.work.regenerated[k]),
            load=float(d.load.value[k]),
        )
        for k, share in zip(places, shares, strict=True)
    )
