"""Weights of a harmonic LQR: one Hermitian block a harmonic, checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel

Blocks = Sequence[np.ndarray]

# A weight that is skew or negative by less than this part of itself is so by rounding (as in `lqr`).
_SKEW = 1e-12


def state_weights(linear: HarmonicModel, Q: Blocks | None) -> tuple[np.ndarray, ...]:
    """Q_k; identity by default.

    Raises
    ------
    SynthesisError
        For blocks of the wrong number or shape, or a negative weight.
    """
    sizes = [block.nx for block in linear.blocks]
    if Q is None:
        return tuple(np.eye(size) for size in sizes)
    return _checked("Q", Q, sizes, positive=False)


def input_weights(linear: HarmonicModel, R: np.ndarray | Blocks | None) -> tuple[np.ndarray, ...]:
    """R_k; the stiffness of each tendon by default, and the same for every harmonic when one array is given.

    Raises
    ------
    SynthesisError
        For blocks of the wrong number or shape, or a weight that is not positive.
    """
    count, first = len(linear.blocks), [linear.map.first(k) for k in range(len(linear.blocks))]
    if R is None:
        stiffness = input_stiffness(linear)
        R = [np.diag(stiffness[own]) for own in first]
    same = isinstance(R, np.ndarray) and R.ndim == 2
    blocks = [np.asarray(R)] * count if same else [np.asarray(block) for block in R]
    return _checked("R", blocks, [own.size for own in first], positive=True)


def _checked(name: str, blocks: Blocks, sizes: list[int], *, positive: bool) -> tuple[np.ndarray, ...]:
    if len(blocks) != len(sizes):
        raise SynthesisError(
            f"{name} has {len(blocks)} blocks; {len(sizes)} are expected, one for each harmonic 0 ... n/2."
        )
    for k, (block, size) in enumerate(zip(blocks, sizes, strict=True)):
        if np.shape(block) != (size, size):
            raise SynthesisError(f"{name} of harmonic {k} has shape {np.shape(block)}; ({size}, {size}) is expected.")
        scale = np.abs(block).max(initial=0.0)
        if not np.isfinite(scale):
            raise SynthesisError(f"{name} of harmonic {k} has entries that are no finite numbers.")
        if np.abs(block - block.conj().T).max(initial=0.0) > _SKEW * scale:
            raise SynthesisError(f"{name} of harmonic {k} is not Hermitian; give ({name} + {name}*)/2.")
        smallest = np.linalg.eigvalsh(block).min(initial=np.inf)
        if (positive and smallest <= 0) or smallest < -_SKEW * scale * size:
            wanted = "every input needs a positive cost" if positive else "weights are never negative"
            raise SynthesisError(f"{name} of harmonic {k} has the eigenvalue {smallest:.3g}; {wanted}.")
    return tuple(np.asarray(block) for block in blocks)
