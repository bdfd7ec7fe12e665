"""Solvers by name, each in its own file and imported when first asked for."""

from __future__ import annotations

import numpy as np

from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.qp import QP, Solver


def new_solver(name: str, qp: QP) -> Solver:
    """Set up the solver `daqp` or `osqp` for a problem; f and bounds may change afterwards."""
    if name == "daqp":
        from tensctl.synthesis.qp_daqp import DaqpSolver

        return DaqpSolver(qp)
    from tensctl.synthesis.qp_osqp import OsqpSolver

    return OsqpSolver(qp)


def blank(problem: Condensed) -> QP:
    """The problem at rest with room on every side: what a solver factors before the first step."""
    room = np.ones(problem.rows.shape[0] + problem.rows.shape[1])
    return QP(problem.H, np.zeros(problem.rows.shape[1]), problem.rows, -room, room)
