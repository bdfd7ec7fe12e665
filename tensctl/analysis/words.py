"""A study as text for the terminal: one line a frequency, and sentences."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from tensctl.analysis.verdict import ModalReport, ModeVerdict

if TYPE_CHECKING:
    from tensctl.analysis.study import Study

_DISTANCES = (
    "distance over B: smallest change of B alone, in 2-norm, after which the mode is not driven, per m of rest length; "
    "over A and B: smallest singular value of [A - lambda I, B] at the mode's lambda, 1/s, inputs in sqrt(energy)"
)


def as_text(study: Study) -> str:
    """The whole study."""
    parts = [modes_table(study.controllability, study.hautus), _DISTANCES, str(study.reach)]
    if study.krylov is not None:
        parts.append(str(study.krylov))
    if study.energies is not None:
        parts.append(str(study.energies))
    parts += [str(one) for one in study.moves]
    if study.placements:
        parts.append("\n".join(str(one) for one in study.placements))
    if study.redundancy is not None:
        parts.append(str(study.redundancy))
    if study.observability is not None:
        parts.append(modes_table(study.observability, None))
    return "\n\n".join(parts)


def rows_of(report: ModalReport) -> list[list[ModeVerdict]]:
    """Verdicts of one frequency and one answer together; rigid-body motions one by one."""

    def key(mode: ModeVerdict) -> tuple:
        alone = mode.index if mode.kind == "rigid-body" else -1
        return mode.cluster, alone, mode.verdict, mode.reason

    return [list(group) for _, group in groupby(report.modes, key)]


def modes_table(report: ModalReport, hautus: np.ndarray | None) -> str:
    """One line a frequency."""
    place = {mode.index: k for k, mode in enumerate(report.modes)}
    head = ["modes", "kind", "f [Hz]", "gain", "distance over B" if report.question == "controllable" else "over C"]
    head += ["over A and B"] if hautus is not None else []
    lines = [[*head, "answer", "strongest (share), or reason"]]
    for group in rows_of(report):
        first, last = group[0], group[-1]
        cells = [spans([m.index for m in group]), first.kind, f"{first.frequency:.4g}"]
        cells += [f"{last.gain:.3g}", f"{last.distance:.3g}"]
        cells += [f"{min(hautus[place[m.index]] for m in group):.3g}"] if hautus is not None else []
        lines.append([*cells, first.verdict, first.reason or shared(first)])
    count = sum(m.verdict == "yes" for m in report.modes)
    return f"{count} of {len(report.modes)} modes are {report.question}\n{aligned(lines)}"


def shared(mode: ModeVerdict) -> str:
    """Its strongest tendons, each with its share."""
    return ", ".join(f"{label} {100 * share:.0f} %" for label, share in zip(mode.tendons, mode.shares, strict=True))


def spans(indices: Sequence[int]) -> str:
    """`7-8`, or `9`."""
    return str(indices[0]) if len(indices) == 1 else f"{indices[0]}-{indices[-1]}"


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """Columns under each other; the last one runs free."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]) - 1)]
    return "\n".join(
        "  ".join([*(cell.ljust(w) for cell, w in zip(line, widths, strict=False)), line[-1]]) for line in lines
    )
