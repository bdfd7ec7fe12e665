"""Gramians of a cyclically symmetric structure, harmonic by harmonic, and the energies that they tell.

    W = sum_k T_k* W_k T_k over all n harmonics,   W_k(T) = int_0^T e^(A_k t) B_k R_k^-1 B_k* e^(A_k* t) dt = L_k L_k*

with the unitary change of basis T_k, so energies of the whole structure are

    c'x from rest to one   1 / sum_k |L_k* c_k|^2          the state x from rest   sum_k |L_k^-1 x_k|^2

Factors are doubled as in `analysis.gramian`, and are of sector size. The energy of one output in the world's axes needs
3 x 3 sums over harmonics, and those of its images come by turning them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Inexact

from tensctl.analysis.gramian import Gramian, Oscillators, Verified, gramian
from tensctl.analysis.scaling import tension_slopes
from tensctl.errors import LinearizationError
from tensctl.linear import HarmonicModel, HarmonicOutputs, LinearModel
from tensctl.linear.harmonic_block import Harmonic
from tensctl.threads import one_blas_thread

States = Sequence[Inexact[np.ndarray, " _"]]


@dataclass(frozen=True, eq=False)
class HarmonicGramian(Verified):
    """A Gramian by harmonics.

    Attributes
    ----------
    linear : HarmonicModel
    horizon : float, s
    blocks : tuple of Gramian
        k = 0 ... n/2.
    """

    linear: HarmonicModel
    horizon: float
    blocks: tuple[Gramian, ...]

    @property
    def spread(self) -> float:
        """Energy of the dearest direction over that of the cheapest; infinite where one cannot be reached."""
        values = np.concatenate([np.linalg.svd(block.factor, compute_uv=False) for block in self.blocks])
        return float((values.max() / values.min()) ** 2) if values.min() > 0 else np.inf

    def outputs(self, outputs: HarmonicOutputs) -> Float[np.ndarray, " ny"]:
        """Least int u'Ru dt that brings each output alone from rest to one unit; J s per squared unit.

        Feedthrough is left out: tensions count by what the state moves of them.
        """
        reach = outputs.squares([outputs.C(b) @ g.factor for b, g in self._pairs])
        with np.errstate(divide="ignore"):
            return 1.0 / reach

    def energies(self, outputs: HarmonicOutputs, directions: Float[np.ndarray, "k ny"]) -> Float[np.ndarray, " k"]:
        """Least int u'Ru dt that brings each d'y from rest to one; the rest of x may end anywhere."""
        waves = outputs.waves(np.asarray(directions, float).T)
        parts = zip(self._pairs, waves, strict=True)
        reach = sum((b.copies * g.reach(d.conj().T @ outputs.C(b)) for (b, g), d in parts), np.zeros(()))
        with np.errstate(divide="ignore"):
            return 1.0 / reach

    def state_energy(self, states: States) -> float:
        """Least int u'Ru dt that brings the whole state from rest to x, given by harmonic."""
        parts = zip(self._pairs, states, strict=True)
        return float(sum(block.copies * own.state_energies(x[None])[0] for (block, own), x in parts))

    def shown(self, states: States) -> float:
        """Value of x'Wx for x by harmonic: of an observability Gramian int |y|^2 dt from the state x."""
        parts = zip(self._pairs, states, strict=True)
        return float(sum(block.copies * own.reach(x.conj()[None])[0] for (block, own), x in parts))

    @cached_property
    def joules(self) -> tuple[Float[np.ndarray, " modes"], ...]:
        """Least int u'Ru dt for one joule in each mode of each harmonic, J s."""
        found = []
        for block, own in self._pairs:
            half = block.omega2.size
            pairs = np.stack([own.factor[:half], own.factor[half : 2 * half]], axis=1)
            with np.errstate(divide="ignore"):
                found.append(2.0 / np.linalg.norm(pairs, 2, axis=(1, 2)) ** 2 if half else np.zeros(0))
        return tuple(found)

    def dense(self, linear: LinearModel) -> Float[np.ndarray, "nx nx"]:
        """W in the states of a dense model of the same equilibrium, for sizes that have one."""
        parts = zip(self._pairs, self.linear.changed_basis(linear), strict=True)
        half = [np.sqrt(block.copies) * (T.conj().T @ own.factor) for (block, own), T in parts]
        return sum((np.real(L @ L.conj().T) for L in half), np.zeros(()))

    @property
    def residual(self) -> float:
        """What the equation of W leaves of the whole structure, over the norms of its terms."""
        copies = np.array([block.copies for block in self.linear.blocks])
        left = np.array([own.left[0] for own in self.blocks])
        terms = np.array([own.left[1] for own in self.blocks])
        total = float(np.sqrt(copies @ terms**2).sum())
        return float(np.sqrt(copies @ left**2)) / total if total > 0 else 0.0

    def __str__(self) -> str:
        """The cheapest and the dearest mode, in sentences."""
        flat = [(float(value), k) for k, own in enumerate(self.joules) for value in own]
        (least, low), (most, high) = min(flat), max(flat)
        return (
            f"least int u'Ru dt within {self.horizon:g} s, all else free to end anywhere:\n"
            f"  one joule in a mode, J s: from {least:.3g} (harmonic {low}) to {most:.3g} (harmonic {high})\n"
            f"  states: the dearest direction costs {self.spread:.3g} times the cheapest"
        )

    @property
    def _pairs(self) -> list[tuple[Harmonic, Gramian]]:
        return list(zip(self.linear.blocks, self.blocks, strict=True))


@one_blas_thread()
def harmonic_controllability_gramian(
    linear: HarmonicModel, horizon: float, *, weights: Float[np.ndarray, " nu"] | None = None
) -> HarmonicGramian:
    """What the tendons reach from rest within a time; `controllability_gramian` at any size.

    Parameters
    ----------
    horizon : float, s
        Infinite for a damped model.
    weights : (nu,), optional
        R of int u'Ru dt, the same for all images of an input; dT/du of each tendon by default.

    Raises
    ------
    LinearizationError
        For a horizon that is not positive, infinite without damping, or weights that break the symmetry.
    """
    R = tension_slopes(linear) if weights is None else np.asarray(weights, float)
    if R.shape != (linear.nu,) or not (R > 0).all():
        raise LinearizationError(f"weights have shape {R.shape}; {linear.nu} numbers > 0 are expected.")
    if weights is not None and not linear.map.alike(R):
        raise LinearizationError(
            "weights differ between images of one input; give all images the same, or use the dense Gramian."
        )
    blocks = [
        gramian(block.A, block.B / np.sqrt(R[linear.map.first(block.k)]), horizon, block_oscillators(block))
        for block in linear.blocks
    ]
    return HarmonicGramian(linear, float(horizon), tuple(blocks))


@one_blas_thread()
def harmonic_observability_gramian(outputs: HarmonicOutputs, horizon: float) -> HarmonicGramian:
    """What outputs show of a state within a time: int |y|^2 dt = x'Wx; `observability_gramian` at any size.

    Raises
    ------
    LinearizationError
        For a horizon that is not positive, or infinite without damping.
    """
    blocks = [
        gramian(b.A.conj().T, outputs.C(b).conj().T, horizon, block_oscillators(b), transposed=True)
        for b in outputs.model.blocks
    ]
    return HarmonicGramian(outputs.model, float(horizon), tuple(blocks))


def block_oscillators(block: Harmonic) -> Oscillators | None:
    """The modes of a harmonic without damping; None with it."""
    return None if block.dynamics.damped else Oscillators(block.omega2, block.scales, np.arange(block.nx))
