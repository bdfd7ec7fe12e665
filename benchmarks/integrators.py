"""Error against run time of tensctl's integrators, MuJoCo's, SciPy's and CVODES, in one run on one core.

    python benchmarks/integrators.py                     # every motion: table of points and ratios
    python benchmarks/integrators.py --motion smooth_3_1 --contender tensctl
    python benchmarks/integrators.py --docs              # also renews docs/integrators.md and its pictures

Error: the largest distance of any node to the reference at the record times 0, 0.1, ... 1 s. Time: processor time of a
whole call from Python, the median over several calls, building of models left out; on a quiet machine that is the time
on the clock. Interpolated along each family's front, log against log. The process pins itself to the last core that it
may use, where the system can (start it under `taskset -c N` for another), and BLAS to one thread.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

for _library in ("OPENBLAS", "MKL", "OMP"):
    os.environ[f"{_library}_NUM_THREADS"] = "1"
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

import numpy as np  # noqa: E402 - after the threads are set
import page  # noqa: E402
from contenders import Setting, settings  # noqa: E402
from motions import MOTIONS, Motion, distance  # noqa: E402

from tensctl.errors import SimulationError  # noqa: E402
from tensctl.threads import one_blas_thread  # noqa: E402

# A contender stops once a single call takes this long, s.
_LIMIT = 2.0
# Calls are repeated until they add up to this, s, at most _CALLS times.
_SPAN, _CALLS = 0.3, 15
# Beyond this many metres a run is garbage.
_GARBAGE = 10.0


@dataclass(frozen=True)
class Point:
    """One contender at one setting on one motion."""

    motion: str
    family: str
    name: str
    setting: str
    error: float
    seconds: float


@dataclass(frozen=True)
class Claim:
    """How many times faster than a family tensctl is expected to be at an error, m."""

    motion: str
    family: str
    error: float
    least: float
    stretch: float | None = None


CLAIMS = (
    Claim("smooth_3_1", "MuJoCo", 1e-6, 100),
    Claim("smooth_8_4", "MuJoCo", 1e-6, 60, 100),
    Claim("switching_3_1", "MuJoCo", 1e-6, 100),
    Claim("smooth_3_1", "SciPy, NumPy", 1e-6, 300),
    Claim("damped_3_1", "CVODES", 1e-5, 3, 5),
    Claim("damped_3_1", "CVODES", 1e-8, 0.5),
)


def measure(motion: Motion, wanted: str) -> list[Point]:
    """Every contender whose name holds `wanted`, from coarse to fine until it takes too long or meets the reference."""
    points = []
    for label, chain in settings(motion):
        if wanted.lower() not in label.lower():
            continue
        for setting in chain:
            point = _point(motion, setting)
            points.append(point)
            print(f"  {label:24} {setting.setting:12} {point.error:9.1e} m {1e3 * point.seconds:10.3f} ms", flush=True)
            if point.seconds > _LIMIT or point.error < 3 * motion.reference.error:
                break
    return points


def _point(motion: Motion, setting: Setting) -> Point:
    spent: list[float] = []
    nodes = None
    for call in range(1 + _CALLS):
        began = time.process_time()
        try:
            nodes = setting.run()
        except (SimulationError, RuntimeError) as fault:  # CVODES through CasADi gives up with a RuntimeError
            print(f"  {setting.name}: {str(fault).splitlines()[0][:100]}")
            return Point(motion.name, setting.family, setting.name, setting.setting, np.inf, np.nan)
        seconds = time.process_time() - began
        # The first call is not counted, unless it is too long to be made again.
        if call > 0 or seconds > _SPAN:
            spent.append(seconds)
        if sum(spent) > _SPAN and (len(spent) >= 3 or seconds > _SPAN):
            break
    error = distance(nodes, motion.reference.nodes)
    error = error if error < _GARBAGE else np.inf
    return Point(motion.name, setting.family, setting.name, setting.setting, error, float(np.median(spent)))


def front(points: Iterable[Point]) -> np.ndarray:
    """(errors, seconds) of the points that no other beats in both, from coarse to fine, (k, 2)."""
    usable = sorted((p.seconds, p.error) for p in points if np.isfinite(p.error) and p.error > 0)
    kept: list[tuple[float, float]] = []
    for seconds, error in usable:
        if not kept or error < kept[-1][0]:
            kept.append((error, seconds))
    return np.array(kept).reshape(-1, 2)


def seconds_at(points: Iterable[Point], error: float) -> float:
    """Time for an error along the front, log against log; nan when it is not reached.

    Errors coarser than the front's first point cost what that point costs.
    """
    line = front(points)
    if not len(line) or line[:, 0].min() > error:
        return np.nan
    x, y = np.log(line[::-1]).T
    return float(np.exp(np.interp(np.log(error), x, y)))


def of(points: Iterable[Point], motion: str, family: str) -> list[Point]:
    """Points of one family on one motion."""
    return [p for p in points if (p.motion, p.family) == (motion, family)]


def times_table(points: list[Point], error: float) -> str:
    """Time of each family for an error and its ratio to tensctl's, motion by motion."""
    families = list(dict.fromkeys(p.family for p in points))
    rows = []
    for motion in dict.fromkeys(p.motion for p in points):
        spent = {family: seconds_at(of(points, motion, family), error) for family in families}
        own = spent.get("tensctl", np.nan)
        cells = [f"{_time(spent[f])}" + ("" if f == "tensctl" else _times(spent[f] / own)) for f in families]
        rows.append([motion, *cells])
    return page.table([f"at {error:.0e} m", *families], rows)


