"""One plot over time: every trace in grey, the least margins in colour and named, limits and pushes."""

from dataclasses import dataclass, field, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import IdentityTransform

from tensctl.report.case import Push
from tensctl.report.palette import BAD, BAND, DOUBT, FAINT, MUTED, PAPER, RULE, SERIES, Ink
from tensctl.report.plots import DASHES, TRACE, Plot, Sheet, draw
from tensctl.report.thin import thinned, thinned_band

SHEET = Sheet(right=76.0, top=32.0, height=270.0)
MOST_LINES = 60  # with more traces their range is drawn as a band: single grey lines could not be told apart
BAND_NOTE = "Band: from the least to the largest; darker: the middle 80 %; thin line: the median."
NAMED = len(SERIES)
STEPS_SEEN = 250  # with more points a step is narrower than two pixels, and is drawn as a straight piece
NAME_PITCH = 13.0  # least distance of two names at the right edge, SVG units


@dataclass(frozen=True)
class Limit:
    """A horizontal line that the traces have to keep, named at its left end."""

    value: float
    name: str


@dataclass(frozen=True)
class Strip:
    """One plot over time.

    Attributes
    ----------
    name, label, title : str
        Id prefix; what the plot shows, in words; quantity and unit.
    time : (times,) array
        s.
    span : (first, last) moment of the axis, s
    values : (times, traces) array
    labels : tuple of str
        Name of each trace.
    urgency : (traces,) array
        The traces with the largest urgency are named.
    limits : tuple of Limit
    pushes : tuple of Push
        Shaded.
    relaxed : (moments,) array
        Moments at which the tension floor gave way, s; ticks at the lower edge.
    steps : bool
        Values hold until the next time.
    note : str
        What a reader has to know besides.
    """

    name: str
    label: str
    title: str
    time: np.ndarray
    span: tuple[float, float]
    values: np.ndarray
    labels: tuple[str, ...]
    urgency: np.ndarray
    limits: tuple[Limit, ...] = ()
    pushes: tuple[Push, ...] = ()
    relaxed: np.ndarray = field(default_factory=lambda: np.empty(0))
    steps: bool = False
    note: str = ""


def draw_strip(strip: Strip) -> Plot:
    """The strip as a plot that knows its time span."""
    plot = draw(strip.name, strip.label, lambda axes: _paint(axes, strip), SHEET)
    return replace(
        plot, span=strip.span, note=" ".join(filter(None, [BAND_NOTE if _banded(strip) else "", strip.note]))
    )


def span_of(time: np.ndarray) -> tuple[float, float]:
    """First and last moment (s), never the same."""
    begin, end = float(time[0]), float(time[-1])
    return begin, end if end > begin else begin + 1.0


def frame(axes: Axes, span: tuple[float, float], title: str) -> None:
    """Time axis; the quantity and its unit above the vertical axis, where it reads without turning."""
    axes.set_xlim(*span)
    axes.set_xlabel("Time, s", loc="right")
    axes.set_title(title, loc="left", pad=12)


def shade(axes: Axes, pushes: tuple[Push, ...]) -> None:
    """A vertical band for the time of each push."""
    for push in pushes:
        axes.axvspan(push.begin, push.end, facecolor=RULE.light, edgecolor=RULE.light, linewidth=0.8, zorder=0)
        axes.annotate(
            "push",
            (push.begin, 1.0),
            (0, 2),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            color=MUTED.light,
            fontsize=9.0,
        )


def _paint(axes: Axes, strip: Strip) -> None:
    named = np.argsort(-strip.urgency, kind="stable")[:NAMED]
    shade(axes, strip.pushes)
    if _banded(strip):
        _band(axes, strip)
    else:
        _others(axes, strip, set(named.tolist()))
    for trace, ink, dash in zip(named, SERIES, DASHES, strict=False):
        line = _trace(axes, strip, trace, ink, 1.5)
        if dash[0] is not None:
            line.set_dashes(dash)
    _limits(axes, strip)
    frame(axes, strip.span, strip.title)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 2.5, 5, 10]))
    _relaxed(axes, strip.relaxed)
    _names(axes, strip, named)


