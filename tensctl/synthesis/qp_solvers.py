"""Solvers by name, each in its own file and imported when first asked for; and in which order they are asked."""

from __future__ import annotations

from typing import Any

import numpy as np

from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.qp import QP, Solver
from tensctl.synthesis.relaxed import curvature, relax

SOLVERS = ("dual", "primal", "daqp", "osqp", "piqp", "clarabel")
# Up to so many variables an active set is the faster one even with all limits acting.
_FEW = 100
# From this ratio of tendons' stiffness on answers of an interior point are refused where floors give way: none of 6 at
# 1e5, with KKT residuals to 3e-11, 1 at 1e6, and all at 1e9, while those of the active sets stay below 1e-12.
_STIFF = 1e5
# Multiplications of a primal search that is to end at the optimum; with some 400 rates free it takes 4e8.
_WHOLE = 1e10
# Up to so many, what forces on limits move is worth its room: 7 MB for the (3,1) shell with 20 stages, 300 MB for the
# (8,4) shell with 10.
_MANY = 4000


def first_choice(stages: int, inputs: int, states: int, spread: float) -> tuple[str, str]:
    """The solver that "auto" asks first, and why.

    Without acting limits an active set takes one product with all rows; an interior point factors every stage some 15
    times: by that count it comes first only for a few states over a very long horizon, and never where tendons differ
    so much in stiffness (`spread`, the largest over the least) that it fails.
    """
    dense, staged = 4 * (stages * inputs) ** 2, 15 * 6 * stages * (states + inputs) ** 3
    own = "dual" if stages * inputs <= _MANY else "daqp"
    name = own if dense <= staged or spread > _STIFF else "piqp"
    after = "after every active set, since it fails there" if spread > _STIFF else "after the primal active set"
    at_rest, inside = (_plain(count / 1e6) for count in (dense, staged))
    return (
        name,
        f"{at_rest} million operations in an active set at rest, {inside} in an interior point; the "
        f"stiffest tendon is {spread:.2g} times the softest: where floors give way an interior point is asked {after}",
    )


def _plain(x: float) -> str:
    """Two digits that tell, without an exponent."""
    return f"{float(f'{x:.2g}'):,.10g}"


def order_of(first: str, variables: int, spread: float) -> tuple[tuple[str, bool], ...]:
    """Who is asked in turn, and whether with floors that may give way.

    A dual active set that gives up early hands over to the primal one, whose floors give way only where they have to;
    an interior point is asked after all active sets where tendons differ much in stiffness.
    """
    hard = dict.fromkeys((first, "dual" if variables <= _MANY else "daqp"))
    then = ("daqp", "piqp") if spread > _STIFF else ("piqp", "daqp")
    patient = ("primal", *then, "osqp") if variables > _FEW else ("daqp", "primal", "piqp", "osqp")
    soft = dict.fromkeys(patient if first in ("dual", "daqp") else (first, *patient))
    return (*((name, False) for name in hard), *((name, True) for name in soft))


def quick_ones(first: str) -> tuple[tuple[str, bool], ...]:
    """Those that nearly all steps end with; no control step should wait for their set-up.

    Whoever answers with floors that give way, the primal one is asked whether they have to.
    """
    return ((first, False), ("primal", True))


def new_solver(name: str, problem: Condensed, *, soft: bool, tol: float | None = None) -> Solver:
    """Set up a solver for a problem at rest, its floors with slack or without; f and bounds may change afterwards.

    Parameters
    ----------
    tol : float, optional
        In the solver's own measure, and without a bound on the active set's iterations; as a controller asks the
        solver by default.
    """
    asked: dict[str, Any] = {} if tol is None else {"tol": tol}
    if name == "dual":
        from tensctl.synthesis.qp_dual import DualSolver

        return DualSolver(problem, **(asked | {"room": problem.H.shape[0]} if asked else {}))
    if name == "primal":
        from tensctl.synthesis.qp_primal import PrimalSolver

        whole = {"work": _WHOLE} if asked or not soft else {}  # who asks for it first wants the optimum
        return PrimalSolver(problem.H, problem.rows, problem.horizon, soft=soft, **asked, **whole)
    rest = relax(_blank(problem), problem.horizon) if soft else _blank(problem)
    if name in ("piqp", "clarabel"):
        from tensctl.synthesis.qp_stages import Stages

        stages = Stages(problem, curvature(problem.H) if soft else None)
        if name == "piqp":
            from tensctl.synthesis.qp_piqp import PiqpSolver

            return PiqpSolver(stages, rest.H, **asked)
        from tensctl.synthesis.qp_clarabel import ClarabelSolver

        return ClarabelSolver(stages, **asked)
    if name == "daqp":
        from tensctl.synthesis.qp_daqp import QUICK, DaqpSolver

        return DaqpSolver(rest, **asked) if soft or asked else DaqpSolver(rest, QUICK)
    from tensctl.synthesis.qp_osqp import OsqpSolver

    return OsqpSolver(rest, **asked)


def _blank(problem: Condensed) -> QP:
    """The problem at rest with room on every side: what a solver factors before the first step."""
    room = np.ones(problem.rows.shape[0] + problem.rows.shape[1])
    return QP(problem.H, np.zeros(problem.rows.shape[1]), problem.rows, -room, room)
