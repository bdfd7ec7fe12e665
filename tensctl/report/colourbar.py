"""The colour bar that turns a tendon's colour into newtons: ramp, ticks and the tension floor."""

import numpy as np
from markupsafe import Markup, escape

from tensctl.report.numbers import number
from tensctl.report.palette import RAMP

WIDTH, HEIGHT, LEFT, LONG, THICK = 420.0, 44.0, 14.0, 392.0, 11.0  # SVG units


def colour_bar(name: str, tension_max: float, floor: float | None) -> Markup:
    """A horizontal bar from 0 N to ``tension_max`` (N) as SVG, the floor (N) marked if there is one.

    ``name`` prefixes the gradient's id and must be unique in the page.
    """
    stops = "".join(
        f'<stop offset="{k / (len(RAMP) - 1):g}" stop-color="var(--{ink.name})"/>' for k, ink in enumerate(RAMP)
    )
    parts = [
        f'<defs><linearGradient id="{name}-ramp">{stops}</linearGradient></defs>',
        f'<rect x="{LEFT:g}" y="4" width="{LONG:g}" height="{THICK:g}" rx="2" fill="url(#{name}-ramp)"/>',
    ]
    for value in _ticks(tension_max):
        x = LEFT + LONG * value / tension_max
        parts.append(f'<path class="measure" d="M{x:.1f} {4 + THICK:g}v4"/>')
        text = f"{value:g} N" if value == 0 else f"{value:g}"
        parts.append(f'<text class="tick" x="{x:.1f}" y="{18 + THICK:g}">{text}</text>')
    if floor is not None and 0 < floor <= tension_max:
        x = LEFT + LONG * floor / tension_max
        parts.append(f'<path class="floor" d="M{x:.1f} 1v{THICK + 6:g}"><title>floor {number(floor)} N</title></path>')
    label = escape(f"Colour of tension from 0 to {number(tension_max)} N")
    return Markup(f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{label}">{"".join(parts)}</svg>')


def _ticks(top: float) -> np.ndarray:
    """Zero and round numbers up to ``top``, four to eight of them."""
    rough = top / 6
    decade = 10.0 ** np.floor(np.log10(rough))
    step = decade * min((1, 2, 5, 10), key=lambda factor: abs(factor * decade - rough))
    return step * np.arange(int(top / step + 1e-9) + 1)
