"""Constant tables of the condensed MPC problem as its C source holds them.

    minimise z'Hz/2 + f'z,   f = F s,   floors <= T z + S s,   |z_k - z_(k-1)| <= reach,   lower <= z <= upper

s = (state, input deviation) when the command begins to act. H is kept as its lower triangle and as W = L^-1 of
H = L L'; tension rows are block Toeplitz, so their first block column is all of them; bounds and rate rows need no
table.
"""

from __future__ import annotations

import numpy as np

from tensctl.codegen.literals import Table, lower_triangle
from tensctl.errors import OutputError
from tensctl.linear.propagate import stretch
from tensctl.synthesis import MPC, Condensed, OutputMPC
from tensctl.synthesis.qp import QP
from tensctl.synthesis.reference import Hold
from tensctl.synthesis.relaxed import relax

# Rows that differ from the structure that the C source counts on by more than this part of their size are refused.
_SAME = 1e-12


def predictive_tables(mpc: MPC) -> tuple[Table, ...]:
    """Tables of a controller that holds one equilibrium.

    Raises
    ------
    OutputError
        For a controller that estimates or follows a path, or rows of another form.
    """
    if isinstance(mpc, OutputMPC):
        raise OutputError("this MPC estimates from its sensors, and the C source does not; export a tc.MPC.")
    if mpc.signal is not None:
        raise OutputError("this MPC follows a signal, and the C source holds one equilibrium; export one without.")
    if not isinstance(mpc.reference, Hold):
        raise OutputError(
            "this MPC follows a path of shapes over time, and the C source holds one equilibrium; "
            "export tc.MPC(tc.linearize(dynamics, path.target), ...)."
        )
    problem, members = mpc.problem, mpc.linear.dynamics.members
    W = np.linalg.inv(np.linalg.cholesky(problem.H))
    rest = mpc.reference.equilibrium
    lower, upper = mpc.hard.range
    margin = problem.margin(rest.tensions, mpc.tension_min)
    reach = mpc.rate_max * mpc.dt / members.gearing.largest
    return (
        Table("H_lower", lower_triangle(problem.H), "H, lower triangle row by row, J/m^2 s"),
        Table("W_lower", lower_triangle(W), "W = L^-1, H = L L', lower triangle row by row"),
        Table("optimum_from_start", -W.T @ (W @ problem.from_state), "z without limits from the start s"),
        Table("f_from_start", problem.from_state, "f from the start s"),
        Table("tension_from_start", problem.tension_from_state, "scaled tension deviations from the start s, m"),
        Table("tension_block", _first_column(problem), "first block column of the tension rows"),
        Table("row_size", np.concatenate([_sizes(W), _sizes(W @ problem.rows.T)]), "size of W times each row"),
        Table("tension_margin", margin, "tension at rest within its limit, over the scale, m"),
        Table("tension_scale", problem.tension_scale, "N/m"),
        Table("reach", reach, "largest change of each input in a period, m"),
        Table("input_rest", rest.inputs, "inputs at the equilibrium, m"),
        Table("input_lower", lower, "least total inputs, m"),
        Table("input_upper", upper, "largest total inputs, m"),
        *_until_it_acts(mpc),
    )


def _until_it_acts(mpc: MPC) -> tuple[Table, ...]:
    """The model from a sample until the command computed at it begins to act; nothing without delay."""
    if not mpc.delay:
        return ()
    way = stretch(mpc.linear, mpc.delay)
    return (
        Table("until_F", way.F, "state when the next command begins to act from the state at the sample"),
        Table("until_G0", way.G0, "and from the inputs at the sample"),
        Table("until_G1", way.G1, "and from the command that is reached by then"),
    )


def relaxation(problem: Condensed) -> tuple[float, float]:
    """Curvature of a stage's slack and its price over the steepest cost in sight, as `synthesis.relaxed` has them."""
    n, rows = problem.H.shape[0], problem.rows.shape[0]
    steep = np.zeros(n)
    steep[0] = 1.0
    asked = relax(QP(problem.H, steep, problem.rows, np.zeros(n + rows), np.zeros(n + rows)), problem.horizon)
    return float(asked.H[-1, -1]), float(asked.f[-1])


def _sizes(columns: np.ndarray) -> np.ndarray:
    return np.linalg.norm(columns, axis=0)


def _first_column(problem: Condensed) -> np.ndarray:
    """The tension rows' first block column, (N nT, nu)."""
    N, nu, nT = problem.horizon, problem.B.shape[1], len(problem.tendons)
    first = problem.rows[: N * nT, :nu]
    whole = np.zeros((N * nT, N * nu))
    for k in range(N):
        whole[k * nT :, k * nu : (k + 1) * nu] = first[: (N - k) * nT]
    rates = np.kron(np.eye(N) - np.eye(N, k=-1), np.eye(nu))
    misfit = np.abs(problem.rows - np.vstack([whole, rates])).max(initial=0.0)
    if not misfit <= _SAME * np.abs(whole).max(initial=1.0):
        raise OutputError(
            f"the rows of this MPC differ by {misfit:.1e} from tension rows of one model at every stage and rate rows, "
            "which the C source counts on."
        )
    return first
