"""Whether the run is physical, over time: distances of members, compression of rods, slack tendons."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensctl.report.case import Case
from tensctl.report.grounded import left_out
from tensctl.report.plots import Plot
from tensctl.report.strips import Limit, Strip, draw_strip, span_of

if TYPE_CHECKING:
    from tensctl.simulation import Sanity


def clearances(case: Case) -> Plot | None:
    """Least distance of two rods, and of a rod and a tendon."""
    sanity = case.sanity
    if sanity is None:
        return None
    kinds = (("rods", sanity.rods), ("rod, tendon", sanity.tendons))
    known = [(name, 1e3 * found.distance) for name, found in kinds if found is not None and np.isfinite(found.least)]
    if not known:
        return None
    names, distances = zip(*known, strict=True)
    return draw_strip(
        Strip(
            name="clearance",
            label="Least distance of members over time",
            title="Least distance, mm",
            time=sanity.time,
            span=span_of(sanity.time),
            values=np.stack(distances, axis=1),
            labels=names,
            urgency=np.arange(len(names), 0, -1.0),
            limits=(Limit(0.0, "contact" if sanity.thick else ""),),
            pushes=case.pushes,
        )
    )


def compressions(case: Case) -> Plot | None:
    """Largest compression along every rod, N; over the Euler load where any rod has one."""
    sanity = case.sanity
    if sanity is None or not sanity.forces.largest.size:
        return None
    return draw_strip(_over_load(case, sanity) if sanity.buckling is not None else _plain(case, sanity))


def _plain(case: Case, sanity: Sanity) -> Strip:
    values = sanity.forces.largest
    return Strip(
        name="compression",
        label="Largest compression along every rod over time",
        title="Rod compression, N",
        time=sanity.time,
        span=span_of(sanity.time),
        values=values,
        labels=sanity.structure.rod_labels,
        urgency=values.max(axis=0),
        pushes=case.pushes,
    )


def _over_load(case: Case, sanity: Sanity) -> Strip:
    assert sanity.buckling is not None
    known = np.flatnonzero(np.isfinite(sanity.buckling.critical))
    values = sanity.buckling.share[:, known]
    return Strip(
        name="compression",
        label="Largest compression along every rod with EI, over its Euler load, over time",
        title="Rod compression over Euler load",
        time=sanity.time,
        span=span_of(sanity.time),
        values=values,
        labels=tuple(sanity.structure.rod_labels[rod] for rod in known),
        urgency=values.max(axis=0),
        limits=(Limit(1.0, "buckling"),) if values.max() > 0.5 else (),
        pushes=case.pushes,
    )


def slack(case: Case) -> Plot | None:
    """Part of the tendons that are slack; None when none ever is."""
    sanity = case.sanity
    if sanity is None or not sanity.slack.any():
        return None
    return draw_strip(
        Strip(
            name="slack",
            label="Part of the tendons that are slack over time",
            title="Slack tendons, %",
            time=sanity.time,
            span=span_of(sanity.time),
            values=100 * sanity.slack[:, None],
            labels=("slack",),
            urgency=np.ones(1),
            note=left_out(case.structure),
            pushes=case.pushes,
            steps=True,
        )
    )
