"""What the C source of a predictive controller holds: a problem for each model, limits, and where a step begins."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.codegen.literals import Table
from tensctl.codegen.outputs import output_facts
from tensctl.codegen.problem import problem_tables
from tensctl.codegen.signals import signal_facts
from tensctl.codegen.states import state_facts
from tensctl.synthesis import MPC, Condensed, OutputMPC
from tensctl.synthesis.piece import Piece


def predictive(mpc: MPC, max_iterations: int | None) -> dict[str, Any]:
    """Facts of a predictive controller, shown states or sensors."""
    if isinstance(mpc, OutputMPC):
        found, reference = output_facts(mpc), mpc.wanted
    else:
        found, reference = state_facts(mpc), mpc.reference
    wanted = signal_facts(mpc, reference, found["times"], found["size"])
    inputs, unknowns = mpc.linear.inputs, mpc.horizon * (len(mpc.linear.inputs) + 1)
    pairs: list[tuple[str, Piece]] = list(zip(found["suffixes"], found["parts"], strict=True))
    problems = [
        problem_tables(suffix, p.H, _from_given(p), p.rows, p.tension_from_state, mpc.horizon)
        for suffix, p in ((suffix, part.problem) for suffix, part in pairs)
    ]
    tables = [table for problem in problems for table in problem.tables]
    for suffix, part in pairs:
        tables += _until_it_acts(part, suffix) if mpc.delay else ()
    samples = len(found["times"])
    return found | wanted | {
        "kind": "mpc", "dt": mpc.dt, "delay": mpc.delay, "inputs": inputs, "problems": problems,
        "size": found["size"] + wanted["told"],
        "measured": found["measured"] + ((wanted["says"],) if wanted["told"] else ()),
        "tables": (*tables, *found["tables"], *wanted["tables"], *_limits(mpc)),
        "sizes": [
            *found["sizes"],
            *wanted["sizes"],
            ("HORIZON", mpc.horizon, "stages"),
            ("TENSIONS", len(mpc.problem.tendons), "tension rows of a stage"),
            ("GIVEN", len(mpc.linear.states) + len(inputs) + wanted["wanted"], "state, inputs and what is wanted"),
            ("COURSE", samples, "samples after which the reference rests"),
            ("LAST_SAMPLE", max(samples, wanted["last"]), "after which all is constant"),
            ("MAX_ITERATIONS", max_iterations or 10 * unknowns, "changes of the active set in a step"),
        ],
    }  # fmt: skip


def _from_given(problem: Condensed) -> np.ndarray:
    """F of f = F g: state and inputs, then what is wanted at every stage."""
    pulled = () if problem.following is None else (problem.following.plan,)
    return np.hstack([problem.from_state, *pulled])


def _limits(mpc: MPC) -> tuple[Table, ...]:
    return (
        Table("tension_scale", mpc.problem.tension_scale, "N/m"),
        Table("reach", mpc.hard.reach, "largest change of each input in a period, m"),
        Table("input_lower", mpc.hard.lower, "least total inputs, m"),
        Table("input_upper", mpc.hard.upper, "largest total inputs, m"),
    )


def _until_it_acts(part: Piece, suffix: str) -> tuple[Table, ...]:
    """The model from a sample until the command computed at it begins to act."""
    way = part.until_it_acts
    return (
        Table(f"until_F{suffix}", way.F, "state when the next command begins to act from the state at the sample"),
        Table(f"until_G0{suffix}", way.G0, "and from the inputs at the sample"),
        Table(f"until_G1{suffix}", way.G1, "and from the command that is reached by then"),
    )
