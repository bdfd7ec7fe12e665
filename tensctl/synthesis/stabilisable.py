"""Which states a controller can bring to rest, and the modes of those that it cannot.

After Hautus: a left eigenvector w of A whose pole is not damped and that no input reaches, w*B = 0, goes on whatever
u does. The span W of these is taken away and the rest is asked again (a mechanism without drive has two such states,
one behind the other); what remains is W's complement T, which A maps into itself and which holds the range of B.

Columns of B are scaled to length one: a soft tendon beside stiff ones is an input like any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import scipy.linalg as sla
from jaxtyping import Bool, Complex, Float

from tensctl.analysis import controllability
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, Mode

# An eigenvector that the scaled inputs reach by less than this is not reached for certain.
_REACHED = 1e-9
# Poles nearer than this part of themselves are one.
_SAME = 1e-9
# Share of a lost direction above which a mode takes part in it.
_TAKES_PART = 1e-3


@dataclass(frozen=True)
class LeftOut:
    """A mode that was left out of a design.

    Attributes
    ----------
    index : int
        Index of the mode.
    frequency : float, Hz
    reason : str
    """

    index: int
    frequency: float
    reason: str

    def __str__(self) -> str:
        """Mode, frequency and reason."""
        return f"mode {self.index} ({self.frequency:.4g} Hz): {self.reason}"


@dataclass(frozen=True, eq=False)
class Part:
    """Orthonormal basis of the states that a design is about, and the modes that it leaves out."""

    basis: Float[np.ndarray, "nx nr"]
    left: tuple[LeftOut, ...]


def stabilisable(linear: LinearModel, *, only: bool) -> Part:
    """The part of a flexible model that inputs can bring to rest.

    Raises
    ------
    SynthesisError
        Unless `only`, when a mode is neither damped nor driven: its index, frequency and reason.
    """
    lost = unreached(linear.A, linear.B, side_by_side(linear))
    if not lost.size:
        return Part(np.eye(len(linear.A)), ())
    reasons = {mode.index: "a rigid-body motion, which tendons do not push at rest" for mode in linear.drifting}
    reasons |= {mode.index: mode.reason for mode in controllability(linear).modes}
    left = _named(linear, lost, reasons)
    _allow(left, "neither damped nor driven", only)
    return Part(sla.null_space(lost.T, rcond=0.5), left)


def refuse_undriven(linear: LinearModel) -> None:
    """For designs that need every mode: refuse a model with modes that are neither damped nor driven.

    Raises
    ------
    SynthesisError
        With the first such mode, its frequency and the reason.
    """
    left = stabilisable(linear, only=True).left
    if left:
        what = "neither damped nor driven"
        raise SynthesisError(f"{_first(left)} {what}: {left[0].reason}; give tendons that reach it, or some damping.")


def refuse_unseen(linear: LinearModel, C: Float[np.ndarray, "ny nx"]) -> None:
    """For filters that need every mode: refuse sensors with rows C that do not tell of one that nothing damps.

    Raises
    ------
    SynthesisError
        With the first such mode, its frequency and the reason.
    """
    left = controlled_part(linear, C, only=True).left
    if left:
        raise SynthesisError(
            f"{_first(left)} neither damped nor seen: {left[0].reason}; give sensors that see it, or some damping."
        )


def controlled_part(linear: LinearModel, C: Float[np.ndarray, "ny nx"], *, only: bool) -> Part:
    """The part of a flexible model that inputs can bring to rest and that sensors with rows C can tell of.

    Raises
    ------
    SynthesisError
        Unless `only`, when a mode is not damped, and not driven or not seen: its index, frequency and reason.
    """
    driven = stabilisable(linear, only=only)
    T = driven.basis
    whole = not driven.left
    lost = unreached((T.T @ linear.A @ T).T, (C @ T).T, side_by_side(linear) if whole else None)
    if not lost.size:
        return driven
    reasons = {mode.index: _why_not_seen(linear, C, k) for k, mode in enumerate(_moving(linear))}
    left = _named(linear, T @ lost, reasons)
    _allow(left, "neither damped nor seen", only)
    return Part(T @ sla.null_space(lost.T, rcond=0.5), (*driven.left, *left))


def unreached(
    A: Float[np.ndarray, "n n"], B: Float[np.ndarray, "n m"], pairs: np.ndarray | None = None
) -> Float[np.ndarray, "n k"]:
    """Orthonormal basis of the undamped directions that no input reaches.

    Parameters
    ----------
    pairs : (n,) int, optional
        Order of the states in which position and speed of each mode are neighbours: A is then nearly block diagonal,
        and the eigenvalue solver keeps soft modes apart from the rounding of stiff ones.
    """
    pairs = np.arange(len(A)) if pairs is None else pairs
    A, B = A[np.ix_(pairs, pairs)], B[pairs] / np.maximum(np.linalg.norm(B, axis=0), np.finfo(float).tiny)
    T, lost = np.eye(len(A)), np.zeros((len(A), 0))
    while T.shape[1]:
        found = _undriven(T.T @ A @ T, T.T @ B)
        if not found.shape[1]:
            break
        lost = np.hstack([lost, T @ found])
        T = sla.null_space(lost.T, rcond=0.5)
    back = np.empty_like(lost)
    back[pairs] = lost
    return back


def _undriven(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Real orthonormal basis of the left eigenvectors of A that are undamped and that B does not reach."""
    poles, vectors = np.linalg.eig(A.T)
    noise = 10 * len(A) * np.finfo(float).eps * np.linalg.norm(A, 2)
    found = [np.zeros((len(A), 0))]
    for _, basis in pole_groups(poles, vectors, np.real(poles) >= -noise, noise):
        turned, gains, _ = np.linalg.svd(basis.conj().T @ B)
        gains = np.concatenate([gains, np.zeros(len(turned) - gains.size)])
        lost = basis @ turned[:, gains <= _REACHED]
        found += [np.real(lost), np.imag(lost)]
    return sla.orth(np.hstack(found), rcond=1e-6)


