"""Euler buckling along a run: a slender rod with hinged ends bows out at P_cr = pi^2 EI / L^2.

In motion the force varies along a rod; its largest value is compared, which is on the safe side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Overload:
    """A rod, by index, that carries more than its Euler load: since when, the largest share of it, and when (s)."""

    rod: int
    begins: float
    share: float
    time: float


@dataclass(frozen=True, eq=False)
class Buckling:
    """Compression over the Euler load.

    Attributes
    ----------
    time : (t,) s
    critical : (nr,) N
        Euler load; infinite for rods without EI.
    share : (t, nr)
        Largest compression along the rod over its Euler load; 0 for rods without EI, and for rods that are pulled.
    """

    time: Float[np.ndarray, " t"]
    critical: Float[np.ndarray, " rods"]
    share: Float[np.ndarray, "t rods"]

    @property
    def overloads(self) -> tuple[Overload, ...]:
        """Rods that reach their Euler load, in the order in which that happens."""
        rods = np.flatnonzero((self.share >= 1).any(axis=0))
        found = [self._overload(int(rod)) for rod in rods]
        return tuple(sorted(found, key=lambda overload: overload.begins))

    def _overload(self, rod: int) -> Overload:
        """Between two records the share is a straight line."""
        share, worst = self.share[:, rod], int(self.share[:, rod].argmax())
        k = int((share >= 1).argmax())
        begins = self.time[k]
        if k > 0:
            begins = self.time[k - 1] + (1 - share[k - 1]) / (share[k] - share[k - 1]) * (begins - self.time[k - 1])
        return Overload(rod, float(begins), float(share[worst]), float(self.time[worst]))


def euler_loads(EI: Float[np.ndarray, " rods"], lengths: Float[np.ndarray, " rods"]) -> Float[np.ndarray, " rods"]:
    """Critical compression of rods with hinged ends, N."""
    return np.pi**2 * EI / lengths**2


def buckling(
    time: Float[np.ndarray, " t"],
    compression: Float[np.ndarray, "t rods"],
    EI: Float[np.ndarray, " rods"],
    lengths: Float[np.ndarray, " rods"],
) -> Buckling:
    """Compare the largest compression along each rod with its Euler load."""
    critical = euler_loads(EI, lengths)
    return Buckling(time, critical, np.maximum(compression, 0.0) / critical)
