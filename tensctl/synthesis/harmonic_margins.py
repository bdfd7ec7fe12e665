"""Disk margins of a cyclically symmetric loop from those of its harmonics.

    |S - I/2|_inf = max_k |S_k - I/2|_inf,   S_ii = 1/l sum_k (S_k)_pp   over all l harmonics that input p has

since the transform of inputs is unitary and S_ii is the same for all images of an input: n of them, or l of a motor
that comes back to itself after l turns. Harmonic n - k has at -w the gains that k has at w.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tensctl.linear import HarmonicModel
from tensctl.synthesis.margins import STATES, DiskMargin, Sensitivity
from tensctl.synthesis.single_peaks import Expansion
from tensctl.threads import one_blas_thread

# Poles of the whole loop up to which one input alone is asked for in passing; 2.5 s at 5948 of sampled LQR at (20,10).
_POLES = 10_000


@dataclass(frozen=True, eq=False)
class HarmonicSensitivity:
    """S of a symmetric loop; its margins are named as those of `Sensitivity`.

    Attributes
    ----------
    linear : HarmonicModel
    blocks : tuple of Sensitivity
        S_k of each harmonic.
    """

    linear: HarmonicModel
    blocks: tuple[Sensitivity, ...]

    @property
    def costly(self) -> str | None:
        """Why `all_inputs` is better not asked for in passing; None where it takes seconds."""
        sizes = np.array([len(one.A) for one in self.blocks])
        copies = np.array([block.copies for block in self.linear.blocks])
        # Complex arithmetic takes four times as much.
        if np.cbrt((copies**2 * sizes.astype(float) ** 3).sum()) <= STATES:
            return None
        blocks = f"{sizes.size} harmonics of up to {sizes.max()} states"
        return f"left out of large loops: {blocks} take tens of seconds or minutes"

    @property
    def costly_alone(self) -> str | None:
        """Why `weakest_input` is better not asked for in passing; None where it takes seconds."""
        n = sum(block.copies * len(one.A) for block, one in zip(self.linear.blocks, self.blocks, strict=True))
        return (
            None if n <= _POLES else f"left out beyond {_POLES} poles: a loop of {n} takes tens of seconds or minutes"
        )

    @cached_property
    @one_blas_thread()
    def all_inputs(self) -> DiskMargin:
        """When all inputs change at once, each in its own way."""
        found = [one.all_inputs for one in self.blocks]
        last = min(found, key=lambda margin: margin.largest)
        return DiskMargin(min(margin.alpha for margin in found), last.largest, last.frequency)

    @cached_property
    @one_blas_thread()
    def weakest_input(self) -> tuple[DiskMargin, int]:
        """The least margin of an input that changes alone, and the position in u of the first of its images."""
        peak, which = self._expansion.largest()
        return DiskMargin.of(peak), int(self.linear.map.first(0)[which])

    def enclosure(self) -> tuple[float, float]:
        """Least and largest value that alpha of all inputs at once can have."""
        return self.all_inputs.alpha, self.all_inputs.largest

    @property
    def _expansion(self) -> Expansion:
        """S_ii of the first input of each orbit by the poles of all harmonics."""
        own = self.linear.map
        images = {int(u): len(group) for group in (own.inputs, *own.shared) for u in group[0]}
        rows = {u: row for row, u in enumerate(own.first(0).tolist())}
        poles, residues, error = [], [], 0.0
        for block, one in zip(self.linear.blocks, self.blocks, strict=True):
            part = Expansion.of(one.A, one.B, one.C, 0.5, one.dt)
            inputs = own.first(block.k).tolist()
            own_residues = np.zeros((len(rows), len(part.poles)), complex)
            own_residues[[rows[u] for u in inputs]] = part.residues / np.array([[images[u]] for u in inputs])
            poles += [part.poles, part.poles.conj()][: block.copies]
            residues += [own_residues, own_residues.conj()][: block.copies]
            error += block.copies * part.error / min(images.values())
        return Expansion(np.concatenate(poles), np.hstack(residues), 0.5, self.blocks[0].dt, error)
