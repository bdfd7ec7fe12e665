"""Constant tables of a condensed problem as its C source holds them.

    minimise z'Hz/2 + f'z,   f = F g,   floors <= T z + S g,   |z_k - z_(k-1)| <= reach,   lower <= z <= upper

g is what is given: state and inputs when the command begins to act, and what is wanted. H is kept as its lower
triangle and as W = L^-1 of H = L L'; tension rows are block Toeplitz, so their first block column is all of them;
bounds and rate rows need no table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.codegen.literals import Table, lower_triangle, number
from tensctl.errors import OutputError
from tensctl.synthesis.qp import QP
from tensctl.synthesis.relaxed import relax

# Rows that differ from the structure that the C source counts on by more than this part of their size are refused.
_SAME = 1e-12


@dataclass(frozen=True, eq=False)
class ProblemTables:
    """Tables of a problem, and the C initialiser of its `struct problem`."""

    initialiser: str
    tables: tuple[Table, ...]


def problem_tables(
    suffix: str, H: np.ndarray, f_from: np.ndarray, rows: np.ndarray, tension_from: np.ndarray, stages: int
) -> ProblemTables:
    """Tables of a problem.

    Parameters
    ----------
    suffix : str
        Ends their names.
    H : (N nu, N nu)
    f_from : (N nu, g)
        F.
    rows : (N nT + N nu, N nu)
        Tension rows, then rate rows.
    tension_from : (N nT, s)
        S, of the first s of what is given.
    stages : int
        N.

    Raises
    ------
    OutputError
        Rows of another form.
    """
    W = np.linalg.inv(np.linalg.cholesky(H))
    curvature, price = _relaxation(H, rows, stages)
    tables = (
        Table(f"H{suffix}", lower_triangle(H), "H, lower triangle row by row"),
        Table(f"W{suffix}", lower_triangle(W), "W = L^-1, H = L L', lower triangle row by row"),
        Table(f"f_from{suffix}", f_from, "f from what is given"),
        Table(f"optimum_from{suffix}", -W.T @ (W @ f_from), "z without limits from what is given"),
        Table(f"tension_from{suffix}", tension_from, "scaled tension deviations from what is given, m"),
        Table(f"tension_block{suffix}", _first_column(rows, stages), "first block column of the tension rows"),
        Table(f"row_size{suffix}", np.linalg.norm(np.hstack([W, W @ rows.T]), axis=0), "size of W times each row"),
    )
    numbers = [str(stages), str(f_from.shape[1]), str(tension_from.shape[1])]
    numbers += [number(value) for value in (curvature, price, np.abs(H.diagonal()).max())]
    return ProblemTables("{" + ", ".join([*numbers, *(table.name for table in tables)]) + "}", tables)


def _relaxation(H: np.ndarray, rows: np.ndarray, stages: int) -> tuple[float, float]:
    """Curvature of a stage's slack and its price over the steepest cost in sight, as `synthesis.relaxed` has them."""
    n, limited = len(H), len(H) + len(rows)
    steep = np.zeros(n)
    steep[0] = 1.0
    asked = relax(QP(H, steep, rows, np.zeros(limited), np.zeros(limited)), stages)
    return float(asked.H[-1, -1]), float(asked.f[-1])


def _first_column(rows: np.ndarray, stages: int) -> np.ndarray:
    """The tension rows' first block column, (N nT, nu)."""
    variables = rows.shape[1]
    nu, nT = variables // stages, (len(rows) - variables) // stages
    first = rows[: stages * nT, :nu]
    whole = np.zeros((stages * nT, variables))
    for k in range(stages):
        whole[k * nT :, k * nu : (k + 1) * nu] = first[: (stages - k) * nT]
    rates = np.kron(np.eye(stages) - np.eye(stages, k=-1), np.eye(nu))
    misfit = np.abs(rows - np.vstack([whole, rates])).max(initial=0.0)
    if not misfit <= _SAME * np.abs(whole).max(initial=1.0):
        raise OutputError(
            f"the rows of this MPC differ by {misfit:.1e} from tension rows of one model at every stage and rate rows, "
            "which the C source counts on."
        )
    return first
