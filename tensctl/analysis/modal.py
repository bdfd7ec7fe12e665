"""Controllability and observability mode by mode, after Hautus: never the rank of a Krylov matrix.

A mode with left eigenvector v is driven when |v* B| > 0; equal frequencies are judged together by the singular values
of V* B. Undamped, v = (1, i)/sqrt(2) in energy coordinates, so the distance of a mode is its gain over sqrt(2). With
damping the eigenvectors are those of the damped A (`analysis.damped`).

`control.ctrb` raises A to high powers and finds rank 22 of 48 on the (3,1) shell, whose every flexible mode is driven.
"""

from __future__ import annotations

import numpy as np

from tensctl.analysis.damped import damped_gains
from tensctl.analysis.reasons import why_not_driven, why_not_seen
from tensctl.analysis.verdict import ModalReport, ModeVerdict, decide
from tensctl.linear import LinearModel, Mode

_SHOWN = 5


def controllability(linear: LinearModel) -> ModalReport:
    """Which modes can tendons drive, how strongly, by which, and why not.

    Returns
    -------
    ModalReport
        `controllable_modes` and `uncontrollable_modes` are mode indices.
    """
    position, speed = _rows(linear, linear.B)
    gains = damped_gains(linear.A.T, linear.B.T, linear) if linear.dynamics.damped else None
    verdicts = _judge(linear, position + 1j * speed, linear.dynamics.input_labels, gains, why_not_driven)
    return ModalReport(verdicts, "controllable")


def observability(linear: LinearModel) -> ModalReport:
    """Which modes do the outputs see, how strongly, by which, and why not; the dual of `controllability`."""
    position, speed = _rows(linear, linear.C.T)
    gains = damped_gains(linear.A, linear.C, linear) if linear.dynamics.damped else None
    return ModalReport(_judge(linear, position + 1j * speed, linear.outputs, gains, why_not_seen), "observable")


def _rows(linear: LinearModel, matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of each mode's position and speed, put back in mode order, (modes, k) each."""
    unsorted = np.empty_like(matrix)
    unsorted[linear.order] = matrix
    half = len(linear.modes)
    return unsorted[:half], unsorted[half:]


def _judge(linear, coupling, labels, damped, why_not) -> tuple[ModeVerdict, ...]:
    largest = np.linalg.norm(coupling, axis=1).max(initial=0.0)
    verdicts: list[ModeVerdict] = []
    for cluster in _clusters(linear.modes):
        rows = coupling[[position for position, _ in cluster]]
        gains = _singular_values(rows) if damped is None else [damped[position] for position, _ in cluster]
        strength = np.linalg.norm(rows, axis=0)
        strongest = tuple(labels[k] for k in np.argsort(-strength, kind="stable")[:_SHOWN] if strength[k] > 0)
        driven = sum(decide(gain, largest) == "yes" for gain in gains)
        for (position, mode), gain in zip(cluster, gains, strict=True):
            verdict = decide(gain, largest)
            reason = "" if verdict == "yes" else why_not(linear, mode, position, verdict, int(driven))
            shown = strongest if verdict == "yes" else ()
            facts = (mode.index, mode.frequency, mode.kind, mode.multiplicity)
            verdicts.append(ModeVerdict(*facts, float(gain), float(gain / np.sqrt(2)), shown, verdict, reason))
    return tuple(verdicts)


def _singular_values(rows: np.ndarray) -> np.ndarray:
    """Singular values, one for each row; zero beyond the number of columns."""
    values = np.zeros(len(rows))
    found = np.linalg.svd(rows, compute_uv=False)[: len(rows)]
    values[: found.size] = found
    return values


def _clusters(modes: tuple[Mode, ...]) -> list[list[tuple[int, Mode]]]:
    """Modes in groups of equal frequency, with their positions; rigid-body motions one by one."""
    groups: dict[tuple[int, int], list[tuple[int, Mode]]] = {}
    for position, mode in enumerate(modes):
        key = (mode.cluster, position if mode.kind == "rigid-body" else -1)
        groups.setdefault(key, []).append((position, mode))
    return list(groups.values())
