"""What `control.ctrb` says, and why it is not believed.

    rank [B, AB, A^2 B, ... A^(n-1) B]

Powers of A stretch the fastest mode against the slowest by (omega_max/omega_min)^(n-1). Beyond 1e16 the slow modes'
columns are rounding of the fast ones, and the rank falls without any mode being undriven.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


def krylov_rank(linear: LinearModel) -> KrylovRank | None:
    """Rank of python-control's Krylov matrix on the flexible model; None for models too large to be asked."""
    flexible = linear.flexible
    A, B = flexible.A, flexible.B
    if not 0 < len(A) <= _STATES or not B.shape[1]:
        return None
    import control

    matrix = np.asarray(control.ctrb(A, B))
    omega = np.sort(np.sqrt(np.abs([mode.omega2 for mode in flexible.modes])))
    spread = omega[-1] / omega[0] if omega[0] > 0 else np.inf
    rank = int(np.linalg.matrix_rank(matrix)) if np.isfinite(matrix).all() else None
    return KrylovRank(rank, len(A), float((len(A) - 1) * np.log10(spread)))
