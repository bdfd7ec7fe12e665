"""Rows of the controllability tables: one a frequency and answer, with the strongest tendons and their shares."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from tensctl.report.case import Case
from tensctl.report.numbers import plain
from tensctl.report.tables import share_of_largest

if TYPE_CHECKING:
    from tensctl.analysis import ModalReport, ModeVerdict, Move, ReachEnergies

_SHOWN = 4


@dataclass(frozen=True)
class VerdictRow:
    """Modes of one frequency that have one answer.

    Attributes
    ----------
    modes : str
        `7`, or `7, 8`.
    gain, distance : float
        Of the weakest of them.
    hautus : float or None
        Distance over A and B, 1/s.
    strongest : tuple of (label, share)
    """

    modes: str
    kind: str
    frequency: float
    gain: float
    distance: float
    hautus: float | None
    strongest: tuple[tuple[str, float], ...]
    verdict: str
    reason: str


def verdict_rows(report: ModalReport, hautus: np.ndarray | None = None) -> tuple[VerdictRow, ...]:
    """Rows in order of the modes."""
    found, place = [], 0
    for _, group in groupby(report.modes, _key):
        members = list(group)
        first, weakest = members[0], min(members, key=lambda mode: mode.gain)
        here = None if hautus is None else float(hautus[place : place + len(members)].min())
        place += len(members)
        found.append(
            VerdictRow(
                modes=", ".join(str(mode.index) for mode in members),
                kind=first.kind,
                frequency=first.frequency,
                gain=weakest.gain,
                distance=weakest.distance,
                hautus=here,
                strongest=tuple(zip(first.tendons, first.shares, strict=True))[:_SHOWN],
                verdict=str.__str__(first.verdict),
                reason=first.reason,
            )
        )
    return tuple(found)


def _key(mode: ModeVerdict) -> tuple:
    alone = mode.index if mode.kind == "rigid-body" else -1
    return mode.cluster, alone, mode.verdict, mode.reason


def hautus_of(case: Case) -> np.ndarray | None:
    """Distances over A and B, where the case has them."""
    return None if case.study is None else case.study.hautus


Cost = tuple[str, float, float]


def cost_rows(energies: ReachEnergies) -> list[tuple[str, str, list[Cost]]]:
    """Tables of outputs and modes, cheapest first: title, unit, rows of label, cost and share of the dearest."""
    names = tuple(f"mode {index}" for index in energies.modes)
    tables = (
        ("Output", "J s per squared unit", energies.labels, energies.outputs),
        ("Mode", "J s per joule", names, energies.joules),
    )
    found = []
    for title, unit, labels, values in tables:
        shares = share_of_largest(tuple(values.tolist()))
        order = np.argsort(values, kind="stable")
        if len(order):
            found.append((title, unit, [(labels[k], float(values[k]), shares[k]) for k in order]))
    return found


def move_title(move: Move) -> str:
    """`P4_1_1 by (10, 0, 0) mm`."""
    return f"{move.equilibrium.structure.node_labels[move.node]} by {millimetres(move.by)} mm"


def millimetres(vector: np.ndarray) -> str:
    """A vector of metres as text in millimetres."""
    return f"({', '.join(plain(float(f'{1e3 * x:.3g}')) for x in vector)})"


def move_rows(move: Move) -> list[tuple[str, str, list[Cost]]]:
    """Tables of the tendons to pull and of what else moves, largest first."""
    structure = move.equilibrium.structure
    way = np.linalg.norm(move.displacements, axis=1)
    way[move.node] = 0.0
    others = [(structure.node_labels[k], float(way[k])) for k in np.argsort(-way, kind="stable") if way[k] > 0]
    tables = (("Tendon", "shorten (+), let out (\u2212), mm", move.tendons), ("Also moves", "mm", tuple(others)))
    found = []
    for title, unit, rows in tables:
        shares = share_of_largest(tuple(abs(value) for _, value in rows))
        found.append((title, unit, [(label, 1e3 * v, s) for (label, v), s in zip(rows, shares, strict=True)]))
    return found
