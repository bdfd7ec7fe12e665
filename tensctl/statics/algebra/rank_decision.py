"""A numerical rank that shows what it was decided from: values, tolerance and gap.

    rank = #{ value > tolerance },   gap = smallest kept value / max(largest dropped value, rounding)

A rank is counted as decided when the gap is at least 1e3 and zeros are 1e3 times smaller than the weakest part of the
matrix. Otherwise double precision (or the tolerance that was asked for) cannot tell a zero from something small, and
`decided` is False.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Three digits between kept and dropped: rounding bounds are often ten times too small or too large, rarely a thousand
# times. Smaller accepts guesses, larger calls clear cases undecided.
DECISIVE_GAP = 1e3


@dataclass(frozen=True, eq=False)
class RankDecision:
    """Singular values (or sizes of eigenvalues) and the rank read from them.

    Attributes
    ----------
    values : (n,), descending
    scale : float
        Size of what the matrix was computed from; all zeros are judged against it.
    rounding : float
        What rounding alone may have made of a zero, in the unit of the values.
    tolerance : float
        Values at or below are counted as zero; equal to `rounding` unless a larger one was asked for.
    weakest : float
        Size of the weakest part of what the matrix was computed from. When it drowns in the tolerance, zeros may be
        weak members beside strong ones; infinite when all parts are of one size.
    """

    values: Float[np.ndarray, " n"]
    scale: float
    rounding: float
    tolerance: float
    weakest: float = np.inf

    @property
    def rank(self) -> int:
        """Values above the tolerance."""
        return int((self.values > self.tolerance).sum())

    @property
    def nullity(self) -> int:
        """Values counted as zero."""
        return len(self.values) - self.rank

    @property
    def smallest_kept(self) -> float:
        """Smallest value that counts as nonzero; the scale when there is none."""
        return float(self.values[self.rank - 1]) if self.rank else self.scale

    @property
    def largest_dropped(self) -> float:
        """Largest value that counts as zero; 0 when there is none."""
        return float(self.values[self.rank]) if self.nullity else 0.0

    @property
    def gap(self) -> float:
        """How many times larger the smallest kept value is than whatever was dropped, or than rounding."""
        floor = max(self.largest_dropped, self.rounding)
        return float(self.smallest_kept / floor) if floor > 0 else np.inf

    @property
    def decided(self) -> bool:
        """Whether double precision tells kept and dropped values apart."""
        resolved = self.nullity == 0 or self.weakest >= DECISIVE_GAP * self.tolerance
        return bool(self.gap >= DECISIVE_GAP and resolved)

    def __str__(self) -> str:
        relative = np.array([self.smallest_kept, self.largest_dropped, self.tolerance]) / (self.scale or 1.0)
        return (
            f"rank {self.rank} of {len(self.values)}{'' if self.decided else ' (undecided)'}: smallest kept value "
            f"{relative[0]:.1e}, largest dropped {relative[1]:.1e}, tolerance {relative[2]:.1e}, all relative to "
            f"{self.scale:.3g}; gap {self.gap:.1e}, {DECISIVE_GAP:.0e} decides"
            + (f"; weakest part {self.weakest / (self.scale or 1.0):.1e}" if np.isfinite(self.weakest) else "")
        )


def decide_rank(
    values: np.ndarray,
    *,
    scale: float,
    rounding: float,
    rank_tol: float | None = None,
    weakest: float = np.inf,
) -> RankDecision:
    """Decide a rank from singular values.

    Parameters
    ----------
    values : (n,), any order
    scale : float
        Size of what the matrix was computed from.
    rounding : float
        Bound on what rounding made of zeros.
    rank_tol : float, optional
        Relative to `scale`; counts larger values as zero, for data that were themselves rounded.
    weakest : float, optional
        Size of the weakest part, see `RankDecision`.
    """
    tolerance = rounding if rank_tol is None else max(rounding, rank_tol * scale)
    return RankDecision(np.sort(np.abs(values))[::-1], float(scale), float(rounding), float(tolerance), float(weakest))
