"""What the C source of linear feedback holds: gains and what they are about, or the matrices of an estimator."""

from __future__ import annotations

from typing import Any

from tensctl.codegen.chart import chart_tables
from tensctl.codegen.course import course_of
from tensctl.codegen.dense import dense_estimator, dense_gain
from tensctl.codegen.literals import Table
from tensctl.codegen.states import shown_states
from tensctl.errors import OutputError
from tensctl.linear import LinearModel
from tensctl.synthesis import LQG, LQR, HarmonicLQG, HarmonicLQR, HarmonicSampledLQR, SampledLQR, ScheduledLQR
from tensctl.synthesis.reference import Hold


def lqr_facts(asked: LQR | SampledLQR | ScheduledLQR | HarmonicLQR | HarmonicSampledLQR) -> dict[str, Any]:
    """Facts of state feedback about an equilibrium, or scheduled along a path.

    Raises
    ------
    OutputError
        Where some designs along the path see inputs and others do not, or a harmonic one is too large.
    """
    design = dense_gain(asked) if isinstance(asked, HarmonicLQR | HarmonicSampledLQR) else asked
    if isinstance(design, ScheduledLQR):
        course = course_of(design.path, design.dt, 0.0, design.at)
    else:
        course = course_of(Hold(design.linear.equilibrium), design.dt, 0.0, lambda t: design)
    pairs = list(zip(course.parts, course.suffixes, strict=True))
    gains = [Table(f"K{s}", part.K, "gain: change of the inputs, m, from states (and inputs)") for part, s in pairs]
    charts = tuple(chart_tables(part.linear, suffix) for part, suffix in pairs)
    sees_inputs = course.parts[0].sees_inputs
    if any(part.sees_inputs != sees_inputs for part in course.parts):
        raise OutputError("designs along this path are sampled in part; give scheduled_lqr one kind of design.")
    linear = course.parts[0].linear
    states, inputs = len(linear.states), linear.inputs
    rests = [Table(f"input_rest{s}", p.linear.equilibrium.inputs, "inputs at the equilibrium, m") for p, s in pairs]
    return shown_states(charts[0].nodes, linear, commands=sees_inputs) | {
        "kind": "lqr", "dt": design.dt, "charts": charts, "gains": [gain.name for gain in gains], "inputs": inputs,
        "tables": (*gains, *course.tables, *(rests if linear.lag else ()), *_limits(linear)),
        "input_rests": [table.name for table in rests], "sees_inputs": sees_inputs,
        "sizes": [
            ("GAINED", states + sees_inputs * len(inputs), "states, and inputs where the gain sees them"),
            ("COURSE", len(course.times), "samples after which the reference rests"),
            ("LAST_SAMPLE", len(course.times), "after which all is constant"),
        ],
    }  # fmt: skip


def lqg_facts(asked: LQG | HarmonicLQG) -> dict[str, Any]:
    """Facts of LQG in discrete time.

    Raises
    ------
    OutputError
        For a design in continuous time, or a harmonic one that is too large.
    """
    design = dense_estimator(asked)
    e, nu = design.estimator, len(design.linear.inputs)
    ny = len(design.sensors.labels)
    tables = (
        Table("Phi", e.Phi, "estimate from the last estimate"),
        Table("seen", e.seen, "estimate from what the sensors show"),
        Table("before", e.before, "estimate from the last inputs"),
        Table("now", e.now, "estimate from the inputs as they are"),
        Table("C", e.C, "change of the inputs from the estimate"),
        Table("direct", e.direct, "change of the inputs from the inputs as they are"),
        Table("D", design.D, "what the sensors show of the inputs"),
        Table("sensors_rest", design.sensors.of(design.linear.equilibrium), "what the sensors show at rest"),
        Table("input_rest", design.linear.equilibrium.inputs, "inputs at the equilibrium, m"),
        *_limits(design.linear),
    )
    measured = (
        f"{ny} sensor values (m, N): " + ", ".join(design.sensors.labels),
        f"{nu} commands, what was asked of the inputs until now (m)"
        if design.linear.lag
        else f"{nu} inputs u as they are now (m)",
    )
    return {
        "kind": "lqg", "dt": design.dt, "tables": tables, "inputs": design.linear.inputs, "measured": measured,
        "size": ny + nu, "sensors": ny,
        "sizes": [("SENSORS", ny, ""), ("ORDER", e.order, "states of the estimator")],
    }  # fmt: skip


def _limits(linear: LinearModel) -> tuple[Table, ...]:
    lower, upper = linear.dynamics.members.input_bounds
    return Table("input_lower", lower, "least total inputs, m"), Table("input_upper", upper, "largest total inputs, m")
