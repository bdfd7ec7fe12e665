"""Error against run time: one line a method, in the report or as a file of its own beside the same numbers as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from tensctl.report.numbers import plain
from tensctl.report.palette import BLUE, GREEN, MUTED, ORANGE, PURPLE, TEXT, Ink
from tensctl.report.plots import DASHES, Plot, Sheet, draw, log_axis
from tensctl.report.written import write_measured

if TYPE_CHECKING:
    from tensctl.accuracy import WorkPrecision

SHEET = Sheet(width=760.0, height=330.0, top=32.0, right=118.0)
# Ink, dash and marker of each method: a family has one ink, and its members differ in dash and marker.
LOOKS: dict[str, tuple[Ink, int, str]] = {
    "splitting6": (BLUE, 0, "o"),
    "splitting4": (BLUE, 1, "s"),
    "splitting2": (BLUE, 2, "^"),
    "dopri5": (ORANGE, 0, "o"),
    "rosenbrock": (BLUE, 0, "D"),
    "cvodes": (GREEN, 1, "s"),
    "idas": (PURPLE, 2, "^"),
}


def errors(measured: WorkPrecision | None) -> Plot | None:
    """Error against run time of every attempt that has a result; None without any, or when nothing moves."""
    if measured is None or measured.still or all(a.failure for a in measured.attempts):
        return None
    return draw("accuracy", "Error against run time of every integrator", lambda axes: _paint(axes, measured), SHEET)


def write_accuracy(measured: WorkPrecision, folder: Path) -> None:
    """Write accuracy.json and accuracy.svg into a folder, which is made when missing.

    Raises
    ------
    OutputError
        When they cannot be written.
    """
    figure = Figure(figsize=(7.6, 4.2))
    _paint(figure.add_axes((0.1, 0.13, 0.72, 0.76)), measured)
    write_measured("accuracy", measured.to_dict(), figure, folder)


def _paint(axes: Axes, measured: WorkPrecision) -> None:
    """What the reference cannot tell apart stands on what its own error may be, the dashed line."""
    least = max(measured.reference_error, 1e-16)
    done = [a for a in measured.attempts if not a.failure]
    for method in dict.fromkeys(a.method for a in done):
        ink, dash, marker = LOOKS[method]
        points = np.array([(a.seconds, max(a.error, least)) for a in done if a.method == method])
        (line,) = axes.plot(*points.T, color=ink.light, marker=marker, markersize=5, label=method)
        if DASHES[dash][0] is not None:
            line.set_dashes(DASHES[dash])
    axes.axhline(least, color=MUTED.light, linewidth=1.0, dashes=(5, 2.5), label="reference")
    best = measured.advised()
    if best is not None:
        place = (best.seconds, max(best.error, least))
        axes.plot(*place, "o", markersize=12, markerfacecolor="none", markeredgecolor=TEXT.light, label="to use")
    axes.set_xscale("log")
    axes.set_yscale("log")
    _frame(axes, measured.t_end)


def _frame(axes: Axes, t_end: float) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(low / 2, high * 2)
    log_axis(axes)
    first, last = axes.get_xlim()
    axes.set_xlim(first / 1.3, last * 1.3)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0,) if last > 100 * first else (1.0, 2.0, 5.0), numticks=12))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(_duration))
    axes.set_title("Largest distance of a node to the reference, m", loc="left", pad=12)
    axes.set_xlabel(f"Run time for {plain(t_end)} s of motion", loc="right")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02), frameon=False, fontsize=9.5, handlelength=2.6)


def _duration(value: float, _position: int | None) -> str:
    scale, unit = next(((s, u) for s, u in ((1.0, "s"), (1e3, "ms")) if value * s > 0.99), (1e6, "µs"))
    return f"{plain(value * scale)} {unit}"