def pole_groups(
    poles: np.ndarray, vectors: np.ndarray, chosen: Bool[np.ndarray, " n"], noise: float
) -> Iterator[tuple[complex, Complex[np.ndarray, "n k"]]]:
    """Chosen poles, those within rounding of each other as one, with an orthonormal basis of their eigenvectors."""
    left = np.flatnonzero(chosen)
    while left.size:
        near = np.abs(poles[left] - poles[left[0]]) <= _SAME * abs(poles[left[0]]) + noise
        yield complex(poles[left[0]]), sla.orth(vectors[:, left[near]].astype(complex), rcond=1e-6)
        left = left[~near]


def side_by_side(linear: LinearModel) -> np.ndarray:
    """Order of the states with position and speed of each mode side by side."""
    return np.argsort(_owners(linear), kind="stable")


def _moving(linear: LinearModel) -> tuple[Mode, ...]:
    """The modes that have states: those with positions and rates, then those with rates alone."""
    return (*linear.modes, *linear.drifting)


def _owners(linear: LinearModel) -> np.ndarray:
    """Which of `_moving` each state belongs to; unsorted, positions stand first, then rates, drifting ones last."""
    count = len(linear.modes)
    return np.where(linear.order < count, linear.order, linear.order - count)


def _allow(left: tuple[LeftOut, ...], how: str, only: bool) -> None:
    if not only:
        raise SynthesisError(
            f"{_first(left)} {how}: {left[0].reason}; give tendons or sensors that reach it, some damping, or design "
            "on the rest with stabilisable_only=True."
        )


def _first(left: tuple[LeftOut, ...]) -> str:
    first, *others = left
    more = f" (and {len(others)} more)" if others else ""
    return f"mode {first.index} at {first.frequency:.4g} Hz{more} is"


def _named(linear: LinearModel, lost: np.ndarray, reasons: dict[int, str]) -> tuple[LeftOut, ...]:
    """The modes of lost directions, each with its reason."""
    chosen = name_directions(linear, lost, reasons)
    return tuple(LeftOut(m.index, m.frequency, reasons.get(m.index) or "beside others out of reach") for m in chosen)


def name_directions(
    linear: LinearModel, lost: Float[np.ndarray, "nx k"], reasons: Mapping[int, str] = MappingProxyType({})
) -> tuple[Mode, ...]:  # fmt: skip
    """The modes of lost directions: as many as have the lost states, those with a reason first."""
    modes = _moving(linear)
    share = np.zeros(len(modes))
    np.add.at(share, _owners(linear), (lost**2).sum(axis=1))
    names = sorted(np.flatnonzero(share > _TAKES_PART), key=lambda k: not reasons.get(modes[k].index))
    states = np.cumsum([2 if k < len(linear.modes) else 1 for k in names])
    kept = sorted(names[: 1 + int(np.searchsorted(states, lost.shape[1]))])
    return tuple(modes[k] for k in kept)


def _why_not_seen(linear: LinearModel, C: np.ndarray, position: int) -> str:
    columns = np.flatnonzero(_owners(linear) == position)
    if np.abs(C[:, columns]).max(initial=0.0) <= _REACHED * np.abs(C).max(initial=0.0):
        return "no sensor changes with this mode at first order"
    return "symmetry: the sensors tell not all directions of this repeated frequency apart"
