"""What happened over time: tensions, rest lengths, inputs, rates and shape error, with their limits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from tensctl.report.case import RELAXED_MORE_THAN, Case
from tensctl.report.grounded import left_out
from tensctl.report.palette import BLUE, ORANGE
from tensctl.report.plots import Plot, draw, log_axis
from tensctl.report.strips import SHEET, Limit, Strip, draw_strip, frame, shade, span_of
from tensctl.report.thin import thinned

if TYPE_CHECKING:
    from tensctl.simulation import Run

ROUNDING = 1e-10  # m; what stays below it all the time is rounding: drawn, its noise would look like motion


def tensions(case: Case) -> Plot | None:
    """Tension of every tendon, its floor, and the moments at which the floor gave way."""
    run, limits = case.run, case.limits
    if run is None:
        return None
    floor = None if limits is None else limits.tension_min
    shown = ~case.structure.grounded_tendons
    return draw_strip(
        Strip(
            name="tension",
            label="Tension of every tendon over time",
            title="Tension, N",
            time=run.time,
            span=span_of(run.time),
            values=run.tensions[:, shown],
            labels=_labels(case, shown),
            urgency=-_least(run.tensions[:, shown]),
            note=left_out(case.structure),
            limits=() if floor is None else (Limit(floor, f"floor {floor:g} N"),),
            pushes=case.pushes,
            relaxed=relaxed_moments(case),
        )
    )


def lengths(case: Case) -> Plot | None:
    """Length of every tendon of a run that nothing steered; None for a steered one, whose rest lengths say more."""
    run = case.run
    if run is None or _steered(run):
        return None
    shown = ~case.structure.grounded_tendons
    return draw_strip(
        Strip(
            name="length",
            label="Length of every tendon over time",
            title="Tendon length, m",
            time=run.time,
            span=span_of(run.time),
            values=run.lengths[:, shown],
            labels=_labels(case, shown),
            urgency=np.ptp(run.lengths[:, shown], axis=0),
            note=left_out(case.structure),
            pushes=case.pushes,
        )
    )


def rest_lengths(case: Case) -> Plot | None:
    """Rest length of every tendon and its floor; of floors that differ, the lowest and the highest.

    None when nothing was steered, and rest lengths stay what they are.
    """
    run, limits = case.run, case.limits
    if run is None or not _steered(run):
        return None
    shown = ~case.structure.grounded_tendons
    values = run.rest_lengths[:, shown]
    floor = None if limits is None or limits.rest_length_floor is None else np.asarray(limits.rest_length_floor)[shown]
    return draw_strip(
        Strip(
            name="rest-length",
            label="Rest length of every tendon over time",
            title="Rest length, m",
            time=run.time,
            span=span_of(run.time),
            values=values,
            labels=_labels(case, shown),
            urgency=-_least(values - (0.0 if floor is None else floor)),
            limits=() if floor is None or not len(floor) else _floor_lines(floor),
            note=left_out(case.structure),
            pushes=case.pushes,
        )
    )


def inputs(case: Case) -> Plot | None:
    """Change of rest length that each input asks for; None when nothing was steered."""
    run = case.run
    if run is None or not _steered(run):
        return None
    return draw_strip(
        Strip(
            name="input",
            label="Change of rest length of every input over time",
            title="Shortening u, mm",
            time=run.time,
            span=span_of(run.time),
            values=1e3 * run.inputs,
            labels=run.input_labels,
            urgency=_largest(run.inputs),
            pushes=case.pushes,
        )
    )


def rates(case: Case) -> Plot | None:
    """Rate of each input between recorded times, against its limit; None when nothing was steered."""
    run, limits = case.run, case.limits
    if run is None or not _steered(run) or len(run.time) < 2:
        return None
    rate = input_rates(run.time, run.inputs)
    most = None if limits is None else limits.rate_max
    return draw_strip(
        Strip(
            name="rate",
            label="Rate of every input over time",
            title="Rate of shortening, m/s",
            time=run.time[:-1],
            span=span_of(run.time),
            values=rate,
            labels=run.input_labels,
            urgency=_largest(rate),
            limits=() if most is None else (Limit(most, f"limit {most:g} m/s"), Limit(-most, "")),
            pushes=case.pushes,
            steps=True,
        )
    )


def shape_error(case: Case) -> Plot | None:
    """Largest distance of a node from where it is wanted, and from the path, on a logarithmic axis."""
    run, error = case.run, case.shape_error
    if run is None or error is None or not np.any(error > ROUNDING):
        return None

    def paint(axes: Axes) -> None:
        shade(axes, case.pushes)
        if case.path_error is not None:
            axes.plot(*_positive(run.time, case.path_error), color=ORANGE.light, linewidth=1.2, label="from the path")
        axes.plot(*_positive(run.time, error), color=BLUE.light, linewidth=1.7, label="from the wanted shape")
        if case.path_error is not None:
            axes.legend(loc="lower right", bbox_to_anchor=(1, 1.06), ncols=2, frameon=False, borderaxespad=0)
        axes.set_yscale("log")
        log_axis(axes)
        frame(axes, span_of(run.time), "Largest node error, mm")

    plot = draw("shape-error", "Largest node error over time", paint, SHEET)
    return replace(plot, span=span_of(run.time))


def _positive(time: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A curve of millimetres without what a logarithmic axis cannot show: rounding, and rest on the path."""
    return thinned(time, 1e3 * np.where(error > ROUNDING, error, np.nan))


def input_rates(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Finite differences (times - 1, inputs) of the inputs, per second; 0 where two times coincide."""
    step = np.diff(time)[:, None]
    return np.divide(np.diff(values, axis=0), step, out=np.zeros_like(values[1:]), where=step > 0)


def relaxed_moments(case: Case) -> np.ndarray:
    """Moments (s) at which the controller let the tension floor give way by more than rounding."""
    if case.run is None:
        return np.empty(0)
    return case.run.sample_time[case.run.relaxed > RELAXED_MORE_THAN]


def _steered(run: Run) -> bool:
    return bool(np.max(np.abs(run.inputs), initial=0.0) > ROUNDING)


def _labels(case: Case, shown: np.ndarray) -> tuple[str, ...]:
    return tuple(label for label, is_shown in zip(case.structure.tendon_labels, shown, strict=True) if is_shown)


def _floor_lines(floor: np.ndarray) -> tuple[Limit, ...]:
    low, high = float(floor.min()), float(floor.max())
    if high - low <= 1e-9 * high:
        return (Limit(low, f"floor {low:.3g} m"),)
    return (Limit(high, f"floors {low:.3g} to {high:.3g} m"), Limit(low, ""))


def _least(values: np.ndarray) -> np.ndarray:
    return np.nan_to_num(values, nan=np.inf).min(axis=0, initial=np.inf)


def _largest(values: np.ndarray) -> np.ndarray:
    return np.nan_to_num(np.abs(values)).max(axis=0, initial=0.0)
