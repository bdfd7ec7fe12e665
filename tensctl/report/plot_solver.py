"""How the MPC's solver did: its times as a histogram, the optimality residual of every solve."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from tensctl.report.numbers import seconds
from tensctl.report.palette import BAD, BLUE, DOUBT, PAPER, TEXT
from tensctl.report.plots import Plot, Sheet, draw, log_axis
from tensctl.report.strips import frame, span_of
from tensctl.report.thin import thinned

if TYPE_CHECKING:
    from tensctl.simulation import Run


SHEET = Sheet(height=250.0, top=32.0, left=52.0)
BINS_PER_DECADE = 16


def solve_times(run: Run | None, period: float | None) -> Plot | None:
    """Histogram of solve times (log axis) with median, worst and the control period (s) to keep within."""
    if run is None or not len(run.solve_time):
        return None
    times = np.asarray(run.solve_time)
    times = times[times > 0]
    if not len(times):
        return None
    label = f"Histogram of {len(times)} solve times"
    return draw("solve-time", label, lambda axes: _histogram(axes, times, period), SHEET)


def kkt_residuals(run: Run | None) -> Plot | None:
    """Optimality residual of every solve over time; exact zeros are drawn at the lower edge."""
    if run is None or not np.isfinite(run.kkt).any():
        return None
    plot = draw("kkt", "KKT residual of every solve", lambda axes: _residuals(axes, run), SHEET)
    return replace(plot, span=span_of(run.time))


def _histogram(axes: Axes, times: np.ndarray, period: float | None) -> None:
    low, high = np.log10(times.min()), np.log10(times.max())
    first, last = np.floor(low * BINS_PER_DECADE), np.ceil(high * BINS_PER_DECADE)
    edges = 10 ** (np.arange(first, last + 1.5) / BINS_PER_DECADE)
    counts, _ = np.histogram(times, edges)
    axes.stairs(counts, 1e3 * edges, fill=True, facecolor=BLUE.light, edgecolor=BLUE.light, linewidth=0)
    axes.set_xscale("log")
    right = 1e3 * max(edges[-1], period or 0.0) * 1.25
    axes.set_xlim(1e3 * edges[0] / 1.25, right)
    axes.set_ylim(0, 1.3 * counts.max())
    middle, worst = float(np.median(times)), float(times.max())
    _mark(axes, middle, f"median {seconds(middle)}", TEXT.light, 0)
    _mark(axes, worst, f"worst {seconds(worst)}", DOUBT.light, 1)
    if period is not None:
        _mark(axes, period, f"control period {seconds(period)}", BAD.light, 2)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=12))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_title("Number of solves", loc="left", pad=12)
    axes.set_xlabel("Solve time, ms", loc="right")


def _mark(axes: Axes, time: float, text: str, colour: str, row: int) -> None:
    """A vertical line at a time (s), named beside it on the side that has room."""
    low, high = axes.get_xlim()
    right_half = np.log(1e3 * time / low) > 0.55 * np.log(high / low)
    axes.axvline(1e3 * time, color=colour, linewidth=1.1, dashes=(5, 2.5))
    axes.annotate(
        text,
        (1e3 * time, 1.0),
        (-4 if right_half else 4, -2 - 13 * row),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        ha="right" if right_half else "left",
        va="top",
        color=colour,
        fontsize=9.0,
        bbox={"facecolor": PAPER.light, "edgecolor": "none", "pad": 0.5},
    )


def _residuals(axes: Axes, run: Run) -> None:
    residual = np.asarray(run.kkt)
    positive = residual[residual > 0]
    least = positive.min(initial=1e-16)
    middle = max(float(np.median(residual[np.isfinite(residual)])), least)
    # Dots as strokes of hardly any length with round ends: a quarter of the bytes of markers.
    time, residual = thinned(run.sample_time, residual)
    dots = np.repeat(time[:, None], 3, axis=1) + np.array([0.0, 1e-4 * np.ptp(run.time), np.nan])
    heights = np.repeat(np.maximum(residual, least), 3)
    axes.plot(dots.ravel(), heights, color=BLUE.light, linewidth=2.2, alpha=0.8)
    axes.axhline(middle, color=TEXT.light, linewidth=1.0, dashes=(5, 2.5))
    axes.set_yscale("log")
    log_axis(axes)
    frame(axes, span_of(run.time), "KKT residual")