def _time(seconds: float) -> str:
    return "not reached" if np.isnan(seconds) else f"{1e3 * seconds:.3g} ms"


def _times(ratio: float) -> str:
    return "" if np.isnan(ratio) else f" ({ratio:.3g}x)"


def claims_table(points: list[Point]) -> str:
    """What is claimed beside what was measured."""
    rows = []
    for claim in CLAIMS:
        if not (of(points, claim.motion, claim.family) and of(points, claim.motion, "tensctl")):
            continue
        theirs, own = (seconds_at(of(points, claim.motion, f), claim.error) for f in (claim.family, "tensctl"))
        ratio = theirs / own
        wanted = f"{claim.least:g}x" + ("" if claim.stretch is None else f" ({claim.stretch:g}x)")
        unreached = f"{claim.family} does not reach it" if np.isnan(theirs) else "tensctl does not reach it"
        verdict = unreached if np.isnan(ratio) else "holds" if ratio >= claim.least else "fails"
        rows.append(
            [
                claim.motion,
                claim.family,
                f"{claim.error:.0e}",
                _time(theirs),
                _time(own),
                f"{ratio:.3g}x",
                wanted,
                verdict,
            ]
        )
    return page.table(["motion", "against", "error, m", "theirs", "tensctl", "ratio", "wanted", "verdict"], rows)


def motions_table(motions: Iterable[Motion], points: list[Point]) -> str:
    """What was run, how good its reference is, and the best that each family reached."""
    families = list(dict.fromkeys(p.family for p in points))
    rows = []
    for motion in motions:
        best = [min((p.error for p in of(points, motion.name, f)), default=np.inf) for f in families]
        reference = motion.reference
        rows.append(
            [motion.name, motion.what, reference.switches, f"{reference.error:.0e}", *(f"{e:.0e}" for e in best)]
        )
    head = ["motion", "what", "switches", "error of the reference, m", *(f"best of {f}, m" for f in families)]
    return page.table(head, rows)


