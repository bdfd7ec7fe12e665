"""What is said of one mode: yes, no or undecided, how far from the other answer, and why."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    from tensctl.linear import LinearModel

Verdict = Literal["yes", "no", "undecided"]

# A gain above this part of the largest is certain in double precision; one below the second number is rounding.
_CERTAIN = 1e-9
_ROUNDING = 1e-13


@dataclass(frozen=True)
class ModeVerdict:
    """Verdict on one mode of a linear model.

    Attributes
    ----------
    index : int
        Index of the mode.
    frequency : float, Hz
    kind : str
        "rigid-body", "flexible", "mechanism" or "unstable".
    multiplicity : int
        Size of the group of equal frequencies; inside a group the gains are its singular values in turn.
    gain : float
        How strongly inputs drive the mode (or outputs see it): a singular value of its rows of B (columns of C).
    distance : float
        Smallest change of B (or C), in 2-norm, that would make the answer "no"; A stays as it is.
    tendons : tuple of str
        Inputs (or outputs) by strength, strongest first, at most five.
    verdict : "yes", "no" or "undecided"
    reason : str
        Why not yes; empty for yes.
    shares : tuple of float
        Part of each of `tendons` in the squared gain of the whole group of equal frequencies, 0 to 1, per metre of
        rest length (or of the outputs, in their units).
    cluster : int
        Number of the group of equal frequencies.
    """

    index: int
    frequency: float
    kind: str
    multiplicity: int
    gain: float
    distance: float
    tendons: tuple[str, ...]
    verdict: Verdict
    reason: str
    shares: tuple[float, ...] = ()
    cluster: int = -1


@dataclass(frozen=True)
class ModalReport:
    """Verdicts on all modes of a model.

    Attributes
    ----------
    modes : tuple of ModeVerdict
    question : str
        "controllable" or "observable".
    note : str
    linear : LinearModel, optional
        What was judged; `hautus` and `verify` need it.
    """

    modes: tuple[ModeVerdict, ...]
    question: str
    note: str = ""
    linear: LinearModel | None = field(default=None, repr=False, compare=False)

    @property
    def controllable_modes(self) -> tuple[int, ...]:
        """Indices of the modes that inputs drive."""
        return self._answered("controllable", yes=True)

    @property
    def uncontrollable_modes(self) -> tuple[int, ...]:
        """Indices of the modes that inputs do not drive, or not for certain."""
        return self._answered("controllable", yes=False)

    @property
    def observable_modes(self) -> tuple[int, ...]:
        """Indices of the modes that outputs see."""
        return self._answered("observable", yes=True)

    @property
    def unobservable_modes(self) -> tuple[int, ...]:
        """Indices of the modes that outputs do not see, or not for certain."""
        return self._answered("observable", yes=False)

    @cached_property
    def hautus(self) -> Float[np.ndarray, " modes"]:
        """Smallest singular value of [A - lambda I, B] (or of [A' - lambda I, C']) at each mode's own lambda, 1/s.

        The distance over A and B together: the smallest change of both, in 2-norm, after which lambda is an eigenvalue
        that no input moves. It is continuous where `distance`, which keeps A, jumps: when a repeated frequency opens.
        Inputs and outputs are in the square root of their energy (`analysis.scaling`); of a damped mode's two
        eigenvalues the worse counts. One singular value decomposition for each frequency: (6,3) takes 5 s.
        """
        from tensctl.analysis.hautus import hautus_distances

        return hautus_distances(self._judged, self.question)

    def verify(self, tol: float = 1e-9) -> None:
        """Check every answer by the Hautus matrix, which knows neither modes nor groups.

        Raises
        ------
        LinearizationError
            With the first mode whose answer it contradicts.
        """
        from tensctl.analysis.hautus import check_distances

        check_distances(self._judged, self, tol)

    @property
    def _judged(self) -> LinearModel:
        if self.linear is None:
            raise AttributeError("this report was made without a linear model; use tc.controllability(linear).")
        return self.linear

    def _answered(self, question: str, *, yes: bool) -> tuple[int, ...]:
        if question != self.question:
            raise AttributeError(f"this report says which modes are {self.question}, not which are {question}")
        return tuple(mode.index for mode in self.modes if (mode.verdict == "yes") == yes)

    def __str__(self) -> str:
        """A table, one line a mode."""
        rows = [("mode", "kind", "f [Hz]", "x", "gain", "distance", "answer", "strongest, or reason")]
        for m in self.modes:
            last = m.reason or ", ".join(m.tendons)
            numbers = (f"{m.frequency:.4g}", str(m.multiplicity), f"{m.gain:.3g}", f"{m.distance:.3g}")
            rows.append((str(m.index), m.kind, *numbers, m.verdict, last))
        widths = [max(len(row[k]) for row in rows) for k in range(7)]
        lines = ["  ".join([*(row[k].ljust(widths[k]) for k in range(7)), row[7]]) for row in rows]
        count = sum(m.verdict == "yes" for m in self.modes)
        return "\n".join([f"{count} of {len(self.modes)} modes are {self.question}", *lines])


def decide(gain: float, largest: float) -> Verdict:
    """Yes, no, or undecided in double precision."""
    if gain > _CERTAIN * largest:
        return "yes"
    return "no" if gain <= _ROUNDING * largest or largest == 0 else "undecided"
