"""Fewer states: balanced and modal truncation of stable systems, with their error bounds.

    balanced   |G - G_r|_inf <= 2 (sum of the Hankel values left out)          Moore 1981, Enns 1984, Glover 1984
    modal      |G - G_r|_inf <= sum of |C v_i| |w_i* B| / |Re lambda_i| of the poles left out

Balancing works on factors Z of the Gramians Z Z' (`analysis.gramian`), never on the Gramians: Hankel values are then
good to 1e-15 of the largest, where those from Gramians end at 1e-8. A mode without damping has no Gramian on an
infinite horizon, because it rings for ever: state a damping, a finite horizon, or reduce the controller of the closed
loop.
"""

from __future__ import annotations

from dataclasses import dataclass
from numbers import Integral

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Inexact

from tensctl.analysis.gramian import gramian, summed
from tensctl.errors import SynthesisError
from tensctl.scene.complaint import shown

# Hankel values below this part of the largest are rounding: states that nothing drives or nobody sees. Of a (4,1)
# shell ten such values are up to 1.3e-14, by the processor; the next one is 2e-3.
NOISE = 1e-13


@dataclass(frozen=True, eq=False)
class Truncated:
    """A system of fewer states, z_r = left z, z ~ right z_r.

    Attributes
    ----------
    A, B, C : matrices
    left, right : (r, n), (n, r)
    values : (n,)
        Hankel values, or the modal bounds of single poles, descending.
    bound : float or None
        No gain of the difference to the full system is larger, at any frequency; None where no bound is proven.
    """

    A: Inexact[np.ndarray, "r r"]
    B: Inexact[np.ndarray, "r m"]
    C: Inexact[np.ndarray, "p r"]
    left: Inexact[np.ndarray, "r n"]
    right: Inexact[np.ndarray, "n r"]
    values: Float[np.ndarray, " n"]
    bound: float | None

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    def error_at(self, omega: float, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> float:
        """Gain of the difference to the full system A, B, C at an angular frequency."""
        full = C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B)
        less = self.C @ np.linalg.solve(1j * omega * np.eye(self.order) - self.A, self.B.astype(complex))
        return float(np.linalg.norm(full - less, 2))

    def impulse_error(self, T: float, A: np.ndarray, B: np.ndarray, C: np.ndarray) -> float:
        """Root of the integral of the squared difference of the impulse responses up to T s."""
        factor = gramian(sla.block_diag(A, self.A), np.vstack([B, self.B]), T, None).factor
        return float(np.linalg.norm(np.hstack([C, -self.C]) @ factor))


def balanced(A: np.ndarray, B: np.ndarray, C: np.ndarray, order: int, *, sampled: bool = False) -> Truncated:
    """Balanced truncation of a stable system.

    Raises
    ------
    SynthesisError
        An order outside 1..n, or a system that is not stable.
    """
    check_order(order, len(A))
    reach, sight = gramian_factor(A, B, sampled=sampled), gramian_factor(A.T, C.T, sampled=sampled)
    return balance(A, B, C, reach, sight, order)


def balance(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, reach: np.ndarray, sight: np.ndarray, order: int
) -> Truncated:  # fmt: skip
    """Truncate by given factors of the Gramians; the bound holds for those of the infinite horizon."""
    check_order(order, len(A))
    directions = hankel(reach, sight)
    values = directions[1]
    count = int((values > NOISE * values[0]).sum())
    if order > count:
        raise SynthesisError(f"order is {order}, but only {count} states are both driven and seen; ask for fewer.")
    return cut(A, B, C, reach, sight, directions, order)


def hankel(reach: np.ndarray, sight: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """U, values and V' of the product of two factors: Hankel values, and the directions that they belong to."""
    return np.linalg.svd(sight.conj().T @ reach)


def cut(A, B, C, reach: np.ndarray, sight: np.ndarray, directions: tuple, order: int) -> Truncated:
    """The system on the first directions; real, or complex as a harmonic has it."""
    U, values, Vt = directions
    root = np.sqrt(values[:order])
    right = reach @ Vt[:order].conj().T / root
    left = (sight @ U[:, :order] / root).conj().T
    return Truncated(left @ A @ right, left @ B, C @ right, left, right, values, 2 * float(values[order:].sum()))


def modal(A: np.ndarray, B: np.ndarray, C: np.ndarray, order: int) -> Truncated:
    """Keep the poles with the largest bounds; conjugate pairs stay together, so an order may come out one smaller.

    Raises
    ------
    SynthesisError
        An order outside 1..n, or a pole without damping.
    """
    check_order(order, len(A))
    poles, vectors = np.linalg.eig(A)
    _check_stable(poles, sampled=False)
    rows = np.linalg.inv(vectors)
    gains = np.linalg.norm(C @ vectors, axis=0) * np.linalg.norm(rows @ B, axis=1) / np.abs(np.real(poles))
    upper = np.flatnonzero(np.imag(poles) >= 0)
    kept: list[int] = []
    count = 0
    for k in upper[np.argsort(-gains[upper], kind="stable")]:
        size = 1 + int(np.imag(poles[k]) > 0)
        if count + size <= order:
            kept.append(int(k))
            count += size
    right = np.hstack([_real(vectors[:, [k]]) for k in kept] or [np.zeros((len(A), 0))])
    # Rows that belong to Re v and Im v: those of the inverse of the whole real basis.
    basis = np.hstack([_real(vectors[:, [k]]) for k in [*kept, *(k for k in upper if k not in kept)]])
    left = np.linalg.inv(basis)[: right.shape[1]]
    rest = np.ones(len(A), bool)
    rest[kept] = False
    for k in kept:
        rest[np.abs(poles - poles[k].conj()).argmin()] = False
    values = np.sort(gains)[::-1]
    return Truncated(left @ A @ right, left @ B, C @ right, left, right, values, float(gains[rest].sum()))


def gramian_factor(A: np.ndarray, B: np.ndarray, *, sampled: bool = False) -> Inexact[np.ndarray, "n n"]:
    """Z with Z Z' the Gramian of (A, B) on an infinite horizon.

    Raises
    ------
    SynthesisError
        When A is not stable.
    """
    _check_stable(np.linalg.eigvals(A), sampled)
    return summed(A, B) if sampled else gramian(A, B, np.inf, None).factor


def check_order(order: int, size: int) -> None:
    """Refuse an order that is no whole number from 1 to the number of states."""
    whole = isinstance(order, Integral) and not isinstance(order, bool)
    if not (whole and 1 <= order <= size):
        raise SynthesisError(f"order is {shown(order)}; a whole number from 1 to {size} is expected.")


def _check_stable(poles: np.ndarray, sampled: bool) -> None:
    decay = 1 - np.abs(poles) if sampled else -np.real(poles) / np.abs(poles).max(initial=1e-300)
    if not decay.min(initial=np.inf) > len(poles) * np.finfo(float).eps:
        raise SynthesisError(
            "a mode is not damped: it rings for ever, so it has no Gramian and no bounded gain; state a damping, a "
            "finite horizon, or reduce the controller of the closed loop with lqg(..., order=...)."
        )


def _real(vectors: np.ndarray) -> np.ndarray:
    """Real basis of the span of an eigenvector and its conjugate, or of a real one."""
    parts = np.hstack([np.real(vectors), np.imag(vectors)])
    return parts if np.abs(parts[:, 1]).max() > 0 else parts[:, :1]
