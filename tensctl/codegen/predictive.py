"""What the C source of a predictive controller holds: a problem for each model, limits, and where a step begins."""

from __future__ import annotations

from typing import Any

from tensctl.codegen.literals import Table
from tensctl.codegen.outputs import output_facts
from tensctl.codegen.problem import problem_tables
from tensctl.codegen.states import state_facts
from tensctl.errors import OutputError
from tensctl.synthesis import MPC, OutputMPC
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.reference import Hold


def predictive(mpc: MPC, max_iterations: int | None) -> dict[str, Any]:
    """Facts of a predictive controller, shown states or sensors.

    Raises
    ------
    OutputError
        For a controller that follows what has no table.
    """
    if mpc.signal is not None:
        raise OutputError("this MPC follows a signal, and the C source holds one equilibrium; export one without.")
    if not isinstance(mpc.wanted if isinstance(mpc, OutputMPC) else mpc.reference, Hold):
        raise OutputError(
            "this MPC follows a path of shapes over time, and the C source holds one equilibrium; "
            "export tc.MPC(tc.linearize(dynamics, path.target), ...)."
        )
    found = output_facts(mpc) if isinstance(mpc, OutputMPC) else state_facts(mpc)
    inputs, unknowns = mpc.linear.inputs, mpc.horizon * (len(mpc.linear.inputs) + 1)
    pairs: list[tuple[str, Piece]] = list(zip(found["suffixes"], found["parts"], strict=True))
    problems = [
        problem_tables(suffix, p.H, p.from_state, p.rows, p.tension_from_state, mpc.horizon)
        for suffix, p in ((suffix, part.problem) for suffix, part in pairs)
    ]
    tables = [table for problem in problems for table in problem.tables]
    for suffix, part in pairs:
        tables += _until_it_acts(part, suffix) if mpc.delay else ()
    return found | {
        "kind": "mpc", "dt": mpc.dt, "delay": mpc.delay, "inputs": inputs, "problems": problems,
        "tables": (*tables, *found["tables"], *_limits(mpc)),
        "sizes": [
            *found["sizes"],
            ("HORIZON", mpc.horizon, "stages"),
            ("TENSIONS", len(mpc.problem.tendons), "tension rows of a stage"),
            ("GIVEN", len(mpc.linear.states) + len(inputs), "state and inputs when a command begins to act"),
            ("COURSE", found["samples"], "samples after which the reference rests"),
            ("LAST_SAMPLE", found["samples"], "after which all is constant"),
            ("MAX_ITERATIONS", max_iterations or 10 * unknowns, "changes of the active set in a step"),
        ],
    }  # fmt: skip


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
