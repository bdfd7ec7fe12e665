"""The structure at rest on paper: an orthographic projection as SVG, rods and tendons sorted by depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup, escape

from tensctl.report.numbers import number
from tensctl.report.palette import RAMP

if TYPE_CHECKING:
    from tensctl.structure import Structure


YAW, PITCH = np.radians(-62.0), np.radians(12.0)  # as the page's viewer starts, a little lower
ROD_PIECES = 4  # a rod is sorted in pieces, since its middle says little about the depth of its ends
MOST_WITH_HALO = 1000  # members; beyond it gaps at crossings would cost more bytes than they help
PANEL, TALL, MARGIN, DIMENSION = (
    560.0,
    400.0,
    26.0,
    86.0,
)  # SVG units; DIMENSION: room for the height at the side


@dataclass(frozen=True)
class View:
    """One state of the structure to be drawn.

    Attributes
    ----------
    title : str
        Written above.
    nodes : (nodes, 3) array
        Positions, m.
    tensions : (tendons,) array or None
        Tendon forces, N; None draws every tendon in one grey.
    height : float or None
        Axial height, m, drawn as a dimension at the side.
    shadow : (nodes, 3) array or None
        Another state, drawn faintly behind.
    wanted : (nodes, 3) array or None
        Where the nodes should be, drawn as rings.
    """

    title: str
    nodes: np.ndarray
    tensions: np.ndarray | None = None
    height: float | None = None
    shadow: np.ndarray | None = None
    wanted: np.ndarray | None = None


@dataclass(frozen=True)
class Projection:
    """Orthographic view along (YAW, PITCH): paper = origin + scale * (right, -up), SVG units per metre."""

    scale: float
    origin: np.ndarray

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Paper coordinates of points (..., 3), m: (..., 2) to the right and down."""
        flat = _turned(points)[..., :2]
        return self.origin + self.scale * flat * np.array([1.0, -1.0])


def draw_views(structure: Structure, views: tuple[View, ...], tension_max: float) -> tuple[Markup, ...]:
    """An SVG of each view, all at one scale and with one ground level.

    Parameters
    ----------
    structure : Structure
        Members and pins.
    views : tuple of View
    tension_max : float
        Tension of the ramp's last colour, N.
    """
    if not views:
        return ()
    projection = _fitted(views)
    thickness = _thickness(structure)
    return tuple(
        Markup(
            f'<svg viewBox="0 0 {PANEL:g} {TALL:g}" style="--thickness:{thickness:.2g}" role="img" '
            f'aria-label="{escape(view.title)}">{_panel(structure, view, projection, tension_max)}</svg>'
        )
        for view in views
    )


def _thickness(structure: Structure) -> float:
    """Factor on every width: 1 up to 12 rods, then thinner, lest a dense structure become a blot."""
    return float(np.clip(np.sqrt(12 / max(1, len(structure.rods))), 0.4, 1.0))


def _turned(points: np.ndarray) -> np.ndarray:
    """To the right, up and towards the reader (..., 3), m."""
    sin_yaw, cos_yaw, sin_pitch, cos_pitch = np.sin(YAW), np.cos(YAW), np.sin(PITCH), np.cos(PITCH)
    axes = np.array(
        [
            [-sin_yaw, cos_yaw, 0.0],
            [-sin_pitch * cos_yaw, -sin_pitch * sin_yaw, cos_pitch],
            [cos_pitch * cos_yaw, cos_pitch * sin_yaw, sin_pitch],
        ]
    )
    return points @ axes.T


def _fitted(views: tuple[View, ...]) -> Projection:
    """The largest scale at which every view fits its panel."""
    drawn = [part for view in views for part in (view.nodes, view.shadow, view.wanted) if part is not None]
    flat = _turned(np.concatenate(drawn))[:, :2]
    low, high = flat.min(axis=0), flat.max(axis=0)
    size = np.maximum(high - low, 1e-9)
    room = np.array([PANEL - 2 * MARGIN - DIMENSION, TALL - 2 * MARGIN - 20])
    scale = float((room / size).min())
    middle = np.array([PANEL / 2 - DIMENSION / 4, MARGIN + 20 + room[1] / 2])
    return Projection(scale, middle - scale * (low + high) / 2 * np.array([1.0, -1.0]))