def _banded(strip: Strip) -> bool:
    return strip.values.shape[1] > MOST_LINES


def _others(axes: Axes, strip: Strip, named: set[int]) -> None:
    """A thin line for each trace that is not named; pointing at it tells its name."""
    for trace in range(len(strip.labels)):
        if trace not in named:
            _trace(axes, strip, trace, FAINT, 0.8)


def _trace(axes: Axes, strip: Strip, trace: int, ink: Ink, width: float) -> Line2D:
    time, values = thinned(strip.time, strip.values[:, trace])
    style = "steps-post" if strip.steps and len(time) <= STEPS_SEEN else "default"
    (line,) = axes.plot(time, values, color=ink.light, drawstyle=style, linewidth=width)
    line.set_gid(TRACE + strip.labels[trace])
    return line


def _band(axes: Axes, strip: Strip) -> None:
    """From the least to the largest trace, the middle 80 % darker, and the median."""
    known = np.isfinite(strip.values).all(axis=1)
    time, values = strip.time[known], strip.values[known]
    low, tenth, middle, ninetieth, high = np.quantile(values, [0, 0.1, 0.5, 0.9, 1], axis=1)
    axes.fill_between(*thinned_band(time, low, high), facecolor=BAND.light, linewidth=0, zorder=1)
    axes.fill_between(*thinned_band(time, tenth, ninetieth), facecolor=RULE.light, linewidth=0, zorder=1.1)
    axes.plot(*thinned(time, middle), color=MUTED.light, linewidth=0.9, zorder=1.2, gid=TRACE + "median")


def _limits(axes: Axes, strip: Strip) -> None:
    for limit in strip.limits:
        axes.axhline(limit.value, color=BAD.light, linewidth=1.1, dashes=(6, 3), zorder=3)
        above = limit.value <= np.nanmean(strip.values)
        axes.annotate(
            limit.name,
            (0.0, limit.value),
            (4, 4 if above else -4),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            va="bottom" if above else "top",
            color=BAD.light,
            fontsize=9.0,
            zorder=1.5,  # over a band, under the traces
            bbox={"facecolor": PAPER.light, "edgecolor": "none", "pad": 0.5},
        )


def _relaxed(axes: Axes, moments: np.ndarray) -> None:
    """Ticks below the traces at the moments when the tension floor gave way."""
    if len(moments):
        across = axes.get_xaxis_transform()
        heights = np.full(len(moments), 0.02)
        axes.plot(moments, heights, "|", color=DOUBT.light, markersize=9, markeredgewidth=1.2, transform=across)


def _names(axes: Axes, strip: Strip, named: np.ndarray) -> None:
    """The named traces' labels at the right edge, moved apart so that none covers another; a nameless one has none."""
    if not any(strip.labels):
        return
    last = np.nan_to_num(strip.values[-1, named])
    ends = axes.transData.transform(np.column_stack([np.full(len(named), strip.time[-1]), last]))
    order = np.argsort(ends[:, 1], kind="stable")
    places = spread(ends[order, 1], NAME_PITCH, SHEET.bottom, SHEET.height - SHEET.top)
    for k, place in zip(order, places, strict=True):
        x, y = ends[k]
        ink = SERIES[k].light
        edge = [x + 2, x + 10]
        axes.plot(edge, [y, place], color=ink, linewidth=0.8, transform=IdentityTransform(), clip_on=False)
        label = strip.labels[named[k]]
        axes.text(
            *(x + 13, place, label),
            color=ink,
            fontsize=9.0,
            va="center_baseline",
            transform=IdentityTransform(),
        )


def spread(wanted: np.ndarray, pitch: float, low: float, high: float) -> np.ndarray:
    """Ascending places at least ``pitch`` apart, close to the wanted ones, from low to high if they fit."""
    steps = pitch * np.arange(len(wanted))
    upward = np.maximum.accumulate(wanted - steps) + steps
    downward = np.minimum.accumulate((wanted - steps)[::-1])[::-1] + steps
    places = np.maximum((upward + downward) / 2, low + steps)
    return np.minimum(places, high - steps[::-1])
