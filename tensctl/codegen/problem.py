"""Constant tables of a condensed problem as its C source holds them, in rates w, z_k = z_(k-1) + w_k.

    minimise w'G w/2 + g'w,   g = F x,   floors <= M w + S x,   |w_k| <= reach,   lower <= z <= upper

x is what is given: state and inputs when the command begins to act, and what is wanted. M is block Toeplitz, so its
first block column is all of it, kept by rows and by rates. B = (1, M) G^-1 (1, M)', what a force on a limit moves, is
kept as its lower triangle; bounds need no table. Where rates are constant in parts of the horizon, a beginning for
bounded searches (`synthesis.constant_rates`), tensions move by differences of the column's running sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla

from tensctl.codegen.literals import Table, lower_triangle, number
from tensctl.errors import OutputError
from tensctl.synthesis import bordered, dual, qp_dual, qp_primal
from tensctl.synthesis.constant_rates import ConstantRates
from tensctl.synthesis.qp import QP
from tensctl.synthesis.relaxed import relax

# Rows that differ from the structure that the C source counts on by more than this part of their size are refused.
_SAME = 1e-12


@dataclass(frozen=True, eq=False)
class ProblemTables:
    """Tables of a problem, and the C initialisers of its `struct problem` and of those with constant rates."""

    initialiser: str
    rough_name: str
    rough: tuple[str, ...]
    tables: tuple[Table, ...]


def problem_tables(
    suffix: str, H: np.ndarray, f_from: np.ndarray, rows: np.ndarray, tension_from: np.ndarray, stages: int,
    *, patient: bool = False,
) -> ProblemTables:  # fmt: skip
    """Tables of a problem.

    Parameters
    ----------
    suffix : str
        Ends their names.
    H : (N nu, N nu)
        Of inputs.
    f_from : (N nu, g)
        Its linear cost from what is given.
    rows : (N nT + N nu, N nu)
        Tension rows by inputs, then rate rows.
    tension_from : (N nT, s)
        S, of the first s of what is given.
    stages : int
        N.
    patient : bool
        Whether floors give way only where it is proven that they cannot be kept, and no search begins again.

    Raises
    ------
    OutputError
        Rows of another form.
    """
    n = len(H)
    half = np.linalg.cholesky(H)
    by_force = sla.solve_triangular(half, np.roll(rows, n, axis=0).T, lower=True)
    optimum = -sla.cho_solve((half, True), f_from)
    column = _first_column(rows, stages)
    curvature, price = _relaxation(H, rows, stages)
    G = summed(summed(H, stages).T, stages)
    tables = (
        Table(f"G{suffix}", 0.5 * (G + G.T), "G, Hessian of rates"),
        Table(f"moves{suffix}", lower_triangle(by_force.T @ by_force), "B, lower triangle row by row"),
        Table(f"slope_from{suffix}", summed(f_from, stages), "g from what is given"),
        Table(f"optimum_from{suffix}", rows[-n:] @ optimum, "w without limits from what is given"),
        Table(f"tension_from{suffix}", tension_from, "scaled tension deviations from what is given, m"),
        Table(f"tension_rows{suffix}", column, "first block column of M"),
        Table(f"tension_by_rate{suffix}", column.T, "the same, rate by rate"),
    )
    if not patient and qp_dual.all_may_act(n):
        L = np.linalg.cholesky(tables[0].values)
        tables += (Table(f"half{suffix}", lower_triangle(L), "L of G = L L', lower triangle row by row"),)
    work = qp_primal.bounds(n, stages)[0]
    most = len(rows) + n if qp_dual.all_may_act(n) else qp_dual.most_broken(n)
    many, astray = (len(rows), np.inf) if patient else (most, dual.ASTRAY)
    members = {
        "stages": stages, "floors": len(rows) - n, "given": f_from.shape[1], "seen": tension_from.shape[1],
        "curvature": curvature, "price": price, "largest": np.abs(H.diagonal()).max(), "work": work, "many": many,
        "astray": astray,
    } | {table.name.removesuffix(suffix): table.name for table in tables}  # fmt: skip
    if patient:
        return ProblemTables(_initialiser(members), "", (), tables)
    form = bordered.Form(
        tables[0].values, rows[: len(rows) - n], summed(rows[: len(rows) - n].T, stages), curvature, stages
    )
    name = f"rough_problems{suffix}"
    rough, more = _rough(form, column, suffix, work)
    return ProblemTables(_initialiser(members | {"rough": name}), name, rough, (*tables, *more))


def _rough(
    form: bordered.Form, column: np.ndarray, suffix: str, work: float
) -> tuple[tuple[str, ...], tuple[Table, ...]]:
    """Initialisers of problems with constant rates, each of which names the next, and their tables."""
    blocks = column.reshape(form.stages, -1, column.shape[1])
    sums = Table(f"tension_sums{suffix}", blocks.cumsum(axis=0).reshape(column.shape).T, "running sums of its blocks")
    tables, found = [sums], []
    wanted = [(parts, share) for parts, share in qp_primal.PARTS if parts <= form.stages]
    for parts, share in wanted:
        evenly = ConstantRates(form, parts).form
        tables.append(Table(f"G_{parts}{suffix}", evenly.G, "G where rates are constant in parts of the horizon"))
        members = {
            "stages": parts, "floors": len(column), "curvature": evenly.curvature, "price": form.stages / parts,
            "work": share * work, "G": tables[-1].name, "tension_by_rate": sums.name,
        }  # fmt: skip
        following = {"rough": f"rough_problems{suffix} + {len(found) + 1}"} if len(found) + 1 < len(wanted) else {}
        found.append(_initialiser(members | following))
    return tuple(found), tuple(tables)


def _initialiser(members: dict[str, float | str]) -> str:
    """In C, member by member; those that are left out are zero."""
    told = (f".{name} = {value if isinstance(value, int | str) else number(value)}" for name, value in members.items())
    return "{" + ", ".join(told) + "}"


def summed(slopes: np.ndarray, stages: int) -> np.ndarray:
    """Slopes by rates from those by inputs: a rate moves its input in all later stages."""
    staged = slopes.reshape(stages, -1, slopes.shape[1])
    return staged[::-1].cumsum(axis=0)[::-1].reshape(slopes.shape)


def _relaxation(H: np.ndarray, rows: np.ndarray, stages: int) -> tuple[float, float]:
    """Curvature of a stage's slack and its price over the steepest cost in sight, as `synthesis.relaxed` has them."""
    n, limited = len(H), len(H) + len(rows)
    steep = np.zeros(n)
    steep[0] = 1.0
    asked = relax(QP(H, steep, rows, np.zeros(limited), np.zeros(limited)), stages)
    return float(asked.H[-1, -1]), float(asked.f[-1])


def _first_column(rows: np.ndarray, stages: int) -> np.ndarray:
    """The tension rows' first block column by rates, (N nT, nu)."""
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
    return first.reshape(stages, nT, nu).cumsum(axis=0).reshape(first.shape)
