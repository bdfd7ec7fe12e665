"""Controllability and observability mode by mode, after Hautus: never the rank of a Krylov matrix.

A mode with left eigenvector v is driven when |v* B| > 0; equal frequencies are judged together by the singular values
of V* B, and nearly equal ones without a step in between (`analysis.nearness`). Undamped, v = (1, i)/sqrt(2) in energy
coordinates, so the distance of a mode is its gain over sqrt(2). With damping the eigenvectors are those of the damped A
(`analysis.damped`).

Gains are those of B as it is. Verdicts compare every column of B with the largest that it could be
(`analysis.scaling`), so that a tendon a million times stiffer, or a rod a million times lighter, hides nothing.

`control.ctrb` raises A to high powers and finds rank 22 of 48 on the (3,1) shell, whose every flexible mode is driven.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from tensctl.analysis.damped import DampedModes
from tensctl.analysis.nearness import APART, RESOLUTION, gains
from tensctl.analysis.reasons import why_not_driven, why_not_seen
from tensctl.analysis.scaling import input_sizes
from tensctl.analysis.verdict import ModalReport, ModeVerdict, Verdict, decide
from tensctl.linear import LinearModel, Mode

_SHOWN = 5
# A verdict that changes when frequencies are blurred by this many times rounding, not once, is undecided.
DOUBT = 30.0
Why = Callable[[LinearModel, Mode, int, Verdict, int], str]


def controllability(linear: LinearModel) -> ModalReport:
    """Which modes can tendons drive, how strongly, by which, and why not.

    Returns
    -------
    ModalReport
        `controllable_modes` and `uncontrollable_modes` are mode indices.
    """
    return _report(linear, linear.B, input_sizes(linear), linear.dynamics.input_labels, why_not_driven, "controllable")


def observability(linear: LinearModel) -> ModalReport:
    """Which modes do the outputs see, how strongly, by which, and why not; the dual of `controllability`."""
    return _report(linear, linear.C.T, _output_sizes(linear), linear.outputs, why_not_seen, "observable")


def _report(linear, matrix, sizes, labels, why_not: Why, question) -> ModalReport:
    """Judge the rows of B, or of C', mode by mode."""
    gains_of = _gains_of(linear, question)
    found, judged, doubted = (_in_turn(linear, gains_of(*at)) for at in _three(matrix, sizes))
    answers: list[Verdict] = [agreed(*pair) for pair in zip(_answers(judged), _answers(doubted), strict=True)]
    position, speed = _rows(linear, matrix)
    verdicts = _judge(linear, position + 1j * speed, labels, found, answers, why_not)
    return ModalReport(tuple(verdicts), question, linear=linear)


def _three(matrix: np.ndarray, sizes: np.ndarray) -> tuple[tuple[np.ndarray, float], ...]:
    """What is shown, what is judged, and what is judged when frequencies are blurred more than they need be."""
    return (matrix, 1.0), (matrix / sizes, 1.0), (matrix / sizes, DOUBT)


def _answers(judged: np.ndarray) -> list[Verdict]:
    return [decide(gain, judged.max(initial=0.0)) for gain in judged]


def agreed(one: Verdict, other: Verdict) -> Verdict:
    """The answer that two ways of judging give, if they do."""
    return one if one == other else "undecided"


def _gains_of(linear: LinearModel, question: str) -> Callable[[np.ndarray, float], np.ndarray]:
    """Gains of each mode by a matrix of rows of states, with eigenvalues blurred by a multiple of rounding."""
    if not linear.dynamics.damped:
        return lambda matrix, blur: _undamped(linear, matrix, blur)
    A = linear.A.T if question == "controllable" else linear.A
    modes = DampedModes.of(A, linear.order, len(linear.modes))
    return lambda matrix, blur: modes.gains(matrix.T, blur)


