"""Matplotlib axes in, small inline SVG out: text as text, colours as the page's variables, short numbers."""

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from tensctl.report.numbers import power_of_ten
from tensctl.report.palette import INKS, MUTED, RULE, TEXT

if TYPE_CHECKING:
    from matplotlib.typing import RcKeyType

UNIT = 72.0  # SVG user units per inch: one unit is drawn as about one CSS pixel
# Dashes of the four lines that are told apart: on, off, ...
DASHES = ((None, None), (5.0, 1.6), (1.4, 1.4), (7.0, 1.6, 1.4, 1.6))

# DejaVu Sans comes with matplotlib, so that the layout is the same everywhere; it is wider than what browsers
# then show the text with, which therefore always fits.
_STYLE: "dict[RcKeyType, Any]" = {
    "font.family": ["DejaVu Sans"],
    "font.size": 10.0,
    "text.parse_math": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "tensctl",
    "path.simplify": True,
    "path.simplify_threshold": 0.2,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "axes.edgecolor": MUTED.light,
    "axes.labelcolor": TEXT.light,
    "axes.labelsize": 10.0,
    "axes.facecolor": "none",
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.titlesize": 10.0,
    "axes.titley": 1.0,  # or matplotlib lays out all ticks and labels once more, to put the title above them
    "axes.xmargin": 0.0,
    "grid.color": RULE.light,
    "grid.linewidth": 0.7,
    "text.color": TEXT.light,
    "xtick.color": MUTED.light,
    "ytick.color": MUTED.light,
    "xtick.labelcolor": TEXT.light,
    "ytick.labelcolor": TEXT.light,
    "xtick.labelsize": 9.5,
    "ytick.labelsize": 9.5,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "lines.solid_joinstyle": "round",
    "figure.facecolor": "none",
}


@dataclass(frozen=True)
class Sheet:
    """Size of a plot and the margins about its axes, in SVG user units."""

    width: float = 560.0
    height: float = 260.0
    left: float = 62.0
    right: float = 16.0
    top: float = 14.0
    bottom: float = 40.0


@dataclass(frozen=True)
class Plot:
    """A drawn plot: markup, sheet, the time span of its x axis if it has one (s), how to read it."""

    svg: Markup
    sheet: Sheet
    span: tuple[float, float] | None = None
    note: str = ""


def draw(name: str, label: str, paint: Callable[[Axes], object], sheet: Sheet) -> Plot:
    """Let ``paint`` draw on fresh axes and return the result as inline SVG.

    Parameters
    ----------
    name : str
        Prefix of every id inside, unique in the page.
    label : str
        What the plot shows, for readers who do not see it.
    paint : callable
        Draws on the axes it is given.
    sheet : Sheet
        Size and margins.
    """
    with mpl.rc_context(rc=_STYLE):
        figure = Figure(figsize=(sheet.width / UNIT, sheet.height / UNIT), dpi=UNIT)
        box = (
            sheet.left / sheet.width,
            sheet.bottom / sheet.height,
            1 - (sheet.left + sheet.right) / sheet.width,
            1 - (sheet.top + sheet.bottom) / sheet.height,
        )
        paint(figure.add_axes(box))
        text = io.StringIO()
        metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
        FigureCanvasSVG(figure).print_svg(text, metadata=metadata)
    return Plot(_inline(text.getvalue(), name, label, sheet), sheet)


def log_axis(axes: Axes) -> None:
    """Give a logarithmic vertical axis whole decades as limits and ticks, at most seven, written 10⁻³."""
    low, high = np.log10(axes.get_ylim())
    first, last = np.floor(low), max(np.ceil(high), np.floor(low) + 1)
    axes.set_ylim(10.0**first, 10.0**last)
    axes.yaxis.set_major_locator(LogLocator(numticks=7))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_decade))


def _decade(value: float, _position: int | None) -> str:
    return power_of_ten(round(np.log10(value)))


_VARIABLES = {ink.light: f"var(--{ink.name})" for ink in INKS}
_COLOUR = re.compile("|".join(_VARIABLES))
_LONG_NUMBER = re.compile(r"-?\d+\.\d{2,}")
_FAMILY = re.compile(r"font-family: [^;\"]*;? ?")
_TAG = re.compile(r"<[^>]*>")
_REFERENCE = re.compile(r"(url\(#|href=\"#)([^)\"]+)")
_ID = re.compile(r' id="([^"]*)"')
_TRACE = re.compile(r'<g id="trace:([^"]*)">')
TRACE = "trace:"  # gid prefix of an artist whose name a reader may ask for by pointing at it


def _inline(svg: str, name: str, label: str, sheet: Sheet) -> Markup:
    """Take away what inline SVG does not need, prefix the ids in use; text between tags stays as it is."""
    body = svg[svg.index("<defs>") : svg.rindex("</svg>")]
    body = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>|<!--.*?-->", "", body, flags=re.DOTALL)
    body = re.sub(r"(?<=>)\s+(?=<)", "", body)
    used = {reference for _, reference in _REFERENCE.findall(body)}

    def tidy(tag: re.Match[str]) -> str:
        text = _TRACE.sub(r'<g class="trace"><title>\1</title>', tag[0])
        text = _ID.sub(lambda m: f' id="{name}-{m[1]}"' if m[1] in used else "", text)
        text = _REFERENCE.sub(rf"\1{name}-\2", text)
        text = _LONG_NUMBER.sub(_short, text).replace("\n", " ")
        return _FAMILY.sub("", _COLOUR.sub(lambda m: _VARIABLES[m[0]], text))

    head = f'<svg viewBox="0 0 {sheet.width:g} {sheet.height:g}" role="img" aria-label="{escape(label)}">'
    return Markup(f"{head}{_TAG.sub(tidy, body)}</svg>")


def _short(match: re.Match[str]) -> str:
    """Two decimals: a hundredth of a pixel."""
    short = f"{float(match[0]):.2f}".rstrip("0").rstrip(".")
    return "0" if short == "-0" else short
