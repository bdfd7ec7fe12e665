"""What the C source of a predictive controller holds: a problem for each model, limits, and where a step begins."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.codegen.literals import Table
from tensctl.codegen.outputs import output_facts
from tensctl.codegen.problem import problem_tables
from tensctl.codegen.signals import signal_facts
from tensctl.codegen.states import state_facts
from tensctl.synthesis import (
    MPC,
    Condensed,
    OutputMPC,
    bordered,
    constant_rates,
    dual,
    orthogonal,
    primal,
    qp_dual,
    qp_primal,
    relaxed,
)
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.qp import ACCEPT
from tensctl.synthesis.step_record import KEPT

# Limits that are missed by less are kept, m: a tenth of Python's own. With that, a command was 8e-9 m from DAQP's where
# limits nearly follow from each other; with a tenth of this, searches go in circles on rounding.
_FEASIBLE = 0.1 * qp_dual.TOL
# Entries of a primal basis, or half the variables; Python has room for 400. 185 were the most in 3400 steps with 10 and
# 20 stages, 115 of them bounded. A search without room ends where it is. The inverse takes 0.5 MB, not 1.3.
_ROOM = 250
# Constants of the two searches; the others are Python's.
_SEARCH = {
    "feasible": _FEASIBLE, "no_curvature": dual.NO_PIVOT, "few_free": primal.FEW, "fixed": primal.FIXED,
    "fixed_slack": primal.FIXED_SLACK,
    "no_move": primal.NO_MOVE, "drift": primal.DRIFT, "circles": primal.CIRCLES, "at_limit": primal.AT_LIMIT,
    "few_digits": dual.FEW_DIGITS, "nothing_left": orthogonal.NO_PIVOT, "too_dear": orthogonal.TOO_DEAR,
    "fine_work": qp_dual.WORK,
    "no_pivot": bordered.NO_PIVOT, "wrong_push": qp_primal.TOL, "roughly": constant_rates.TOL,
}  # fmt: skip


def predictive(mpc: MPC, max_iterations: int | None) -> dict[str, Any]:
    """Facts of a predictive controller, shown states or sensors."""
    if isinstance(mpc, OutputMPC):
        found, reference = output_facts(mpc), mpc.wanted
    else:
        found, reference = state_facts(mpc), mpc.reference
    wanted = signal_facts(mpc, reference, found["times"], found["size"])
    inputs, variables = mpc.linear.inputs, mpc.horizon * len(mpc.linear.inputs)
    unknowns = variables + mpc.horizon
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
            ("MAX_ITERATIONS", max_iterations or 10 * unknowns, "changes of the active set in a search"),
            ("ROOM", _room(variables, mpc.horizon), "for a primal basis"),
            ("DUAL_ROOM", qp_dual.usual_room(variables), "for a dual one"),
        ],
        "search": _SEARCH, "orthogonal": qp_dual.all_may_act(variables),
        "accept": ACCEPT, "fine": qp_primal.FINE, "astray": qp_primal.ASTRAY,
        "far_off": qp_primal.FAR, "once_more": qp_primal.ONCE_MORE,
        "dearer": relaxed.DEAR / relaxed.PRICE, "keeping": qp_primal.KEEPING,
        "floor_kept": KEPT,
    }  # fmt: skip


def _room(variables: int, stages: int) -> int:
    return min(qp_primal.bounds(variables, stages)[1], max(_ROOM, variables // 2))


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
