"""What `control.ctrb` says, and why it is not believed.

    rank [B, AB, A^2 B, ... A^(n-1) B]

Powers of A stretch the fastest mode against the slowest by (omega_max/omega_min)^(n-1). Beyond 1e16 the slow modes'
columns are rounding of the fast ones, and the rank falls without any mode being undriven.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.linear import LinearModel

# The matrix has n columns for each input: 348 states and 144 inputs would take 140 MB.
_STATES = 120
_DIGITS = 16


@dataclass(frozen=True)
class KrylovRank:
    """The rank that rounding leaves.

    Attributes
    ----------
    rank : int or None
        None where the powers of A overflow.
    states : int
    digits : float
        log10 of the stretch between the fastest and the slowest mode; double precision has 16.
    """

    rank: int | None
    states: int
    digits: float

    def __str__(self) -> str:
        """The number and its reason."""
        said = "no number (overflow)" if self.rank is None else f"rank {self.rank}"
        spread = f"control.ctrb: {said} of {self.states}. Its powers of A spread over {self.digits:.0f} decimal digits"
        if self.digits < _DIGITS and self.rank == self.states:
            return f"{spread}, few enough for double precision."
        return (
            f"{spread}; double precision has {_DIGITS}, and weakly driven modes are lost first: the difference to the "
            "verdicts is rounding."
        )


def krylov_matrix(A: Float[np.ndarray, "n n"], B: Float[np.ndarray, "n nu"]) -> Float[np.ndarray, "n m"]:
    """The matrix of `control.ctrb`, [B, AB, ... A^(n-1) B] by repeated products, to its last bit.

    Written out here, since python-control takes longer to load than everything else of a report's controllability.
    """
    n, nu = B.shape
    matrix = np.empty((n, n * nu))
    matrix[:, :nu] = B
    for k in range(nu, n * nu, nu):
        matrix[:, k : k + nu] = np.dot(A, matrix[:, k - nu : k])
    return matrix


def krylov_rank(linear: LinearModel) -> KrylovRank | None:
    """Rank of `control.ctrb`'s matrix on the flexible model; None for models too large to be asked."""
    flexible = linear.flexible
    A, B = flexible.A, flexible.B
    if not 0 < len(A) <= _STATES or not B.shape[1]:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        matrix = krylov_matrix(A, B)
    omega = np.sort(np.sqrt(np.abs([mode.omega2 for mode in flexible.modes])))
    spread = omega[-1] / omega[0] if omega[0] > 0 else np.inf
    rank = int(np.linalg.matrix_rank(matrix)) if np.isfinite(matrix).all() else None
    return KrylovRank(rank, len(A), float((len(A) - 1) * np.log10(spread)))
