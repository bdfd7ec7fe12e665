"""The least change of inputs that has a wanted effect within bounds: in the 2-norm, or with the fewest inputs.

    min sum_t w_t u_t^2   or   min #{t: u_t != 0}      subject to   S u = y,   A u <= b

y is the wanted effect where bounds allow it, else the effect nearest to it (least sum of absolute differences). Where
no bound acts, the 2-norm has a closed form; else DAQP answers. The fewest are found exactly by a mixed-integer program
(up to 60 inputs, each at most 100 times the largest of the least change), beyond by the 1-norm. The chosen inputs are
solved for again in the 2-norm, and of equally few those with the least norm are taken where all can be tried.
`optimality` recomputes Karush, Kuhn and Tucker's conditions from S, A and the answer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError

# Parts of S below this of the largest are rounding: no input reaches there.
_REACHED = 1e-10
# Bounds are kept to this part of the largest change.
_KEPT = 1e-9
# Branch and bound stays below a second up to here.
EXACT_INPUTS = 60
_FARTHEST = 100.0
# Choices of equally few inputs that are tried one by one, 0.1 ms each.
_CHOICES = 5000


@dataclass(frozen=True, eq=False)
class Wanted:
    """The program.

    Attributes
    ----------
    S : (k, nu)
        Effect of the inputs.
    effect : (k,)
    A, b : (rows, nu), (rows,)
    weights : (nu,)
    """

    S: Float[np.ndarray, "k nu"]
    effect: Float[np.ndarray, " k"]
    A: Float[np.ndarray, "rows nu"]
    b: Float[np.ndarray, " rows"]
    weights: Float[np.ndarray, " nu"]

    def keeps(self, u: Float[np.ndarray, " nu"]) -> bool:
        """Whether bounds hold."""
        return bool((self.A @ u <= self.b + _KEPT * (np.abs(self.A) @ np.abs(u) + np.abs(self.b))).all())

    def only(self, chosen: np.ndarray) -> Wanted:
        """The program with some inputs only."""
        return replace(self, S=self.S[:, chosen], A=self.A[:, chosen], weights=self.weights[chosen])


def least_norm(wanted: Wanted) -> Float[np.ndarray, " nu"]:
    """The least weighted 2-norm.

    Raises
    ------
    EquilibriumError
        When bounds cannot be kept at all.
    """
    root = np.sqrt(wanted.weights)
    free = np.linalg.pinv(wanted.S / root, rcond=_REACHED) @ wanted.effect / root
    if wanted.keeps(free):
        return free
    y = wanted.S @ free
    found = _bounded(wanted, y)
    if found is None:
        found = _bounded(wanted, wanted.S @ _linear(wanted, y))
    if found is None:
        raise EquilibriumError(
            "no change of the rest lengths keeps the bounds; lower tension_min, or move from a tighter equilibrium."
        )
    return found


def fewest(wanted: Wanted) -> tuple[Float[np.ndarray, " nu"], str]:
    """As few inputs as possible, and how they were found: "mixed-integer program" or "1-norm"."""
    start = least_norm(wanted)
    y, size = wanted.S @ start, np.abs(start).max(initial=0.0)
    if size == 0:
        return start, "nothing to do"
    if start.size <= EXACT_INPUTS:
        found = _polished(wanted, y, _integer(wanted, y, size))
        if found is not None:
            return _smallest(wanted, y, found), "mixed-integer program"
    one = _linear(wanted, y, exactly=True)
    found = _polished(wanted, y, None if one is None else np.abs(one) > _KEPT * np.abs(one).max(initial=0.0))
    return (start, "2-norm") if found is None else (found, "1-norm")


def optimality(wanted: Wanted, u: Float[np.ndarray, " nu"]) -> float:
    """What is left of W u = S'l - A'm, m >= 0 on acting bounds, over |W u|: 0 at the least weighted 2-norm."""
    from scipy.optimize import nnls

    slope = wanted.weights * u
    gap = wanted.b - wanted.A @ u
    acting = gap <= 1e-7 * (np.abs(wanted.A) @ np.abs(u) + np.abs(wanted.b))
    columns = np.hstack([wanted.S.T, -wanted.S.T, -wanted.A[acting].T])
    size = np.linalg.norm(slope)
    scales = np.linalg.norm(columns, axis=0)
    return float(nnls(columns / np.where(scales > 0, scales, 1.0), slope / size)[1]) if size > 0 else 0.0


def _bounded(wanted: Wanted, y: np.ndarray) -> np.ndarray | None:
    """DAQP's answer for S u = y within bounds, if it is one; in units of the wanted effect and unit rows."""
    import daqp

    root = np.sqrt(wanted.weights)
    S, A = wanted.S / root, wanted.A / root
    left, sizes, right = np.linalg.svd(S, full_matrices=False)
    kept = sizes > _REACHED * sizes.max(initial=0.0)
    rows, values = right[kept], (left[:, kept].T @ y) / sizes[kept]
    unit = np.linalg.norm(values) or 1.0
    scale = np.linalg.norm(A, axis=1)
    scale = np.where(scale > 0, scale, 1.0)
    matrix = np.ascontiguousarray(np.vstack([rows, A / scale[:, None]]))
    upper = np.concatenate([values / unit, wanted.b / scale / unit])
    lower = np.concatenate([values / unit, np.full(scale.size, -1e30)])
    sense = np.concatenate([np.full(values.size, 5), np.zeros(scale.size, int)]).astype(np.int32)
    n = root.size
    v, _, flag, _ = daqp.solve(np.eye(n), np.zeros(n), matrix, np.clip(upper, -1e30, 1e30), lower, sense)
    u = np.asarray(v) * unit / root
    arrived = np.abs(wanted.S @ u - y).max(initial=0.0) <= 1e-7 * max(np.abs(y).max(initial=0.0), 1e-300)
    return u if flag > 0 and arrived and wanted.keeps(u) else None


