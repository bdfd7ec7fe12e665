"""Balanced truncation of a cyclically symmetric model, harmonic by harmonic.

    G = diag(G_k) in unitary transforms of u and y,   |G - G_r| = max_k |G_k - G_r,k| <= max_k 2 sum_left sigma_k,i

with H-infinity norms. The Hankel values of the whole are those of all harmonics together, and the largest are kept, as
`truncate` keeps them. Its bound sums over all that is left out; this one only within a harmonic, and is sharper. What
remains is symmetric again, and is written out as a real model of few states with all inputs and outputs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Inexact

from tensctl.analysis.gramian import gramian
from tensctl.analysis.harmonic_gramian import block_oscillators
from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicOutputs
from tensctl.linear.harmonic_block import Harmonic
from tensctl.linear.outputs import safe_label
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.synthesis.harmonic_riccati import by_harmonic
from tensctl.synthesis.truncation import NOISE, Truncated, check_order, cut, gramian_factor, hankel
from tensctl.threads import one_blas_thread

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False)
class HarmonicReduced:
    """A symmetric model of fewer states.

    Attributes
    ----------
    outputs : HarmonicOutputs
        What it shows, and the model that was truncated.
    damped : tuple of (nx, nx)
        State matrix of each harmonic, with the damping that was stated.
    blocks : tuple of Truncated
        What is left of each harmonic; of some nothing.
    horizon : float or None, s
    """

    outputs: HarmonicOutputs
    damped: tuple[Inexact[np.ndarray, "nx nx"], ...]
    blocks: tuple[Truncated, ...]
    horizon: float | None

    @property
    def order(self) -> int:
        """Real states that are left of the whole structure."""
        return sum(block.copies * own.order for block, own in self._pairs)

    @cached_property
    def values(self) -> Float[np.ndarray, " nx"]:
        """Hankel values of the whole structure, descending."""
        return np.sort(np.concatenate([np.tile(own.values, block.copies) for block, own in self._pairs]))[::-1]

    @property
    def bound(self) -> float | None:
        """No gain of the difference is larger at any frequency; None for a finite horizon."""
        return None if self.horizon is not None else max(own.bound or 0.0 for own in self.blocks)

    def error_at(self, omega: float) -> float:
        """Gain of the difference to the full model at an angular frequency: the largest of all harmonics."""
        return max(self._error(k, w) for k in range(len(self.blocks)) for w in (omega, -omega))

    def impulse_error(self, T: float) -> float:
        """Root of the integral of the squared difference of the impulse responses up to T s."""
        squares = 0.0
        for (block, own), A in zip(self._pairs, self.damped, strict=True):
            squares += block.copies * own.impulse_error(T, A, block.B, self.outputs.C(block)) ** 2
        return float(np.sqrt(squares))

    @cached_property
    def matrices(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A, B, C, D of the reduced model in real states 2^1/2 (Re z_k, Im z_k), or z_k where that is real."""
        linear = self.outputs.model
        inputs, shown = linear.map.waves(np.eye(linear.nu)), self.outputs.waves(np.eye(len(self.outputs.labels)))
        parts, D = [], np.zeros((len(self.outputs.labels), linear.nu))
        for (block, own), U, Y in zip(self._pairs, inputs, shown, strict=True):
            back = Y.conj().T
            part = own.A, own.B @ U, back @ own.C
            parts.append(_real(*part) if block.copies == 2 else part)
            D += block.copies * np.real(back @ (self.outputs.D(block) @ U))
        A, B, C = zip(*parts, strict=True)
        return sla.block_diag(*A), np.vstack(B), np.hstack(C), D

    def to_statespace(self) -> control.StateSpace:
        """The reduced model as a `control.StateSpace` with all inputs and outputs of the structure."""
        import control

        labels = [f"u_{safe_label(label)}" for label in self.outputs.model.dynamics.input_labels]
        system = control.ss(*self.matrices, inputs=labels, outputs=list(self.outputs.labels))
        assert isinstance(system, control.StateSpace)
        return system

    @property
    def _pairs(self) -> list[tuple[Harmonic, Truncated]]:
        return list(zip(self.outputs.model.blocks, self.blocks, strict=True))

    def _error(self, k: int, omega: float) -> float:
        block, own = self._pairs[k]
        return own.error_at(omega, self.damped[k], block.B, self.outputs.C(block))


