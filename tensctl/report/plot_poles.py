"""Poles of the structure under LQR or LQG, upper half of the complex plane, with rays of constant damping."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from tensctl.report.palette import BLUE, FAINT, MUTED, ORANGE, TEXT
from tensctl.report.plots import Plot, Sheet, draw

if TYPE_CHECKING:
    from tensctl.linear import LinearModel
    from tensctl.synthesis import LQG, LQR, HarmonicLQG, HarmonicLQR, HarmonicSampledLQR, SampledLQR

    Design = LQR | SampledLQR | HarmonicLQR | HarmonicSampledLQR | LQG | HarmonicLQG

SHEET = Sheet(height=310.0, top=32.0, right=40.0, left=24.0)
DAMPING = (0.05, 0.1, 0.2, 0.4)  # rays drawn where they cross the plot
_FAR = 2.0  # part of the highest frequency beyond which a decay is not drawn
MOST_STATES = 250  # the open loop's poles are computed here, cubic in the states: 20 ms at 250


def poles(design: Design | None, linear: LinearModel | None, name: str = "LQR") -> Plot | None:
    """Closed-loop poles, and the open loop's where the model is small enough to compute them on the way."""
    if design is None or not np.isfinite(design.poles).any():
        return None
    closed = np.asarray(design.poles)[np.isfinite(design.poles)]
    # Poles of a sampled loop that are gone within a period stand far to the left and would squeeze the others.
    near = -np.real(closed) <= _FAR * np.abs(np.imag(closed)).max()
    closed = closed[near] if near.any() else closed
    before = np.empty(0)
    if linear is not None and len(linear.states) <= MOST_STATES:
        before = np.linalg.eigvals(np.asarray(linear.flexible.A))
    named = "poles" if name == "LQR" else f"poles-{name.lower()}"
    return draw(named, f"Poles with and without {name}", lambda axes: _paint(axes, closed, before, name), SHEET)


def _paint(axes: Axes, closed: np.ndarray, before: np.ndarray, name: str) -> None:
    closed, before = _upper(closed), _upper(before)
    every = np.concatenate([closed, before])
    left = min(1.12 * np.real(every).min(), -1e-3)
    right = max(0.06 * -left, 1.1 * np.real(every).max())
    top = 1.08 * max(np.imag(every).max(), 1e-3)
    axes.set_xlim(left, right)
    axes.set_ylim(0, top)
    axes.axvline(0, color=TEXT.light, linewidth=0.9)
    _rays(axes, left, top)
    if len(before):
        hollow = {"markerfacecolor": "none", "markeredgewidth": 1.2}
        axes.plot(
            np.real(before),
            np.imag(before),
            "o",
            color=ORANGE.light,
            markersize=5,
            label="without control",
            **hollow,
        )
    axes.plot(
        np.real(closed),
        np.imag(closed),
        "x",
        color=BLUE.light,
        markersize=6,
        markeredgewidth=1.5,
        label=f"with {name}",
    )
    axes.yaxis.tick_right()
    axes.spines["left"].set_visible(False)
    axes.spines["right"].set_visible(True)
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    axes.set_xlabel("Real part, 1/s", loc="right")
    axes.set_title("Imaginary part, rad/s", loc="right", pad=12)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False, borderaxespad=0, handlelength=1)


def _upper(values: np.ndarray) -> np.ndarray:
    """One of each conjugate pair, and the real ones."""
    return values[np.imag(values) >= -1e-12 * max(1.0, np.abs(values).max(initial=0.0))]


def _rays(axes: Axes, left: float, top: float) -> None:
    """Where the damping ratio is constant: imag = -real sqrt(1 - d^2)/d."""
    for damping in DAMPING:
        slope = np.sqrt(1 - damping**2) / damping
        x = max(left, -top / slope)
        axes.plot([0, x], [0, -x * slope], color=FAINT.light, linewidth=0.7, dashes=(2, 3), zorder=0)
        axes.annotate(
            f"{damping:g}",
            (x, -x * slope),
            (4, -10),
            textcoords="offset points",
            color=MUTED.light,
            fontsize=8.5,
        )
