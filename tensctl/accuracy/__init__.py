"""How far to trust it: error against run time for the user's own scene, of integrators and of solvers."""

from tensctl.accuracy.result import Attempt, WorkPrecision
from tensctl.accuracy.solver_result import SolverAttempt, SolverPrecision
from tensctl.accuracy.solvers import solver_precision
from tensctl.accuracy.work_precision import work_precision

__all__ = ["Attempt", "SolverAttempt", "SolverPrecision", "WorkPrecision", "solver_precision", "work_precision"]
