"""Natural frequencies as stems: rigid-body motions apart, repeats marked, kinds by marker and colour."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from tensctl.report.palette import BAD, BAND, BLUE, DOUBT, MUTED, ORANGE, Ink
from tensctl.report.plots import Plot, Sheet, draw

if TYPE_CHECKING:
    from tensctl.linear import LinearModel, Mode


SHEET = Sheet(width=900.0, height=270.0, left=52.0, top=32.0)
_LOOKS: tuple[tuple[str, Ink, str], ...] = (
    ("rigid-body", MUTED, "s"),
    ("mechanism", ORANGE, "D"),
    ("unstable", BAD, "X"),
    ("flexible", BLUE, "o"),
)


def frequencies(linear: LinearModel | None) -> Plot | None:
    """Frequency (Hz) of every mode over its number; None without a linear model."""
    if linear is None or not linear.modes:
        return None
    label = f"Natural frequencies of {len(linear.modes)} modes"
    return draw("modes", label, lambda axes: _paint(axes, linear.modes), SHEET)


def _paint(axes: Axes, modes: Sequence[Mode]) -> None:
    index = np.array([mode.index for mode in modes])
    frequency = np.nan_to_num([mode.frequency for mode in modes])
    kinds = np.array([mode.kind for mode in modes])
    rigid = kinds == "rigid-body"
    if rigid.any():
        first, last = index[rigid].min() - 0.5, index[rigid].max() + 0.5
        axes.axvspan(first, last, facecolor=BAND.light, zorder=0)
    small = len(modes) > 80
    for kind, ink, marker in _LOOKS:
        of_kind = kinds == kind
        if of_kind.any():
            axes.vlines(index[of_kind], 0, frequency[of_kind], color=ink.light, linewidth=0.7 if small else 1.3)
            label = f"{kind} ({of_kind.sum()})"
            size = 2.5 if small else 5
            axes.plot(index[of_kind], frequency[of_kind], marker, color=ink.light, markersize=size, label=label)
    axes.set_ylim(0, 1.14 * max(frequency.max(), 1e-3))
    axes.set_xlim(index.min() - 0.7, index.max() + 0.7)
    _clusters(axes, modes, written=not small)
    axes.set_title("Natural frequency, Hz", loc="left", pad=12)
    axes.set_xlabel("Mode", loc="right")
    axes.xaxis.set_major_locator(MaxNLocator(12, integer=True, steps=[1, 2, 5, 10]))
    axes.legend(loc="lower right", bbox_to_anchor=(1, 1), ncols=4, frameon=False, borderaxespad=0, handlelength=1)


def _clusters(axes: Axes, modes: Sequence[Mode], *, written: bool) -> None:
    """A bracket over the modes that repeat one frequency, with their number when there is room to read it."""
    top = axes.get_ylim()[1]
    groups: dict[int, list[Mode]] = {}
    for mode in modes:
        if mode.kind != "rigid-body":
            groups.setdefault(mode.cluster, []).append(mode)
    for group in groups.values():
        if len(group) > 1:
            first, last = min(mode.index for mode in group), max(mode.index for mode in group)
            height = float(np.nan_to_num(max(mode.frequency for mode in group))) + 0.045 * top
            axes.plot([first, last], [height, height], color=DOUBT.light, linewidth=1.6)
            if written:
                place = ((first + last) / 2, height)
                text = f"×{len(group)}"
                axes.annotate(
                    text,
                    place,
                    (0, 3),
                    textcoords="offset points",
                    ha="center",
                    color=DOUBT.light,
                    fontsize=9,
                )
