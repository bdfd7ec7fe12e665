"""What the C source of a predictive controller holds that is shown sensors: its filter, its target and one model.

estimate (x, d) by the filter of `synthesis.offset_filter`,   target by `synthesis.steady_target`, a problem of one
stage,   then the condensed problem about the target
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.codegen.course import sample_times
from tensctl.codegen.literals import Table
from tensctl.codegen.problem import ProblemTables, problem_tables
from tensctl.codegen.states import shown_inputs
from tensctl.synthesis import OutputMPC
from tensctl.synthesis.lagging import commands_along
from tensctl.synthesis.offset_filter import ABSURD, BACK, PATIENCE
from tensctl.synthesis.steady_target import KEPT


def output_facts(mpc: OutputMPC) -> dict[str, Any]:
    """Filter, target and what is wanted at rest, sample by sample."""
    ny, nx = len(mpc.sensors.labels), len(mpc.linear.states)
    times = sample_times(mpc.wanted, mpc.dt, lags=mpc.linear.lag > 0) + mpc.delay
    target = _target(mpc)
    own, size = shown_inputs(mpc.linear)
    measured = (
        f"{ny} sensor values (m, N): " + ", ".join(mpc.sensors.labels),
        *own,
        "NaN stands for a value that is missing",
    )
    carried = Table("until_E", mpc.carried, "state when the next command begins to act from the disturbances")
    tables = (*target.tables, *_filter_tables(mpc), *_rest_tables(mpc), *_course_tables(mpc, times))
    return {
        "sensors": ny, "measured": measured, "size": ny + size, "lag": mpc.linear.lag, "target": target, "times": times,
        "tables": (*tables, carried) if mpc.delay else tables, "parts": (mpc.piece_at(0.0),), "suffixes": ("",),
        "moves": len(times) > 1, "absurd": ABSURD, "patience": PATIENCE, "back": BACK, "kept": KEPT,
        "sizes": [
            ("STATES", nx, ""), ("SENSORS", ny, "and as many disturbances"), ("ORDER", nx + ny, "of the filter"),
            ("TRACKED", mpc.tracked.size, "sensors whose values are to be reached"),
        ],
    }  # fmt: skip


def _target(mpc: OutputMPC) -> ProblemTables:
    programme = mpc.programme
    return problem_tables(
        "_target", programme.H, programme.from_given, programme.rows, programme.floor_from, 1, patient=True
    )


def _filter_tables(mpc: OutputMPC) -> tuple[Table, ...]:
    model, filters = mpc.model, mpc.filter
    return (
        Table("filter_F", model.sampled.F, "state from the last state"),
        Table("filter_after", model.after, "and from the disturbances"),
        Table("filter_G0", model.sampled.G0, "and from the last inputs"),
        Table("filter_G1", model.sampled.G1, "and from the inputs as they are"),
        Table("filter_H", model.H, "what the sensors show of states and disturbances"),
        Table("filter_D", model.D, "and of the inputs"),
        Table("filter_gain", filters.constant.gain, "estimate from what surprises while every sensor speaks"),
        Table("filter_X", filters.constant.X, "covariance P before a sample while every sensor speaks"),
        Table("filter_W", filters.W, "what noise adds to P in a period"),
        Table("filter_noise", mpc.sensors.noise, "deviation of each sensor's noise"),
        Table("filter_deviation", filters.deviations, "and of what surprises, while every sensor speaks"),
        Table("sensors_rest", mpc.sensors.of(mpc.linear.equilibrium), "what the sensors show at rest"),
    )


def _rest_tables(mpc: OutputMPC) -> tuple[Table, ...]:
    by_input, by_disturbance = mpc.model.rest
    lower, upper = mpc.target_range
    return (
        Table("input_rest", mpc.linear.equilibrium.inputs, "inputs at the equilibrium, m"),
        Table("rest_from_inputs", by_input, "state at rest from the inputs"),
        Table("rest_from_disturbances", by_disturbance, "and from the disturbances"),
        Table("target_lower", lower, "least inputs of a target, deviations from rest, m"),
        Table("target_upper", upper, "largest inputs of a target, deviations from rest, m"),
        Table("tension_from_rest", mpc.problem.tension, "scaled tensions from state and inputs, m"),
        Table("tension_shown", mpc.tension_shown, "and from what sensors of tension are believed to miss, m"),
        Table("margin_rest", mpc.margin_at_rest, "tensions at rest within their limits, over the scale, m"),
    )


def _course_tables(mpc: OutputMPC, times: np.ndarray) -> tuple[Table, ...]:
    """What is wanted, and of a course that moves what its motion adds."""
    path = mpc.wanted
    tracked = np.array([mpc.wanted_at(t) for t in times.tolist()])
    tables = (
        Table("course_inputs", path.inputs_at(times), "total inputs of the reference when each command acts, m"),
        Table("course_tracked", tracked, "what is wanted of the tracked sensors then, deviations from rest"),
    )
    if len(times) == 1:
        return tables
    motion = np.array([mpc.moving_state(t) for t in times.tolist()])
    tension = mpc.problem.scaled(path.tensions_at(times))
    if mpc.linear.lag:
        commands = commands_along(path, times, mpc.linear.lag, mpc.dt)
        tables += (Table("course_commands", commands, "and the commands that bring them about, m"),)
    return (
        *tables,
        Table("course_motion", motion, "state then that the motion of the reference adds"),
        Table("course_tension", tension, "and its tensions, over the scale, m"),
    )
