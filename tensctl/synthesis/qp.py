"""The quadratic programme and its own judge.

    minimise  z'Hz/2 + f'z   subject to  lower <= (z, A z) <= upper

Bounds come first for the variables, then for the rows of A. Multipliers y > 0 belong to upper, y < 0 to lower bounds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from jaxtyping import Float
from scipy.linalg.blas import dsymv
from scipy.linalg.lapack import dpotrs

# An answer whose KKT residual is larger is refused.
ACCEPT = 1e-6
# Stands for zero in a denominator; its square is still a number.
_TINY = 1e-150


@dataclass(frozen=True, eq=False)
class QP:
    """One quadratic programme with symmetric positive definite H.

    Attributes
    ----------
    H : (n, n)
    f : (n,)
    A : (r, n)
    lower, upper : (n + r,)
    start : (nx + nu,) or None
        Where a plan begins, for solvers that keep states as variables.
    free : (n + r,) or None
        Values of what is bounded at the minimum without limits, where they are known.
    guess : (inputs,) or None
        A plan of inputs near the answer, for solvers that begin at one; slacks are theirs to find.
    product : function or None
        z to A z, where that is known to take less than all of A.
    """

    H: Float[np.ndarray, "n n"]
    f: Float[np.ndarray, " n"]
    A: Float[np.ndarray, "r n"]
    lower: Float[np.ndarray, " n_plus_r"]
    upper: Float[np.ndarray, " n_plus_r"]
    start: Float[np.ndarray, " s"] | None = None
    free: Float[np.ndarray, " n_plus_r"] | None = None
    guess: Float[np.ndarray, " m"] | None = None
    product: Callable[[np.ndarray], np.ndarray] | None = None

    def objective(self, z: Float[np.ndarray, " n"]) -> float:
        """Value at z."""
        return float(z @ (0.5 * self.pull(z) + self.f))

    def pull(self, z: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """H z, of one half of H: the whole costs twice as much, which is all that a large check takes."""
        return dsymv(1.0, self.H if self.H.flags.f_contiguous else self.H.T, z)

    def violation(self, z: Float[np.ndarray, " n"]) -> float:
        """Largest amount by which z breaks a bound, in the bound's unit."""
        return self.broken(self.values(z))

    def values(self, z: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n_plus_r"]:
        """What is bounded: (z, A z)."""
        return np.concatenate([z, self.A @ z if self.product is None else self.product(z)])

    def unlimited(self, half: Float[np.ndarray, "n n"]) -> Float[np.ndarray, " n_plus_r"]:
        """What is bounded, at the minimum without limits: by the Cholesky factor of H where it is not told."""
        if self.free is not None:
            return self.free
        return self.values(np.asarray(dpotrs(half, -self.f, lower=1)[0]))

    def broken(self, values: Float[np.ndarray, " n_plus_r"]) -> float:
        """Largest amount by which values leave their bounds."""
        return float(max((self.lower - values).max(), (values - self.upper).max(), 0.0))

    def kkt_residual(self, z: Float[np.ndarray, " n"], y: Float[np.ndarray, " n_plus_r"]) -> float:
        """How far (z, y) is from optimal, recomputed from the problem's data; 0 is exact.

        The largest of: stationarity over the largest of its terms, violated bounds and multipliers on inactive
        bounds, each over the size of what it is measured against.
        """
        return self.residual(z, y, self.values(z))

    def residual(self, z: np.ndarray, y: np.ndarray, values: np.ndarray) -> float:
        """`kkt_residual` with the values of z at hand."""
        n = self.f.size
        pull, pulls = self.pull(z), np.flatnonzero(y)
        left, scale = pull + self.f, max(np.abs(pull).max(), np.abs(self.f).max(), _TINY)
        reach = max(np.abs(values).max(), _TINY)
        if not pulls.size:  # no limit acts, and there is nothing more to sum up
            return float(max(np.abs(left).max() / scale, self.broken(values) / reach))
        acting = np.flatnonzero(y[n:])
        push = y[:n] + y[n:][acting] @ self.A[acting]
        scale = max(scale, np.abs(push).max())
        gaps = np.where(y[pulls] > 0, self.upper[pulls] - values[pulls], values[pulls] - self.lower[pulls])
        slack = np.abs(y[pulls]) * np.minimum(np.abs(gaps), reach)
        size = max(np.abs(y).max(), scale)
        return float(max(np.abs(left + push).max() / scale, self.broken(values) / reach, slack.max() / (size * reach)))


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solver returned; `status` is its word, `kkt` is ours.

    Attributes
    ----------
    z : (n,) or None when there is no answer
    y : (n + r,) multipliers
    status : "solved", "bounded", "infeasible" or "failed"
        Bounded: keeps the hard limits, but the work was over before the optimum.
    kkt : float
        Recomputed KKT residual.
    """

    z: Float[np.ndarray, " n"] | None
    y: Float[np.ndarray, " n_plus_r"] | None
    status: str
    kkt: float

    @property
    def accepted(self) -> Float[np.ndarray, " n"] | None:
        """The answer, when it is good enough."""
        return self.z if self.kkt <= ACCEPT else None

    @property
    def usable(self) -> Float[np.ndarray, " n"] | None:
        """The answer, when it is good enough or the best that bounded work came to."""
        return self.z if self.status == "bounded" else self.accepted


class Solver(Protocol):
    """A solver set up for one H and A; f and bounds change from call to call."""

    name: str

    def solve(self, qp: QP) -> Solution:
        """Solve with the H and A of the set-up."""
        ...


def judged(qp: QP, z: np.ndarray | None, y: np.ndarray | None, status: str) -> Solution:
    """A solution with its recomputed residual."""
    if z is None or y is None or not (np.isfinite(z).all() and np.isfinite(y).all()):
        return Solution(None, None, status if status == "infeasible" else "failed", np.inf)
    return Solution(z, y, status, qp.kkt_residual(z, y))