def _linear(wanted: Wanted, y: np.ndarray, *, exactly: bool = False) -> np.ndarray | None:
    """Least sum |S u - y| within bounds; `exactly`: least sum sqrt(w) |u| with S u = y."""
    from scipy.optimize import linprog

    (k, n), unit = wanted.S.shape, np.abs(y).max(initial=0.0) or 1.0
    split = np.hstack([wanted.S, -wanted.S])
    bounds = np.hstack([wanted.A, -wanted.A])
    if exactly:
        cost = np.tile(np.sqrt(wanted.weights), 2)
        found = linprog(cost, bounds, wanted.b / unit, split, y / unit, method="highs")
    else:
        cost = np.concatenate([np.zeros(2 * n), np.ones(2 * k)])
        equal = np.hstack([split, np.eye(k), -np.eye(k)])
        found = linprog(
            cost, np.hstack([bounds, np.zeros((len(bounds), 2 * k))]), wanted.b / unit, equal, y / unit, method="highs"
        )
    if found.x is None:
        if exactly:
            return None
        raise EquilibriumError(
            "no change of the rest lengths keeps the bounds; lower tension_min, or move from a tighter equilibrium."
        )
    return (found.x[:n] - found.x[n : 2 * n]) * unit


def _integer(wanted: Wanted, y: np.ndarray, size: float) -> np.ndarray | None:
    """Which inputs the mixed-integer program takes: v = u/size, |v| <= 100 z, z in {0, 1}, least sum z."""
    from scipy.optimize import Bounds, LinearConstraint, milp

    n, far = wanted.S.shape[1], _FARTHEST
    eye, none = np.eye(n), np.zeros
    rows = np.linalg.norm(wanted.S, axis=1)
    rows = np.where(rows > 0, rows, 1.0)
    aim = y / rows / size
    constraints = [
        LinearConstraint(np.hstack([wanted.S / rows[:, None], none((y.size, n))]), aim, aim),
        LinearConstraint(np.hstack([wanted.A, none((len(wanted.A), n))]), -np.inf, wanted.b / size),
        LinearConstraint(np.hstack([eye, -far * eye]), -np.inf, 0.0),
        LinearConstraint(np.hstack([-eye, -far * eye]), -np.inf, 0.0),
    ]
    bounds = Bounds(np.concatenate([np.full(n, -far), none(n)]), np.concatenate([np.full(n, far), np.ones(n)]))
    kinds = np.repeat([0, 1], n)
    found = milp(kinds, integrality=kinds, bounds=bounds, constraints=constraints, options={"time_limit": 20.0})
    return None if found.x is None or found.status != 0 else found.x[n:] > 0.5


def _smallest(wanted: Wanted, y: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Of all choices of as many inputs the one with the least 2-norm, where there are few enough to try."""
    n, count = found.size, int(np.count_nonzero(found))
    if comb(n, count) > _CHOICES:
        return found
    others = (_polished(wanted, y, np.isin(np.arange(n), chosen)) for chosen in combinations(range(n), count))
    return min([found, *(u for u in others if u is not None)], key=lambda u: float(wanted.weights @ u**2))


def _polished(wanted: Wanted, y: np.ndarray, chosen: np.ndarray | None) -> np.ndarray | None:
    """Least 2-norm with the chosen inputs, if they have the effect at all."""
    if chosen is None or not chosen.any():
        return None
    part = replace(wanted.only(np.flatnonzero(chosen)), effect=y)
    try:
        few = least_norm(part)
    except EquilibriumError:
        return None
    if np.abs(part.S @ few - y).max(initial=0.0) > 1e-7 * np.abs(y).max(initial=0.0):
        return None
    u = np.zeros(chosen.size)
    u[chosen] = few
    return u
