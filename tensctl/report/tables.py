"""Rows of the report's tables, gathered from the results: modes by cluster, statuses, operations, stages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensctl.report.case import Case

if TYPE_CHECKING:
    from tensctl.linear import Mode
    from tensctl.model import Term
    from tensctl.simulation import Run


@dataclass(frozen=True)
class ModeRow:
    """Modes that share frequency, kind and name: (place in the list, index) of each, what they share."""

    members: tuple[tuple[int, int], ...]
    name: str
    kind: str
    frequency: float
    multiplicity: int


def mode_rows(modes: Sequence[Mode]) -> tuple[ModeRow, ...]:
    """One row for each run of neighbouring modes that repeat one eigenvalue and carry the same name."""
    rows: list[list[tuple[int, Mode]]] = []
    for place, mode in enumerate(modes):
        if rows and _alike(rows[-1][-1][1], mode):
            rows[-1].append((place, mode))
        else:
            rows.append([(place, mode)])
    return tuple(
        ModeRow(
            members=tuple((place, mode.index) for place, mode in row),
            name=row[0][1].name,
            kind=row[0][1].kind,
            frequency=float(np.mean([mode.frequency for _, mode in row])),
            multiplicity=row[0][1].multiplicity,
        )
        for row in rows
    )


def _alike(one: Mode, other: Mode) -> bool:
    return (one.cluster, one.kind, one.name) == (other.cluster, other.kind, other.name)


@dataclass(frozen=True)
class Operations:
    """Operations of one evaluation that stay in the model, and those that were left out."""

    kept: int
    saved: int

    @property
    def share_saved(self) -> float:
        """Part of the full model that was saved, 0 to 1."""
        return self.saved / (self.kept + self.saved) if self.kept + self.saved else 0.0


def operations(terms: tuple[Term, ...]) -> Operations:
    """Sums over the terms that know their operations."""
    return Operations(
        kept=sum(term.operations or 0 for term in terms if term.included),
        saved=sum(term.operations or 0 for term in terms if not term.included),
    )


@dataclass(frozen=True)
class Solves:
    """What the MPC's solves amount to."""

    steps: int
    statuses: tuple[tuple[str, int], ...]
    kkt_median: float
    kkt_worst: float
    bounded: int
    kkt_bounded: float
    median: float
    worst: float


def solves(run: Run | None) -> Solves | None:
    """Certificate of a run under MPC; None when no step was solved."""
    if run is None or not len(run.solve_time):
        return None
    words, counts = np.unique(np.asarray(run.status, dtype=str), return_counts=True)
    statuses = [(str(word), int(n)) for word, n in zip(words, counts, strict=True) if word]
    kkt = run.kkt[np.isfinite(run.kkt) & ~run.bounded]
    return Solves(
        steps=len(run.solve_time),
        statuses=tuple(sorted(statuses, key=lambda pair: -pair[1])),
        kkt_median=float(np.median(kkt)) if len(kkt) else np.nan,
        kkt_worst=float(np.max(kkt)) if len(kkt) else np.nan,
        bounded=int(run.bounded.sum()),
        kkt_bounded=float(run.kkt[run.bounded].max(initial=0.0)),
        median=float(np.median(run.solve_time)),
        worst=float(np.max(run.solve_time)),
    )


@dataclass(frozen=True)
class ShapeErrors:
    """Largest node error (mm) at the start, after the last push (None without one), and at the end.

    Also the largest distance from the planned path, and when; None without one.
    """

    start: float
    after_push: float | None
    end: float
    off_path: tuple[float, float] | None


def shape_errors(case: Case) -> ShapeErrors | None:
    """None when the case does not say how far the shape was from the wanted one."""
    if case.shape_error is None or case.run is None or not len(case.shape_error):
        return None
    error = 1e3 * np.asarray(case.shape_error)
    begin = max((push.begin for push in case.pushes), default=np.inf)
    after = error[case.run.time >= begin]
    pushed = float(np.nanmax(after)) if np.isfinite(after).any() else None
    return ShapeErrors(float(error[0]), pushed, float(error[-1]), _off_path(case.path_error, case.run.time))


def _off_path(error: np.ndarray | None, time: np.ndarray) -> tuple[float, float] | None:
    """Largest distance from the path, mm, and when, s."""
    if error is None:
        return None
    worst = int(np.nanargmax(error))
    return 1e3 * float(error[worst]), float(time[worst])


@dataclass(frozen=True)
class Stage:
    """One stage of the work: wall time (s) and its share of the longest."""

    name: str
    seconds: float
    share: float


def stages(case: Case) -> tuple[Stage, ...]:
    """Every stage in the order in which it ran."""
    longest = max(case.seconds.values(), default=0.0) or 1.0
    return tuple(Stage(name, value, value / longest) for name, value in case.seconds.items())


def share_of_largest(values: tuple[float, ...]) -> tuple[float, ...]:
    """Each value over the largest finite one, 0 to 1, for bars in tables."""
    finite = [value for value in values if np.isfinite(value)]
    largest = max(finite, default=0.0) or 1.0
    return tuple(max(0.0, min(1.0, value / largest)) if np.isfinite(value) else 0.0 for value in values)
