"""What the C source of a predictive controller holds that is shown states: charts, and what it follows."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.codegen.chart import chart_tables
from tensctl.codegen.course import Course, course_of
from tensctl.codegen.literals import Table
from tensctl.errors import OutputError
from tensctl.linear import LinearModel
from tensctl.synthesis import MPC
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.seen import FITS


def state_facts(mpc: MPC) -> dict[str, Any]:
    """Charts of all models along the reference, and the reference, sample by sample."""
    course = course_of(mpc.reference, mpc.dt, mpc.delay, mpc.piece_at)
    pairs = list(zip(course.parts, course.suffixes, strict=True))
    rests = [Table(f"input_rest{s}", p.linear.equilibrium.inputs, "inputs at the equilibrium, m") for p, s in pairs]
    charts = tuple(chart_tables(part.linear, suffix) for part, suffix in pairs)
    return shown_states(charts[0].nodes, mpc.linear) | {
        "charts": charts,
        "parts": course.parts,
        "suffixes": course.suffixes,
        "fits": FITS,
        "tables": (*(rests if mpc.delay or mpc.linear.lag else ()), *course.tables, _margins(mpc, course)),
        "input_rests": [table.name for table in rests],
        "times": course.times,
        "sizes": [],
    }


def shown_states(nodes: int, linear: LinearModel, *, commands: bool = True) -> dict[str, Any]:
    """What a controller is shown that knows the state; with lag also the commands, where it needs them."""
    own, size = shown_inputs(linear, commands=commands)
    measured = (
        f"{3 * nodes} node coordinates (m), node by node",
        f"{3 * nodes} node velocities (m/s), in the same order",
        *own,
    )
    return {"measured": measured, "size": 6 * nodes + size, "lag": linear.lag}


def shown_inputs(linear: LinearModel, *, commands: bool = True) -> tuple[tuple[str, ...], int]:
    """What is said of the inputs that a controller is shown, and how many numbers they are."""
    nu = len(linear.inputs)
    said = (f"{nu} inputs u as they are now (m)",)
    if linear.lag and commands:
        said += (f"{nu} commands, what was asked of these inputs until now (m)",)
    return said, nu * len(said)


def _margins(mpc: MPC, course: Course[Piece]) -> Table:
    tendons = [part.problem.tendons for part in course.parts]
    if any(not np.array_equal(tendons[0], others) for others in tendons):
        raise OutputError(
            "tendons are slack in some planned shapes of this path and taut in others, and the C source has one set of "
            "tension rows; plan with a larger tension_min."
        )
    margin = mpc.problem.margin(mpc.reference.tensions_at(course.times), mpc.tension_min)
    return Table("course_margin", margin, "tensions of the reference within their limits, over the scale, m")
