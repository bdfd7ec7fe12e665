"""Undamped modes that no weight sees: with one of them a Riccati equation has no stabilising solution.

    A v = i omega v,   Q v = 0        (after Hautus, with A - B R^-1 N' and Q - N R^-1 N' where there is a cross term)

To move such a mode costs input and saves nothing, so the least cost leaves it as it is. A damped mode that is not
seen decays by itself. Of a filter A' stands for A and the noise that drives the states for Q. Weights of a sampled
loop are integrals over a period and see what the continuous ones see, cross terms or not: a ramp is no oscillation.

A group of poles within rounding of each other is asked as one: singular directions of Q in its span. Q tells nothing
below the rounding of the products that make up v'Qv, which is as small as the group's own entries are.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float, Inexact

from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, LinearModel
from tensctl.synthesis.stabilisable import name_directions, pole_groups, side_by_side
from tensctl.synthesis.weights import Cost

# A direction whose weight is the square of this part of the largest weight is not seen for certain.
_SEEN = 1e-9
# Part of |Q| by which Q + A'QA / |A|^2 has to be definite to say without eigenvectors that every mode is seen.
_CLEAR = 1e-12
# Modes that a refusal names; more are counted.
_NAMED = 3

WEIGHTS = (
    "the weights do not see {modes}, which nothing damps, so no gain is both optimal and stabilising; weigh energy as "
    "well (energy in tc.weights, or part of the identity added to Q), or add damping."
)
NOISE = (
    "force_noise does not drive {modes}, which nothing damps, so no filter is both optimal and stable; give noise to "
    "nodes that move in it, or add damping."
)


def check_seen(
    linear: LinearModel, basis: Float[np.ndarray, "nx n"], A: np.ndarray, cost: Cost, B: np.ndarray | None = None,
    *, sentence: str = WEIGHTS,
) -> None:  # fmt: skip
    """Refuse weights of a flexible model, all in the coordinates of a basis, that do not see an undamped mode.

    Raises
    ------
    SynthesisError
        With the modes and their frequencies.
    """
    order = side_by_side(linear) if basis.shape[1] == len(basis) else np.arange(basis.shape[1])
    found = [basis[:, order] @ v for _, v in unseen(A, cost, B, order)]
    if not found:
        return
    lost = sla.orth(np.hstack([part for v in found for part in (np.real(v), np.imag(v))]), rcond=1e-6)
    modes = name_directions(linear, lost)
    raise SynthesisError(sentence.format(modes=_listed([f"mode {m.index} at {m.frequency:.4g} Hz" for m in modes])))


def check_seen_by_harmonic(
    linear: HarmonicModel,
    parts: Sequence[tuple[np.ndarray, Cost, np.ndarray | None]],
    *,
    sentence: str = WEIGHTS,
) -> None:
    """Refuse weights (A, cost, B of each harmonic) that do not see an undamped mode.

    Raises
    ------
    SynthesisError
        With the frequencies and the harmonics that hold them.
    """
    found = []
    for block, (A, cost, B) in zip(linear.blocks, parts, strict=True):
        for pole, v in unseen(A, cost, B, np.argsort(np.arange(len(A)) % max(block.omega2.size, 1), kind="stable")):
            if pole.imag >= 0:
                said = f"a mode of harmonic {block.k} at {pole.imag / (2 * np.pi):.4g} Hz"
                found += [said] * (block.copies * v.shape[1])
    if found:
        raise SynthesisError(sentence.format(modes=_listed(found)))


def unseen(
    A: Inexact[np.ndarray, "n n"], cost: Cost, B: np.ndarray | None = None, order: np.ndarray | None = None
) -> Iterator[tuple[complex, Inexact[np.ndarray, "n k"]]]:
    """Undamped poles of A and the orthonormal directions of each that a weight does not see.

    Parameters
    ----------
    A : (n, n)
    cost : Cost
    B : (n, m), optional
        Takes part with the cross weight of a continuous cost; without it the cross weight is left aside.
    order : (n,) int, optional
        Order in which position and rate of each mode are neighbours; directions come in that order.
    """
    Q, size = cost.Q, np.abs(cost.Q)
    if B is not None and cost.N.any():
        answer = np.linalg.solve(cost.R, cost.N.conj().T)
        taken = cost.N @ answer
        A, Q, size = A - B @ answer, Q - taken, size + np.abs(taken)
    if _all_seen(A, Q):
        return
    if order is not None:
        A, Q, size = (M[order][:, order] for M in (A, Q, size))
    rounding = 10 * len(A) * np.finfo(float).eps
    poles, vectors = np.linalg.eig(A)
    noise, largest = rounding * np.linalg.norm(A, 2), np.linalg.norm(size, 2)
    for pole, v in pole_groups(poles, vectors, np.abs(np.real(poles)) <= noise, noise):
        weights, turned = np.linalg.eigh(v.conj().T @ Q @ v)
        own = np.linalg.norm(np.abs(v).T @ size @ np.abs(v), 2)
        lost = weights <= max(_SEEN**2 * largest, rounding * own)
        if lost.any():
            yield pole, v @ turned[:, lost]


def _all_seen(A: np.ndarray, Q: np.ndarray) -> bool:
    """Whether Q + A'QA / |A|^2 is clearly definite: Qv = 0 and Av = pole v would make it zero in the direction v."""
    speed = np.linalg.norm(A)
    both = Q + A.conj().T @ Q @ A / speed**2 if speed else Q
    try:
        np.linalg.cholesky(0.5 * (both + both.conj().T) - _CLEAR * np.linalg.norm(Q) * np.eye(len(Q)))
    except np.linalg.LinAlgError:
        return False
    return True


def _listed(modes: Sequence[str]) -> str:
    """The first few, and how many more there are."""
    more = len(modes) - _NAMED
    said = ", ".join(modes[:_NAMED])
    return f"{said} and {more} more" if more > 0 else said