@one_blas_thread()
def harmonic_truncate(
    outputs: HarmonicOutputs, order: int, *, damping: float | None = None, horizon: float | None = None
) -> HarmonicReduced:
    """Reduce a symmetric model to the states that matter most between its inputs and some outputs.

    Parameters
    ----------
    outputs : HarmonicOutputs
        From `harmonic_outputs`; they say what is to be kept.
    order : int
        States wanted; one less where the last would part a harmonic from its conjugate.
    damping : float, optional
        Damping ratio added to every mode; stated, since the structure has no other.
    horizon : float, s, optional
        Balance what happens up to this time only; needs no damping, and gives no bound.

    Raises
    ------
    SynthesisError
        An undamped structure with neither of them, or an order that is not there.
    """
    check_kind(HarmonicOutputs, outputs=outputs)
    linear = outputs.model
    check_order(order, linear.nx)
    if horizon is not None:
        horizon = argument("horizon", horizon, Number("s", above=0))
    if damping is not None:
        damping = argument("damping", damping, Number("a damping ratio", above=0))
    damped = tuple(_damped(block, damping) for block in linear.blocks)

    def factors(block: Harmonic) -> tuple[np.ndarray, np.ndarray]:
        A, B, C = damped[block.k], block.B, outputs.C(block)
        if horizon is None:
            return gramian_factor(A, B), gramian_factor(A.conj().T, C.conj().T)
        modes = block_oscillators(block) if damping is None else None
        sight = gramian(A.conj().T, C.conj().T, horizon, modes, transposed=True)
        return gramian(A, B, horizon, modes).factor, sight.factor

    both = by_harmonic(linear, factors)
    directions = [hankel(*pair) for pair in both]
    orders = _chosen([values for _, values, _ in directions], [block.copies for block in linear.blocks], order)
    blocks = []
    for block, A, pair, own, size in zip(linear.blocks, damped, both, directions, orders, strict=True):
        less = cut(A, block.B, outputs.C(block), *pair, own, size)
        blocks.append(less if horizon is None else replace(less, bound=None))
    return HarmonicReduced(outputs, damped, tuple(blocks), horizon)


def _chosen(values: list[np.ndarray], copies: list[int], order: int) -> list[int]:
    """How many states each harmonic keeps, the largest values of all first."""
    largest = max(own.max(initial=0.0) for own in values)
    ranked = sorted(((float(v), k) for k, own in enumerate(values) for v in own), key=lambda pair: -pair[0])
    there = sum(copies[k] for value, k in ranked if value > NOISE * largest)
    if order > there:
        raise SynthesisError(f"order is {order}, but only {there} states are both driven and seen; ask for fewer.")
    orders, total = [0] * len(values), 0
    for _, k in ranked:
        total += copies[k]
        if total > order:
            break
        orders[k] += 1
    return orders


def _damped(block: Harmonic, ratio: float | None) -> np.ndarray:
    """State matrix with 2 ratio omega on the speed of every mode."""
    if ratio is None:
        return block.A
    speeds = np.zeros(block.nx)
    speeds[block.omega2.size : 2 * block.omega2.size] = 2 * ratio * block.scales
    return block.A - np.diag(speeds)


def _real(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Real matrices of a complex harmonic and its conjugate."""
    a, b, root = np.real(A), np.imag(A), np.sqrt(2)
    turned = np.hstack([np.real(C), -np.imag(C)])
    return np.block([[a, -b], [b, a]]), root * np.vstack([np.real(B), np.imag(B)]), root * turned
