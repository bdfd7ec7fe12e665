"""Disk margins at the plant's inputs: how much gain and phase may change there before the loop is lost.

    S = transfer from d to u + d where d is added to the inputs of the plant,   alpha = 1 / max_w |S - I/2|

All inputs may be multiplied at once by gains between (2 - alpha)/(2 + alpha) and its inverse, or turned by phases up to
2 atan(alpha/2), and the loop stays stable (Seiler, Packard and Gahinet, IEEE Control Syst. Mag. 40(5), 2020). With one
input at a time S_ii takes the place of S. Both maxima are enclosed, not swept: of S by eigenvalues on the boundary of
stability (`hinf`), of S_ii by bounds between frequencies (`single_peaks`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensctl.synthesis.hinf import Peak, System, hinf
from tensctl.synthesis.single_peaks import highest_peak, peaks

# States of a loop up to which its margin of all inputs at once is asked for in passing. It costs one to four spectra of
# twice the states: 4 s in continuous time at 592 states, 22 s when sampled at 888.
STATES = 640


@dataclass(frozen=True)
class DiskMargin:
    """Enclosure of a disk margin; gain and phase are those of its lower end.

    Attributes
    ----------
    alpha, largest : float
        Least and largest value that it can have: 0 nothing may change, 2 everything.
    frequency : float, Hz
        Where `largest` was found; infinite when it is the limit there.
    """

    alpha: float
    largest: float
    frequency: float

    @classmethod
    def of(cls, peak: Peak) -> DiskMargin:
        """That of a peak of |S - I/2|."""
        return cls(1 / peak.high, 1 / peak.low, abs(peak.omega) / (2 * np.pi))

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
    """S = I + C (sI - A)^-1 B, or with z = exp(s dt) for s. The margins of a loop that is not stable are 0."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    dt: float | None

    def at(self, omega: float) -> np.ndarray:
        """S at an angular frequency, (nu, nu), by one Schur form for all frequencies."""
        return self._half.at(omega) + 0.5 * np.eye(self.B.shape[1])

    @property
    def costly(self) -> str | None:
        """Why `all_inputs` is better not asked for in passing; None where it takes seconds."""
        n = len(self.A)
        if n <= STATES:
            return None
        return f"left out beyond {STATES} states: a loop of {n} takes tens of seconds or minutes"

    @property
    def costly_alone(self) -> str | None:
        """The same of `weakest_input`, which costs less than the design."""
        return None

    @cached_property
    def all_inputs(self) -> DiskMargin:
        """When all inputs change at once, each in its own way: a few spectra of twice the loop."""
        return DiskMargin.of(hinf(self._half))

    @cached_property
    def each_input(self) -> tuple[DiskMargin, ...]:
        """When one input changes alone, for each."""
        return tuple(map(DiskMargin.of, peaks(self.A, self.B, self.C, 0.5, self.dt)))

    @cached_property
    def weakest_input(self) -> tuple[DiskMargin, int]:
        """The least of `each_input` and the number of its input, at the cost of the loop's spectrum."""
        peak, which = highest_peak(self.A, self.B, self.C, 0.5, self.dt)
        return DiskMargin.of(peak), which

    def enclosure(self) -> tuple[float, float]:
        """Least and largest value that alpha of all inputs at once can have."""
        return self.all_inputs.alpha, self.all_inputs.largest

    def enclosures(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value that alpha of each input alone can have."""
        return tuple((one.alpha, one.largest) for one in self.each_input)

    @cached_property
    def _half(self) -> System:
        return System(self.A, self.B, self.C, 0.5 * np.eye(self.B.shape[1]), self.dt)
