"""Force, speed and power of every actuator over time: power above zero drives the structure, below it brakes."""

from __future__ import annotations

import numpy as np

from tensctl.report.case import Case
from tensctl.report.plots import Plot
from tensctl.report.strips import Strip, draw_strip, span_of


def force(case: Case) -> Plot | None:
    """None where no actuator moves."""
    return _of_every_actuator(case, "force", "Force, N")


def speed(case: Case) -> Plot | None:
    """None where no actuator moves."""
    return _of_every_actuator(case, "speed", "Speed, m/s")


def power(case: Case) -> Plot | None:
    """None where no actuator moves."""
    return _of_every_actuator(case, "power", "Power, W")


def _of_every_actuator(case: Case, name: str, title: str) -> Plot | None:
    """One number of the demand over time; the largest are in colour."""
    demand = case.demand
    if demand is None or len(demand.time) < 2 or not demand.power.any():
        return None
    values = getattr(demand, name)
    return draw_strip(
        Strip(
            name=f"actuator-{name}",
            label=f"{name.capitalize()} of every actuator over time",
            title=title,
            time=demand.time,
            span=span_of(demand.time),
            values=values,
            labels=demand.labels,
            urgency=np.abs(values).max(axis=0),
            pushes=case.pushes,
        )
    )
