"""Power of every actuator over time: above zero it drives the structure, below it brakes."""

from __future__ import annotations

import numpy as np

from tensctl.report.case import Case
from tensctl.report.plots import Plot
from tensctl.report.strips import Strip, draw_strip, span_of


def power(case: Case) -> Plot | None:
    """None where no actuator moves."""
    demand = case.demand
    if demand is None or len(demand.time) < 2 or not demand.power.any():
        return None
    return draw_strip(
        Strip(
            name="power",
            label="Power of every actuator over time",
            title="Power, W",
            time=demand.time,
            span=span_of(demand.time),
            values=demand.power,
            labels=demand.labels,
            urgency=np.abs(demand.power).max(axis=0),
            pushes=case.pushes,
        )
    )
