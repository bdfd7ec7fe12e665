"""What is said of one mode: yes, no or undecided, how far from the other answer, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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


@dataclass(frozen=True)
class ModalReport:
    """Verdicts on all modes of a model.

    Attributes
    ----------
    modes : tuple of ModeVerdict
    question : str
        "controllable" or "observable".
    note : str
    """

    modes: tuple[ModeVerdict, ...]
    question: str
    note: str = ""

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