def _panel(structure: Structure, view: View, projection: Projection, tension_max: float) -> str:
    parts = [f'<text class="panel-title" x="{MARGIN:g}" y="20">{escape(view.title)}</text>']
    if view.shadow is not None:
        flat = projection(view.shadow)
        ends = np.concatenate([structure.rods, structure.segments])
        parts.append(f'<path class="shadow" d="{_lines(flat[ends[:, 0]], flat[ends[:, 1]])}"/>')
    parts += _members(structure, view, projection, tension_max)
    flat = projection(view.nodes)
    parts.append(_dots(flat[~structure.pinned], "node", 2.6 * _thickness(structure)))
    wide = 6 * _thickness(structure)
    pin = f"l{-wide:.1f} {1.7 * wide:.1f}h{2 * wide:.1f}z"
    parts.append("".join(f'<path class="pin" d="M{x:.1f} {y:.1f}{pin}"/>' for x, y in flat[structure.pinned]))
    if view.wanted is not None:
        parts.append(_dots(projection(view.wanted), "wanted", 6.5 * _thickness(structure)))
    if view.height is not None:
        parts.append(_dimension(view, projection, float(flat[:, 0].max())))
    return "".join(parts)


def _members(structure: Structure, view: View, projection: Projection, tension_max: float) -> list[str]:
    """Rods, in pieces, and tendons as SVG paths, the farthest first."""
    cut = np.linspace(0.0, 1.0, ROD_PIECES + 1)[:, None, None]
    tail, head = view.nodes[structure.rods[:, 0]], view.nodes[structure.rods[:, 1]]
    joints = tail + cut * (head - tail)
    begin = np.concatenate([joints[:-1].reshape(-1, 3), view.nodes[structure.segments[:, 0]]])
    end = np.concatenate([joints[1:].reshape(-1, 3), view.nodes[structure.segments[:, 1]]])
    kinds = ["rod"] * (ROD_PIECES * len(structure.rods)) + _tendon_classes(structure, view, tension_max)
    halo = len(structure.rods) + len(structure.segments) <= MOST_WITH_HALO
    flat_begin, flat_end = projection(begin), projection(end)
    inset = _inset(flat_begin, flat_end)
    drawn = []
    for k in np.argsort(_turned(begin + end)[:, 2], kind="stable"):
        line = _lines(flat_begin[k : k + 1], flat_end[k : k + 1])
        if halo and kinds[k] != "rod":
            gap = _lines((flat_begin + inset)[k : k + 1], (flat_end - inset)[k : k + 1])
            drawn.append(f'<path class="halo" d="{gap}"/>')
        drawn.append(f'<path class="{kinds[k]}" d="{line}"/>')
        if kinds[k] == "rod":
            drawn.append(f'<path class="rod-light" d="{line}"/>')
    return drawn


def _inset(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Steps (members, 2) inwards by which a halo is shorter, lest it bite into what meets at the node."""
    along = end - begin
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return along * np.minimum(10.0 / length, 0.4)


def _tendon_classes(structure: Structure, view: View, tension_max: float) -> list[str]:
    """CSS class of each tendon's segments: ``t0`` to ``t8`` by tension, ``slack`` at zero."""
    if view.tensions is None:
        return ["plain"] * len(structure.segments)
    tensions = view.tensions[structure.segment_tendon]
    steps = np.clip(np.rint(tensions / tension_max * (len(RAMP) - 1)), 0, len(RAMP) - 1).astype(int)
    return [f"t{step}" if tension > 0 else "slack" for step, tension in zip(steps, tensions, strict=True)]


def _dimension(view: View, projection: Projection, right: float) -> str:
    """The height as a dimension line beside the structure, from its lowest node up."""
    low = view.nodes[:, 2].min()
    axis = view.nodes[:, :2].mean(axis=0)
    levels = projection(np.array([[*axis, low], [*axis, low + (view.height or 0.0)]]))
    (middle, foot), top = levels[0], levels[1, 1]
    x = min(right + 22, PANEL - DIMENSION)
    middle_height = (foot + top) / 2 + 4
    text = f'<text class="dimension" x="{x + 9:.1f}" y="{middle_height:.1f}">{number(view.height)} m</text>'
    ticks = f"M{x - 5:.1f} {foot:.1f}h10M{x - 5:.1f} {top:.1f}h10"
    witness = f"M{middle:.1f} {foot:.1f}H{x:.1f}M{middle:.1f} {top:.1f}H{x:.1f}"
    measure = f"M{x:.1f} {foot:.1f}V{top:.1f}{ticks}"
    return f'<path class="witness" d="{witness}"/><path class="measure" d="{measure}"/>{text}'


def _lines(begin: np.ndarray, end: np.ndarray) -> str:
    return "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for (a, b), (c, d) in zip(begin, end, strict=True))


def _dots(places: np.ndarray, kind: str, radius: float) -> str:
    return "".join(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>' for x, y in places)
