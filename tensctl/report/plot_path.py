"""A planned path: what was wanted and what the run did, and what the structure is like on the way."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from tensctl.report.case import Case
from tensctl.report.palette import BLUE, MUTED, ORANGE
from tensctl.report.plots import Plot, Sheet, draw
from tensctl.report.strips import Limit, Strip, draw_strip, span_of

if TYPE_CHECKING:
    from tensctl.synthesis import Feature, PathSurvey, ShapePath

_PLANE = Sheet(width=430.0, height=400.0, right=24.0, top=32.0)
# Moments at which the planned curve is drawn.
_MOMENTS = 601
# A curve that is flatter than this is drawn over time only.
_FLAT = 0.02


def wanted(case: Case) -> tuple[Plot, ...]:
    """What was wanted over time, one plot for each kind of feature, and what the run made of it."""
    return tuple(_over_time(case, kind, features) for kind, features in _kinds(case).items())


def plane(case: Case) -> Plot | None:
    """Tilt, or else the way of the tip, seen from above; None where neither was wanted or the way is straight."""
    pairs = {kind: features for kind, features in _kinds(case).items() if kind in ("tilt", "tip")}
    if case.path is None or not pairs:
        return None
    kind = max(pairs)
    path, (x, y) = case.path, pairs[kind]
    planned = _values((x, y), [path.nodes_at(t) for t in _moments(path)])
    if not np.ptp(planned, axis=0).min() > _FLAT * np.ptp(planned, axis=0).max():
        return None
    name, unit = ("lean", "rad") if kind == "tilt" else ("tip", "m")

    def paint(axes: Axes) -> None:
        axes.plot(*planned.T, color=ORANGE.light, linewidth=3.0, alpha=0.55, label="planned")
        if case.run is not None:
            axes.plot(*_values((x, y), case.run.nodes).T, color=BLUE.light, linewidth=1.2, label="run")
        axes.plot(*planned[0], "o", color=MUTED.light, markersize=5)
        axes.set_aspect("equal", adjustable="datalim")
        axes.margins(0.08)
        axes.grid(visible=True, axis="both")
        axes.set_title(f"{name.capitalize()} towards y, {unit}", loc="left", pad=12)
        axes.set_xlabel(f"{name.capitalize()} towards x, {unit}", loc="right")
        axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=2, frameon=False, borderaxespad=0)

    return draw(f"plane-{kind}", f"{name.capitalize()} seen from above, planned and run", paint, _PLANE)


def margins(case: Case) -> tuple[Plot, ...]:
    """Numbers along the path that should not get too small."""
    survey = case.survey
    if survey is None:
        return ()
    shown = [("frequency", "Lowest frequency, Hz"), ("stiffness", "Stiffness of the softest node, N/m")]
    found = [_tension(case)]
    if np.isfinite(survey.of("clearance")).all():
        found.append(_clearance(case, survey))
    found += [_along(survey.time, name, title, survey.of(name)) for name, title in shown]
    return (
        *found,
        _along(survey.time, "drive", "Controllability: least gain of a mode over the largest", survey.of("drive")),
    )


def _tension(case: Case) -> Plot:
    """Lowest tension at rest and as the path moves."""
    path = case.path
    assert path is not None
    kept, time = ~case.structure.grounded_tendons, _moments(path)
    both = [at(time)[:, kept].min(axis=1) for at in (path.balanced_tensions_at, path.tensions_at)]
    floor = None if case.limits is None else case.limits.tension_min
    return draw_strip(
        Strip(
            name="path-tension",
            label="Lowest tension along the path",
            title="Lowest tension, N",
            time=time,
            span=span_of(time),
            values=np.stack(both, axis=1),
            labels=("at rest", "moving"),
            urgency=np.array([1.0, 2.0]),
            limits=() if floor is None else (Limit(floor, f"floor {floor:g} N"),),
        )
    )


def _clearance(case: Case, survey: PathSurvey) -> Plot:
    """Least distance of two rods of the planned shapes, and in the run."""
    run = None if case.sanity is None else case.sanity.rods
    time, values, labels = survey.time, survey.of("clearance")[:, None], ("",)
    if run is not None:
        planned = np.interp(run.time, survey.time, survey.of("clearance"))
        time, values, labels = run.time, np.stack([planned, run.distance], axis=1), ("plan", "run")
    return draw_strip(
        Strip(
            name="path-clearance",
            label="Least distance of two rods, along the path",
            title="Least distance of two rods, m",
            time=time,
            span=span_of(time),
            values=values,
            labels=labels,
            urgency=np.arange(len(labels), 0, -1.0),
            limits=() if case.clearance is None else (Limit(case.clearance, f"asked {case.clearance:g} m"),),
            pushes=case.pushes,
        )
    )


def _along(time: np.ndarray, name: str, title: str, values: np.ndarray) -> Plot:
    """A number of every planned equilibrium over the time at which the path is there."""
    return draw_strip(
        Strip(
            name=f"path-{name}",
            label=f"{title}, along the path",
            title=title,
            time=time,
            span=span_of(time),
            values=values[:, None],
            labels=("",),
            urgency=np.ones(1),
        )
    )


def _moments(path: ShapePath) -> np.ndarray:
    return path.start + path.duration * np.linspace(0, 1, _MOMENTS)


def _over_time(case: Case, kind: str, features: tuple[Feature, ...]) -> Plot:
    path, run = case.path, case.run
    assert path is not None
    time = _moments(path) if run is None else run.time
    planned = _values(features, [path.nodes_at(t) for t in time])
    unit = features[0].name.split(", ")[1]
    names = [feature.name.split(", ")[0].removeprefix(kind).strip() for feature in features]
    if run is None:
        values, labels = planned, tuple(name or kind for name in names)
    else:
        values = np.hstack([planned, _values(features, run.nodes)])
        labels = tuple(f"{name} {which}".strip() for which in ("plan", "run") for name in names)
    plot = draw_strip(
        Strip(
            name=f"wanted-{kind.lower().replace(' ', '-')}",
            label=f"{kind} over time, planned and run",
            title=f"{kind.capitalize() if kind.islower() else kind}, {unit}",
            time=time,
            span=span_of(time),
            values=values,
            labels=labels,
            urgency=np.arange(len(labels), 0, -1.0),
            pushes=case.pushes,
        )
    )
    return replace(plot, span=span_of(time))


def _kinds(case: Case) -> dict[str, tuple[Feature, ...]]:
    """Features of the same kind together: tilt x and tilt y, the coordinates of a node."""
    found: dict[str, tuple[Feature, ...]] = {}
    for feature in () if case.path is None or case.survey is None else case.path.features:
        kind = feature.name.split(", ")[0].removesuffix(" x").removesuffix(" y").removesuffix(" z")
        found[kind] = (*found.get(kind, ()), feature)
    return found


def _values(features: tuple[Feature, ...], nodes) -> np.ndarray:
    return np.array([[feature.of(each) for feature in features] for each in nodes])
