"""Error against run time of solvers: one line a solver through its tolerances, for floors kept and floors relaxed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from tensctl.report.numbers import seconds
from tensctl.report.palette import BAD, BLUE, DOUBT, GREEN, MUTED, ORANGE, PURPLE, ROD_LIGHT, Ink
from tensctl.report.plots import DASHES, Plot, Sheet, draw, log_axis
from tensctl.report.written import write_measured

if TYPE_CHECKING:
    from tensctl.accuracy.solver_result import SolverPrecision

SHEET = Sheet(width=760.0, height=330.0, top=32.0, right=150.0)
LOOKS: dict[str, tuple[Ink, str]] = {
    "dual": (BLUE, "o"),
    "primal": (DOUBT, "P"),
    "daqp": (ROD_LIGHT, "X"),
    "piqp": (GREEN, "s"),
    "osqp": (ORANGE, "^"),
    "clarabel": (PURPLE, "D"),
    "cvxpy": (MUTED, "v"),
}
# Errors below this are rounding, and drawn here.
LEAST = 1e-16


def solver_errors(measured: SolverPrecision | None) -> Plot | None:
    """Worst error of the first input against the median time of a solve; None without any answer."""
    if measured is None or not any(np.isfinite(a.worst_error) for a in measured.attempts):
        return None
    label = "Error of the first input against run time of every solver"
    return draw("solvers", label, lambda axes: paint(axes, measured), SHEET)


def write_solvers(measured: SolverPrecision, folder: Path) -> None:
    """Write solvers.json and solvers.svg into a folder, which is made when missing.

    Raises
    ------
    OutputError
        When they cannot be written.
    """
    figure = Figure(figsize=(7.6, 4.2))
    paint(figure.add_axes((0.1, 0.13, 0.68, 0.76)), measured)
    write_measured("solvers", measured.to_dict(), figure, folder)


def paint(axes: Axes, measured: SolverPrecision) -> None:
    """Lines of all solvers, whole where floors are kept and dashed where they give way, and the control period."""
    for name, (ink, marker) in LOOKS.items():
        for floors, dash in (("kept", 0), ("relaxed", 1)):
            own = [a for a in measured.attempts if (a.solver, a.floors) == (name, floors)]
            points = np.array([(a.seconds, max(a.worst_error, LEAST)) for a in own if np.isfinite(a.worst_error)])
            if not points.size:
                continue
            label = name if floors == "kept" else f"{name}, relaxed"
            (line,) = axes.plot(*points.T, color=ink.light, marker=marker, markersize=5, label=label)
            if DASHES[dash][0] is not None:
                line.set_dashes(DASHES[dash])
    axes.axvline(measured.dt, color=BAD.light, linewidth=1.0, dashes=(5, 2.5), label=f"period {seconds(measured.dt)}")
    axes.set_xscale("log")
    axes.set_yscale("log")
    log_axis(axes)
    first, last = axes.get_xlim()
    axes.set_xlim(first / 1.3, last * 1.3)
    axes.xaxis.set_major_locator(LogLocator(numticks=8))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: seconds(value)))
    axes.set_title("Worst error of the first input, over its reach in a period", loc="left", pad=12)
    axes.set_xlabel("Median processor time of a solve", loc="right")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.02), frameon=False, fontsize=9.0, handlelength=2.6)
