"""Disk margins of a cyclically symmetric loop, of all inputs at once: the least of its harmonics.

    |S - I/2|_inf = max_k |S_k - I/2|_inf   over all n harmonics

since the transform of inputs is unitary. Harmonics k and n - k together are a real system of twice the size,
M -> [Re M, -Im M; Im M, Re M], whose norm over w >= 0 is that of harmonic k over all w.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from tensctl.synthesis.margins import Sensitivity


def enclosed_margin(harmonics: Iterable[Sensitivity]) -> tuple[float, float]:
    """Least and largest value that alpha of all inputs at once can have, as `Sensitivity.enclosure` tells it."""
    least, largest = zip(*(_real(one).enclosure() for one in harmonics), strict=True)
    return min(least), min(largest)


def _real(one: Sensitivity) -> Sensitivity:
    if not any(np.iscomplexobj(M) for M in (one.A, one.B, one.C)):
        return one
    return replace(one, A=_both(one.A), B=_both(one.B), C=_both(one.C))


def _both(M: np.ndarray) -> np.ndarray:
    a, b = np.real(M), np.imag(M)
    return np.block([[a, -b], [b, a]])
