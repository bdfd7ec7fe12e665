"""Controllability and observability of a cyclically symmetric structure by harmonic, as `analysis.modal` has them.

    in the unitary transform of the linear model B and C are block diagonal, so the gain of a mode of harmonic k is that
    of its eigenvector on B_k or C_k, and the modes of harmonics k and n - k, conjugates of each other, have the same

Near frequencies within a harmonic are judged together; those of different harmonics are driven by different
combinations of inputs and need not be. With dampers the eigenvectors are those of the damped A_k. An oscillating mode
of a complex harmonic has two, waves that run round the axis one way and the other, and what drives or sees one of them
more need not do so with the other: such a mode is two entries, one a wave.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tensctl.analysis.damped import DampedModes
from tensctl.analysis.modal import DOUBT, agreed, chains
from tensctl.analysis.nearness import gains
from tensctl.analysis.scaling import input_sizes
from tensctl.analysis.verdict import Verdict, decide
from tensctl.linear import HarmonicModel, HarmonicOutputs
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
        How many modes of the whole structure this is: 2 where harmonics k and n - k are two, else 1; 1 for each of the
        two waves of a damped mode.
    frequency : float, Hz
    kind : str
        "flexible", "mechanism" or "unstable".
    gain : float
        How strongly inputs drive it, or outputs see it, as in `ModeVerdict`.
    distance : float
        Smallest change of B (or C), in 2-norm, that would make the answer "no".
    verdict : "yes", "no" or "undecided"
    reason : str
        Why not yes; empty for yes.
    tendons : tuple of str
        Inputs (or outputs) of the first sector by strength, each standing for its images in all sectors.
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
    question : str
        "controllable" or "observable".
    """

    order: int
    modes: tuple[HarmonicVerdict, ...]
    question: str = "controllable"

    @property
    def count(self) -> int:
        """Number of modes of the whole structure."""
        return sum(mode.copies for mode in self.modes)

    @property
    def driven(self) -> int:
        """How many of them the tendons drive, or the outputs see."""
        return sum(mode.copies for mode in self.modes if mode.verdict == "yes")

    @property
    def weakest(self) -> HarmonicVerdict:
        """The mode with the smallest gain."""
        return min(self.modes, key=_gain)

    def __str__(self) -> str:
        """A line a harmonic: how many modes, how many driven, the weakest; then each mode that is not driven."""
        lines = [f"{self.driven} of {self.count} modes are {self.question}, in {self.order // 2 + 1} harmonics"]
        word = "driven" if self.question == "controllable" else "seen"
        for k in range(self.order // 2 + 1):
            own = [mode for mode in self.modes if mode.harmonic == k]
            if own:
                yes, least = sum(mode.verdict == "yes" for mode in own), min(own, key=_gain)
                by = ", ".join(least.tendons[:3]) or "none"
                lines.append(
                    f"harmonic {k:3d}  x {own[0].copies}  {yes} of {len(own)} {word}  "
                    f"weakest {least.frequency:.4g} Hz, gain {least.gain:.3g}, by {by}"
                )
        lines += [
            f"not {word}: harmonic {mode.harmonic}, {mode.frequency:.4g} Hz, {mode.verdict}: {mode.reason}"
            for mode in self.modes
            if mode.verdict != "yes"
        ]
        return "\n".join(lines)


Why = Callable[[Harmonic, int, Verdict], str]


@one_blas_thread()
def harmonic_controllability(model: HarmonicModel) -> HarmonicReport:
    """Which modes can tendons drive, how strongly, by which, and why not, at any size."""
    questions = []
    for block in model.blocks:
        first = model.map.first(block.k)
        labels = [model.dynamics.input_labels[i] for i in first]
        questions.append(_Asked(block, block.A.conj().T, block.B.conj().T, input_sizes(model, first), labels))
    return HarmonicReport(model.order, tuple(_verdicts(questions, _why_not_driven)), "controllable")


@one_blas_thread()
def harmonic_observability(outputs: HarmonicOutputs) -> HarmonicReport:
    """Which modes do outputs see, how strongly, by which, and why not, at any size.

    Parameters
    ----------
    outputs : HarmonicOutputs
        From `harmonic_outputs(model, ["lengths"])`.
    """
    model = outputs.model
    C = [outputs.C(block) for block in model.blocks]
    largest = np.max([np.abs(own).max(axis=1, initial=0.0) for own in C], axis=0)
    sizes, labels = np.where(largest > 0, largest, 1.0), outputs.sector_labels
    questions = [_Asked(block, block.A, own, sizes, labels) for block, own in zip(model.blocks, C, strict=True)]
    return HarmonicReport(model.order, tuple(_verdicts(questions, _why_not_seen)), "observable")


@dataclass(frozen=True, eq=False)
class _Asked:
    """What is asked about one harmonic: eigenvectors of a matrix, and rows that see them."""

    block: Harmonic
    matrix: np.ndarray
    rows: np.ndarray
    sizes: np.ndarray
    labels: Sequence[str]

    def three(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Gains as shown, as judged, and as judged when frequencies are blurred more than they need be; (m, waves)."""
        gains_of = self._damped() if self.block.dynamics.damped else self._undamped
        scaled = self.rows / self.sizes[:, None]
        return gains_of(self.rows, 1.0), gains_of(scaled, 1.0), gains_of(scaled, DOUBT)

    def seen(self, rows: np.ndarray) -> np.ndarray:
        """What rows see of each undamped mode, (rows, m)."""
        half = self.block.omega2.size
        return rows[:, :half] + 1j * rows[:, half : 2 * half]

    def _undamped(self, rows: np.ndarray, blur: float) -> np.ndarray:
        """Gain of each mode, near frequencies together."""
        found, seen = np.empty((self.block.omega2.size, 1)), self.seen(rows)
        for group, places in chains(self.block.omega2, blur * self.block.tolerance):
            found[group, 0] = gains(np.eye(group.size), seen[:, group], places)
        return found

    def _damped(self) -> Callable[[np.ndarray, float], np.ndarray]:
        """Gains of both waves where a mode is two, else the weaker of its eigenvectors' gains."""
        modes = DampedModes.of(self.matrix, np.arange(self.block.nx), self.block.omega2.size)
        waves = np.imag(modes.eigenvalues).prod(axis=1) < 0

        def both(rows: np.ndarray, blur: float) -> np.ndarray:
            found = modes.both(rows, blur)
            if self.block.copies == 1:
                return found.min(axis=1, keepdims=True, initial=np.inf)
            return np.where(waves[:, None], found, found.min(axis=1, keepdims=True, initial=np.inf))

        return both


def _verdicts(questions: Sequence[_Asked], why_not: Why) -> list[HarmonicVerdict]:
    """Verdicts by harmonic, every gain compared with the largest of all."""
    found = [asked.three() for asked in questions]
    largest, most = (max((three[k].max(initial=0.0) for three in found), default=0.0) for k in (1, 2))
    verdicts = []
    for asked, (shown, judged, doubted) in zip(questions, found, strict=True):
        strengths = np.abs(asked.seen(asked.rows)) ** 2
        for i, wave in np.ndindex(*shown.shape):
            answer = agreed(decide(float(judged[i, wave]), largest), decide(float(doubted[i, wave]), most))
            verdicts.append(_verdict(asked, i, shown[i], wave, answer, strengths[:, i], why_not))
    return verdicts


def _verdict(
    asked: _Asked, i: int, found: np.ndarray, wave: int, answer: Verdict, strength: np.ndarray, why_not: Why
) -> HarmonicVerdict:  # fmt: skip
    block = asked.block
    order = [k for k in np.argsort(-strength, kind="stable")[:_SHOWN] if strength[k] > 0]
    shown = order if answer == "yes" else []
    return HarmonicVerdict(
        harmonic=block.k,
        copies=block.copies // found.size,
        frequency=float(np.sqrt(abs(block.omega2[i])) / (2 * np.pi)),
        kind="flexible" if block.flexible[i] else "unstable" if block.omega2[i] < 0 else "mechanism",
        gain=float(found[wave]),
        distance=float(found[wave] / np.sqrt(2)),
        verdict=answer,
        reason="" if answer == "yes" else why_not(block, i, answer),
        tendons=tuple(str(asked.labels[k]) for k in shown),
        shares=tuple(float(strength[k] / strength.sum()) for k in shown),
    )


def _why_not_driven(block: Harmonic, i: int, answer: Verdict) -> str:
    if answer == "undecided":
        return "the drive is too near to rounding to be told from none in double precision"
    stretch = np.abs(block.stretch)
    moved = stretch[:, i] > _STILL * stretch.max(initial=0.0)
    if not moved.any():
        return "not stretched at first order: the mode changes the length of no tendon"
    if not (moved & block.acting).any():
        return "unactuated: it stretches only tendons without actuator"
    return "the pulls of the actuated tendons on this mode cancel"


def _why_not_seen(block: Harmonic, i: int, answer: Verdict) -> str:
    if answer == "undecided":
        return "the trace in the outputs is too near to rounding to be told from none in double precision"
    return "no output changes with this mode at first order"