def _rows(linear: LinearModel, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of each mode's position and speed, put back in mode order, (modes, k) each."""
    unsorted = np.empty_like(matrix)
    unsorted[linear.order] = matrix
    half = len(linear.modes)
    return unsorted[:half], unsorted[half : 2 * half]


def _output_sizes(linear: LinearModel) -> Float[np.ndarray, " ny"]:
    """Largest trace of a mode in each output, so that metres and newtons compare; 1 where there is none."""
    largest = np.abs(linear.C).max(axis=1, initial=0.0)
    return np.where(largest > 0, largest, 1.0)


def _undamped(linear: LinearModel, matrix: np.ndarray, blur: float) -> Float[np.ndarray, " modes"]:
    """Gain of each mode, near frequencies together."""
    position, speed = _rows(linear, matrix)
    seen = (position + 1j * speed).T
    found = np.empty(len(linear.modes))
    for group, places in near_modes(linear, blur):
        found[group] = gains(np.eye(group.size), seen[:, group], places)
    return found


def near_modes(linear: LinearModel, blur: float = 1.0) -> list[tuple[np.ndarray, np.ndarray]]:
    """Modes in chains of near frequencies, with their places over the resolution; rigid-body motions one by one.

    Squares of frequencies nearer than `blur` times the eigenvalue solver's rounding are one place.
    """
    rounding = blur * linear.equilibrium.spectrum.tolerance
    omega2 = np.array([mode.omega2 for mode in linear.modes])
    rigid = np.array([mode.kind == "rigid-body" for mode in linear.modes], bool)
    flexible = np.flatnonzero(~rigid)
    near = [(flexible[group], places) for group, places in chains(omega2[flexible], rounding)]
    return [(np.array([k]), np.zeros(1)) for k in np.flatnonzero(rigid)] + near


def chains(omega2: Float[np.ndarray, " m"], rounding: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Indices of squared frequencies in chains of near ones, with their places over the resolution."""
    order = np.argsort(omega2, kind="stable")
    sizes = np.maximum(np.abs(omega2[order]), max(rounding, np.finfo(float).tiny))  # zeros are one place
    steps = np.maximum(np.diff(omega2[order]) - rounding, 0.0) / (2 * RESOLUTION * sizes[1:])
    places = np.concatenate([[0.0], np.cumsum(steps)])[: order.size]
    cuts = np.flatnonzero(steps > APART) + 1
    return list(zip(np.split(order, cuts), np.split(places, cuts), strict=True)) if order.size else []


def _judge(linear, coupling, labels, found, answers: Sequence[Verdict], why_not: Why) -> Sequence[ModeVerdict]:
    """Verdicts in order of the modes."""
    verdicts = []
    for cluster in _clusters(linear.modes):
        members = [position for position, _ in cluster]
        strength = np.linalg.norm(coupling[members], axis=0)
        shares = strength**2 / (np.sum(strength**2) or 1.0)
        strongest = [k for k in np.argsort(-strength, kind="stable")[:_SHOWN] if strength[k] > 0]
        driven = sum(answers[k] == "yes" for k in members)
        for position, mode in cluster:
            answer, shown = answers[position], strongest if answers[position] == "yes" else []
            verdicts.append(
                ModeVerdict(
                    index=mode.index,
                    frequency=mode.frequency,
                    kind=mode.kind,
                    multiplicity=mode.multiplicity,
                    gain=float(found[position]),
                    distance=float(found[position] / np.sqrt(2)),
                    tendons=tuple(labels[k] for k in shown),
                    verdict=answer,
                    reason="" if answer == "yes" else why_not(linear, mode, position, answer, driven),
                    shares=tuple(float(shares[k]) for k in shown),
                    cluster=mode.cluster,
                )
            )
    return verdicts


def _clusters(modes: Sequence[Mode]) -> list[list[tuple[int, Mode]]]:
    """Modes in groups of equal frequency, with their positions; rigid-body motions one by one."""
    groups: dict[tuple[int, int], list[tuple[int, Mode]]] = {}
    for position, mode in enumerate(modes):
        key = (mode.cluster, position if mode.kind == "rigid-body" else -1)
        groups.setdefault(key, []).append((position, mode))
    return list(groups.values())


def _in_turn(linear: LinearModel, values: np.ndarray) -> np.ndarray:
    """Values of equal frequencies from the largest on: inside such a group no direction is a mode's own."""
    turned = values.copy()
    for cluster in _clusters(linear.modes):
        members = [position for position, _ in cluster]
        turned[members] = np.sort(values[members])[::-1]
    return turned