def points_table(points: list[Point]) -> str:
    """The points of all fronts."""
    rows = []
    for motion in dict.fromkeys(p.motion for p in points):
        for family in dict.fromkeys(p.family for p in points):
            kept = {(e, s) for e, s in front(of(points, motion, family))}
            for p in of(points, motion, family):
                if (p.error, p.seconds) in kept:
                    rows.append([motion, f"{family} {p.name}", p.setting, f"{p.error:.1e}", f"{1e3 * p.seconds:.3g}"])
    return page.table(["motion", "integrator", "setting", "error, m", "time, ms"], rows)


def plot(points: list[Point], motions: Iterable[Motion], path: Path) -> None:
    """Error against time, a panel a motion: every point, and each family's front as a line."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    colours = {
        "tensctl": "#0b64a8", "tensctl, recorded": "#7db4e0", "MuJoCo": "#d9801a", "SciPy, NumPy": "#9aa5b1",
        "SciPy, compiled": "#5c6b7a", "CVODES": "#7a4fa3",
    }  # fmt: skip
    motions = list(motions)
    figure = Figure(figsize=(11, 3.6 * -(-len(motions) // 3)), layout="constrained")
    FigureCanvasSVG(figure)
    grid = figure.subplots(-(-len(motions) // 3), 3, squeeze=False).ravel()
    for axes, motion in zip(grid, motions, strict=False):
        for family, colour in colours.items():
            chosen = [p for p in of(points, motion.name, family) if np.isfinite(p.error)]
            axes.loglog([p.seconds for p in chosen], [p.error for p in chosen], ".", color=colour, alpha=0.35)
            line = front(chosen)
            axes.loglog(line[:, 1], line[:, 0], color=colour, label=family)
        axes.axhline(max(motion.reference.error, 1e-16), color="#26323f", linewidth=0.6, linestyle=":")
        axes.set(title=motion.what, xlabel="time for 1 s of motion, s", ylabel="error, m", ylim=(1e-14, 3))
        axes.title.set_fontsize(9)
        axes.grid(color="#e3e7eb")
        axes.spines[["top", "right"]].set_visible(False)
    for axes in grid[len(motions) :]:
        axes.axis("off")
    grid[0].legend(frameon=False, fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None})


def machine() -> str:
    """One line on where this ran."""
    import mujoco
    import scipy

    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"Python {platform.python_version()}, MuJoCo {mujoco.__version__}, SciPy {scipy.__version__}, one core{load}"


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--motion", nargs="+", choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument("--contender", default="", help="only contenders whose name holds this")
    parser.add_argument("--json", type=Path, help="write every point to a file")
    parser.add_argument("--plot", type=Path, help="write the picture, SVG")
    parser.add_argument("--docs", action="store_true", help="renew docs/integrators.md and its picture")
    parser.add_argument("--points", type=Path, nargs="+", help="read points that --json wrote instead of measuring")
    asked = parser.parse_args()
    motions, points, where = [MOTIONS[name]() for name in asked.motion], [], machine()
    for path in asked.points or ():
        points += [Point(**point) for point in json.loads(path.read_text())["points"]]
    for motion in () if asked.points else motions:
        print(f"{motion.name}: {motion.what}; reference good to {motion.reference.error:.0e} m", flush=True)
        points += measure(motion, asked.contender)
    tables = {
        "machine": where,
        "motions": motions_table(motions, points),
        "ratios": "\n\n".join(times_table(points, error) for error in (1e-4, 1e-6, 1e-8, 1e-10)),
        "claims": claims_table(points),
        "points": points_table(points),
    }
    for name in ("machine", "motions", "ratios", "claims"):
        print(f"\n{tables[name]}")
    if asked.json:
        asked.json.write_text(json.dumps({"machine": where, "points": [asdict(p) for p in points]}, indent=1))
    if asked.plot:
        plot(points, motions, asked.plot)
    if asked.docs:
        plot(points, motions, page.DOCS / "images" / "integrators.svg")
        page.write("integrators.md", tables)


if __name__ == "__main__":
    main()
