"""Disk margins at the plant's inputs: how much gain and phase may change there before the loop is lost.

    S = transfer from d to u + d where d is added to the inputs of the plant,   alpha = 1 / max_w |S - I/2|

All inputs may be multiplied at once by gains between (2 - alpha)/(2 + alpha) and its inverse, or turned by phases up to
2 atan(alpha/2), and the loop stays stable (Seiler, Packard and Gahinet, IEEE Control Syst. Mag. 40(5), 2020). With one
input at a time S_ii takes the place of S. The maximum is searched on a grid that holds every pole's frequency, then
refined; `enclosure` and `enclosures` tell from eigenvalues whether a peak between its points was missed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.optimize as so

from tensctl.synthesis.hinf import System, hinf

_GRID = 150
# Peaks of the grid that are refined.
_REFINED = 3


@dataclass(frozen=True)
class DiskMargin:
    """A disk margin and where it was found.

    Attributes
    ----------
    alpha : float
        0 nothing, 2 everything.
    frequency : float, Hz
    """

    alpha: float
    frequency: float

    @property
    def gain(self) -> tuple[float, float]:
        """Factors between which the gain may lie."""
        high = (2 + self.alpha) / (2 - self.alpha) if self.alpha < 2 else np.inf
        return 1 / high, high

    @property
    def phase(self) -> float:
        """Phase that may be lost or won, degrees."""
        return float(np.degrees(2 * np.arctan(min(self.alpha, 2.0) / 2)))


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """S = I + C (sI - A)^-1 B, or with z = exp(s dt) for s, by one Schur form for all frequencies."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    dt: float | None

    @cached_property
    def _system(self) -> System:
        return System(self.A, self.B, self.C, np.eye(self.B.shape[1]), self.dt)

    def at(self, omega: float) -> np.ndarray:
        """S at an angular frequency, (nu, nu)."""
        return self._system.at(omega)

    def enclosure(self) -> tuple[float, float]:
        """Least and largest value that alpha of all inputs at once can have, from the H-infinity norm of S - I/2."""
        peak = hinf(System(self.A, self.B, self.C, 0.5 * np.eye(self.B.shape[1]), self.dt))
        return 1 / peak.high, 1 / peak.low

    def enclosures(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value that alpha of each input alone can have: a spectrum or two of twice the loop each."""
        half = np.array([[0.5]])
        alone = [System(self.A, self.B[:, [i]], self.C[[i]], half, self.dt) for i in range(self.B.shape[1])]
        return tuple((1 / peak.high, 1 / peak.low) for peak in map(hinf, alone))

    def margins(self) -> tuple[DiskMargin, tuple[DiskMargin, ...]]:
        """Of all inputs at once, and of each alone."""
        grid = self._frequencies()
        half = 0.5 * np.eye(self.B.shape[1])
        shown = np.stack([self.at(omega) - half for omega in grid])
        whole = self._peak(grid, np.linalg.norm(shown, 2, axis=(1, 2)), lambda S: np.linalg.norm(S - half, 2))
        single = [self._peak(grid, np.abs(shown[:, i, i]), lambda S, i=i: abs(S[i, i] - 0.5)) for i in range(len(half))]
        return whole, tuple(single)

    def _frequencies(self) -> np.ndarray:
        poles = np.diag(self._system.schur[0])
        if self.dt is not None:
            poles = np.log(poles[np.abs(poles) > 1e-6]) / self.dt
        sizes = np.abs(poles)
        low, high = sizes.min() / 10, sizes.max() * 10 if self.dt is None else np.pi / self.dt
        inside = np.concatenate([np.geomspace(low, high, _GRID), np.abs(np.imag(poles)), sizes])
        return np.unique(inside[(inside >= low) & (inside <= high)])

    def _peak(self, grid: np.ndarray, values: np.ndarray, size) -> DiskMargin:
        best, at = values.max(), grid[values.argmax()]
        for k in np.argsort(-values)[:_REFINED]:
            bounds = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, grid.size - 1)])
            found = so.minimize_scalar(lambda w: -size(self.at(w)), bounds=bounds, method="bounded")
            if -found.fun > best:
                best, at = -found.fun, found.x
        return DiskMargin(float(1 / best), float(at / (2 * np.pi)))
