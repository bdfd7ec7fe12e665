"""Every figure of one case, drawn; those that the case has no data for are None."""

from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from tensctl.report import (
    plot_accuracy,
    plot_demand,
    plot_modes,
    plot_path,
    plot_poles,
    plot_sanity,
    plot_solver,
    plot_solver_accuracy,
    plot_time,
)
from tensctl.report.animation import Motion
from tensctl.report.case import Case
from tensctl.report.colourbar import colour_bar
from tensctl.report.grounded import beyond_scale, tension_scale
from tensctl.report.plots import Plot
from tensctl.report.shapes import View, draw_views

START = 1e-6  # m; a run that starts farther from rest than this is shown from its own start
FARTHER = 1.25  # a moment at which a path is so many times farther from the start than in the end is shown too


@dataclass(frozen=True)
class Figures:
    """Figures by what they show; the same names are used by the templates."""

    colours: Markup
    beyond: str
    still: Markup
    shapes: tuple[Markup, ...]
    lengths: Plot | None
    tensions: Plot | None
    rest_lengths: Plot | None
    inputs: Plot | None
    rates: Plot | None
    shape_error: Plot | None
    modes: Plot | None
    poles: Plot | None
    lqg_poles: Plot | None
    solve_times: Plot | None
    kkt: Plot | None
    force: Plot | None
    speed: Plot | None
    power: Plot | None
    wanted: tuple[Plot, ...]
    plane: Plot | None
    margins: tuple[Plot, ...]
    clearances: Plot | None
    compressions: Plot | None
    slack: Plot | None
    accuracy: Plot | None
    solvers: Plot | None


def draw_figures(case: Case, motion: Motion) -> Figures:
    """Draw all of them."""
    tension_max = tension_scale(case.structure, motion.tensions)
    floor = None if case.limits is None else case.limits.tension_min
    still = View("", motion.nodes[0], motion.tensions[0] if motion.source != "structure" else None)
    return Figures(
        colours=colour_bar("bar", tension_max, floor),
        beyond=beyond_scale(case.structure, motion.tensions),
        still=draw_views(case.structure, (still,), tension_max)[0],
        shapes=draw_views(case.structure, shape_views(case, motion), tension_max),
        lengths=plot_time.lengths(case),
        tensions=plot_time.tensions(case),
        rest_lengths=plot_time.rest_lengths(case),
        inputs=plot_time.inputs(case),
        rates=plot_time.rates(case),
        shape_error=plot_time.shape_error(case),
        modes=plot_modes.frequencies(case.linear),
        poles=plot_poles.poles(case.lqr, case.linear),
        lqg_poles=plot_poles.poles(case.lqg, case.linear, "LQG"),
        solve_times=plot_solver.solve_times(case.run, None if case.mpc_check is None else case.mpc_check.dt),
        kkt=plot_solver.kkt_residuals(case.run),
        force=plot_demand.force(case),
        speed=plot_demand.speed(case),
        power=plot_demand.power(case),
        wanted=plot_path.wanted(case),
        plane=plot_path.plane(case),
        margins=plot_path.margins(case),
        clearances=plot_sanity.clearances(case),
        compressions=plot_sanity.compressions(case),
        slack=plot_sanity.slack(case),
        accuracy=plot_accuracy.errors(case.accuracy),
        solvers=plot_solver_accuracy.solver_errors(case.solvers),
    )


def shape_views(case: Case, motion: Motion) -> tuple[View, ...]:
    """At rest or where the run starts, and at the end of the run or path with the first as a shadow behind it.

    A path that comes back is also shown where it is farthest from its start.
    """
    rest, path, height = case.equilibrium, case.path, case.height
    if rest is None:
        return ()
    tall = None if height is None else height.before
    before = View("Before, at rest", rest.nodes, rest.tensions, tall)
    if motion.source == "run" and not np.allclose(motion.nodes[0], rest.nodes, rtol=0, atol=START):
        before = View("At the start", motion.nodes[0], motion.tensions[0], tall)
    wanted = None if path is None else path.target_nodes
    after = None if height is None else height.after
    title = {"run": f"After {motion.times[-1]:.4g} s", "path": "After, as planned"}.get(motion.source)
    if title is None:
        return (before,)
    last = View(title, motion.nodes[-1], motion.tensions[-1], after, shadow=before.nodes, wanted=wanted)
    return (before, last) if path is None else (before, *_farthest(motion, before.nodes), last)


def _farthest(motion: Motion, start: np.ndarray) -> tuple[View, ...]:
    """The moment at which a node is farthest from where it started, when that is well beyond where it ends."""
    moved = np.linalg.norm(motion.nodes - start, axis=2).max(axis=1)
    k = int(moved.argmax())
    if moved[k] < FARTHER * moved[-1] or moved[k] < START:
        return ()
    title = f"At {motion.times[k]:.4g} s, farthest from the start"
    return (View(title, motion.nodes[k], motion.tensions[k], shadow=start),)
