"""Controllability of a cyclically symmetric structure, harmonic by harmonic: nothing larger than a sector is formed.

    in the unitary transform of the linear model B is block diagonal, so the gain of a mode of harmonic k is that of its
    row of B_k, and the modes of harmonics k and n - k, conjugates of each other, have the same

Near frequencies within a harmonic are judged together as `analysis.modal` does; those of different harmonics are driven
by different combinations of inputs and need not be. Undamped models only: with dampers a mode's eigenvector is not its
shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.analysis.modal import chains
from tensctl.analysis.nearness import gains
from tensctl.analysis.scaling import input_sizes
from tensctl.analysis.verdict import Verdict, decide
from tensctl.errors import LinearizationError
from tensctl.linear import HarmonicModel
from tensctl.linear.harmonic_block import Harmonic
from tensctl.threads import one_blas_thread

_SHOWN = 5
# A stretch below this part of the largest is rounding.
_STILL = 1e-9


@dataclass(frozen=True)
class HarmonicVerdict:
    """Verdict on one mode of one harmonic.

    Attributes
    ----------
    harmonic : int
        k.
    copies : int
        How many modes of the whole structure this is: 2 where harmonics k and n - k are two, else 1.
    frequency : float, Hz
    kind : str
        "flexible", "mechanism" or "unstable".
    gain : float
        How strongly inputs drive it, as in `ModeVerdict`.
    distance : float
        Smallest change of B, in 2-norm, that would make the answer "no".
    verdict : "yes", "no" or "undecided"
    reason : str
        Why not yes; empty for yes.
    tendons : tuple of str
        Tendons of the first sector that drive it most, each standing for its images in all sectors.
    shares : tuple of float
        Part of each, with its images, in the squared gain.
    """

    harmonic: int
    copies: int
    frequency: float
    kind: str
    gain: float
    distance: float
    verdict: Verdict
    reason: str
    tendons: tuple[str, ...]
    shares: tuple[float, ...]


def _gain(mode: HarmonicVerdict) -> float:
    return mode.gain


@dataclass(frozen=True)
class HarmonicReport:
    """Verdicts on all modes of a symmetric model, rigid-body motions left out.

    Attributes
    ----------
    order : int
        Number of sectors n.
    modes : tuple of HarmonicVerdict
        By harmonic, then by frequency.
    """

    order: int
    modes: tuple[HarmonicVerdict, ...]

    @property
    def count(self) -> int:
        """Number of modes of the whole structure."""
        return sum(mode.copies for mode in self.modes)

    @property
    def driven(self) -> int:
        """How many of them the tendons drive."""
        return sum(mode.copies for mode in self.modes if mode.verdict == "yes")

    @property
    def weakest(self) -> HarmonicVerdict:
        """The mode with the smallest gain."""
        return min(self.modes, key=_gain)

    def __str__(self) -> str:
        """A line a harmonic: how many modes, how many driven, the weakest; then each mode that is not driven."""
        lines = [f"{self.driven} of {self.count} modes are controllable, in {self.order // 2 + 1} harmonics"]
        for k in range(self.order // 2 + 1):
            own = [mode for mode in self.modes if mode.harmonic == k]
            if own:
                yes, least = sum(mode.verdict == "yes" for mode in own), min(own, key=_gain)
                by = ", ".join(least.tendons[:3]) or "none"
                lines.append(
                    f"harmonic {k:3d}  x {own[0].copies}  {yes} of {len(own)} driven  "
                    f"weakest {least.frequency:.4g} Hz, gain {least.gain:.3g}, by {by}"
                )
        lines += [
            f"not driven: harmonic {mode.harmonic}, {mode.frequency:.4g} Hz, {mode.verdict}: {mode.reason}"
            for mode in self.modes
            if mode.verdict != "yes"
        ]
        return "\n".join(lines)


@one_blas_thread()
def harmonic_controllability(model: HarmonicModel) -> HarmonicReport:
    """Which modes can tendons drive, how strongly, by which, and why not, at any size.

    Raises
    ------
    LinearizationError
        For a damped model.
    """
    if model.dynamics.damped:
        raise LinearizationError(
            "controllability by harmonics takes models without dampers and drag; use controllability(linearize(...))."
        )
    first = model.map.inputs[0]
    sizes = input_sizes(model, first)
    labels = [model.dynamics.input_labels[i] for i in first]
    judged = [_gains(block, block.drive / sizes) for block in model.blocks]
    largest = max((found.max(initial=0.0) for found in judged), default=0.0)
    verdicts: list[HarmonicVerdict] = []
    for block, compared in zip(model.blocks, judged, strict=True):
        answers: list[Verdict] = [decide(gain, largest) for gain in compared]
        verdicts += _judged(block, answers, labels)
    return HarmonicReport(model.order, tuple(verdicts))


def _gains(block: Harmonic, drive: np.ndarray) -> np.ndarray:
    """Gain of each mode of a harmonic, near frequencies together."""
    found = np.empty(block.omega2.size)
    for group, places in chains(block.omega2, block.tolerance):
        found[group] = gains(np.eye(group.size), drive[group].conj().T, places)
    return found


def _judged(block: Harmonic, answers: list[Verdict], labels: list[str]) -> list[HarmonicVerdict]:
    drive, found, verdicts = block.drive, _gains(block, block.drive), []
    stretch = np.abs(block.stretch)
    for i, answer in enumerate(answers):
        strength = np.abs(drive[i]) ** 2
        order = [k for k in np.argsort(-strength, kind="stable")[:_SHOWN] if strength[k] > 0]
        shown = order if answer == "yes" else []
        verdicts.append(
            HarmonicVerdict(
                harmonic=block.k,
                copies=block.copies,
                frequency=float(np.sqrt(abs(block.omega2[i])) / (2 * np.pi)),
                kind="flexible" if block.flexible[i] else "unstable" if block.omega2[i] < 0 else "mechanism",
                gain=float(found[i]),
                distance=float(found[i] / np.sqrt(2)),
                verdict=answer,
                reason=""
                if answer == "yes"
                else _reason(answer, stretch[:, i], stretch.max(initial=0.0), block.acting),
                tendons=tuple(labels[k] for k in shown),
                shares=tuple(float(strength[k] / strength.sum()) for k in shown),
            )
        )
    return verdicts


def _reason(answer: Verdict, stretch: np.ndarray, largest: float, acting: np.ndarray) -> str:
    if answer == "undecided":
        return "the drive is too near to rounding to be told from none in double precision"
    moved = stretch > _STILL * largest
    if not moved.any():
        return "not stretched at first order: the mode changes the length of no tendon"
    if not (moved & acting).any():
        return "unactuated: it stretches only tendons without actuator"
    return "the pulls of the actuated tendons on this mode cancel"
