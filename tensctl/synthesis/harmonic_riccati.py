"""Riccati equations harmonic by harmonic: refusals by harmonic, one residual and one proof of stability for the whole.

    |left side|^2 = sum_k |left side of harmonic k|^2 over all n harmonics, and so for each term

since the transform is unitary. A loop L is stable when P > 0 and L*P + PL < 0, or L*PL - P < 0 when it is sampled, for
the P of its own equation: two Cholesky factors a harmonic, eigenvalues only where rounding leaves them undecided.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar

import numpy as np

from tensctl.analysis import HarmonicReport
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel
from tensctl.linear.harmonic_block import Harmonic
from tensctl.synthesis.crossed import left_over
from tensctl.synthesis.gain_doubt import Doubt, doubt_of_all
from tensctl.synthesis.weights import Cost

Solved = TypeVar("Solved")
# A, B, cost and P of one harmonic.
Equation = tuple[np.ndarray, np.ndarray, Cost, np.ndarray]


def by_harmonic(linear: HarmonicModel, solve: Callable[[Harmonic], Solved]) -> list[Solved]:
    """What is solved of each harmonic.

    Raises
    ------
    SynthesisError
        With the number of the harmonic before the sentence.
    """
    found = []
    for block in linear.blocks:
        try:
            found.append(solve(block))
        except SynthesisError as fault:
            raise SynthesisError(f"harmonic {block.k}: {fault}") from fault
    return found


def name_lost(linear: HarmonicModel, report: Callable[[], HarmonicReport], how: str, wanted: str) -> None:
    """Refuse by name the first mode of an undamped structure that is out of reach, if there is one."""
    lost = [] if linear.dynamics.damped else [mode for mode in report().modes if mode.verdict != "yes"]
    if lost:
        first, count = lost[0], sum(mode.copies for mode in lost)
        raise SynthesisError(
            f"harmonic {first.harmonic}: a mode at {first.frequency:.4g} Hz, one of {count}, is neither damped nor "
            f"{how}: {first.reason}; give {wanted}, or some damping."
        )


def residual_of(linear: HarmonicModel, equations: Iterable[Equation], *, sampled: bool) -> float:
    """What is left of the equation of the whole structure, over the sum of its terms."""
    lefts, terms = zip(*(left_over(*one, sampled=sampled) for one in equations), strict=True)
    copies = np.array([block.copies for block in linear.blocks])
    total = np.sqrt(copies @ np.square(terms)).sum()
    return float(np.sqrt(copies @ np.square(lefts)) / total) if total > 0 else 0.0


def doubt_of(linear: HarmonicModel, doubts: Iterable[Doubt]) -> float:
    """Estimated relative change of the gain of the whole structure, from those of its harmonics."""
    return doubt_of_all(list(doubts), np.array([block.copies for block in linear.blocks])).relative


def stable(loop: np.ndarray, P: np.ndarray, *, sampled: bool = False) -> bool:
    """Whether every pole of a loop is stable."""
    half = P @ loop
    decay = P - loop.conj().T @ half if sampled else -(half + half.conj().T)
    try:
        np.linalg.cholesky(P)
        np.linalg.cholesky(0.5 * (decay + decay.conj().T))
    except np.linalg.LinAlgError:
        poles = np.linalg.eigvals(loop)
        return bool(np.abs(poles).max() < 1) if sampled else bool(poles.real.max() < 0)
    return True


def poles_of(linear: HarmonicModel, loops: Iterable[np.ndarray]) -> np.ndarray:
    """Eigenvalues of the loop of the whole structure."""
    found = []
    for block, loop in zip(linear.blocks, loops, strict=True):
        values = np.linalg.eigvals(loop).astype(complex)
        found += [values, values.conj()][: block.copies]
    return np.concatenate(found)
