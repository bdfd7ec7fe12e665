"""How large a push LQR, LQG and MPC recover from on the nonlinear plant, beside the same shells without control.

python benchmarks/recovery.py [--case pinned-3-1 ...] [--json FILE] [--docs]

A top node is pushed for 0.1 s in four directions; the largest force from which the shell comes back is bracketed to
10 %. Rods that touch end a trial; the last table lets them pass through each other, as the equations do.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import page

import tensctl as tc
from tensctl.linear import LinearModel
from tensctl.statics import Equilibrium
from tensctl.threads import one_blas_thread

PERIOD, RATE, CAP, T_END = 0.02, 0.5, 512.0, 40.0
WAYS = ("out", "sideways", "up", "down")
COLOURS = {
    "none": "#9aa5b1", "LQR": "#7db4e0", "sampled LQR": "#0b64a8", "sampled LQR, any speed": "#26323f",
    "LQG": "#7a4fa3", "MPC": "#d9801a",
}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A shell: how many elements and stages, whether its base is pinned, and how far MPC looks ahead."""

    title: str
    n: int
    m: int
    pinned: bool
    horizon: int

    def scene(self) -> tc.Scene:
        """Damped lightly: a twentieth of critical for the lowest flexible mode."""
        structure = {"kind": "shell", "n": self.n, "m": self.m} | ({"pins": ["P1_*_1"]} if self.pinned else {})
        tendons = {"stiffness": 100.0, "rest_ratio": 0.8, "damping": {"ratio": 0.05}}
        return tc.Scene(structure=structure, rods={"mass": 1.0}, tendons=tendons)


CASES = {
    "pinned-3-1": Case("(3,1), base pinned", 3, 1, True, 20),
    "free-3-1": Case("(3,1), free", 3, 1, False, 20),
    "pinned-4-2": Case("(4,2), base pinned", 4, 2, True, 10),
}


@dataclass(frozen=True)
class Point:
    """What was found of one shell, controller and direction."""

    case: str
    controller: str
    way: str
    contact: bool
    low: float
    high: float
    reason: str
    above: int
    slack: int
    slack_share: float
    floor_share: float
    rate_share: float
    peak: float
    strict: str


def controllers(linear: LinearModel, horizon: int) -> dict[str, tuple[Callable[[], object], float]]:
    """How each is made, and how fast rest lengths may change under it, m/s."""
    eyes = tc.sensors(linear.dynamics.structure, lengths=1e-3, seed=7)
    return {
        "none": (lambda: None, RATE),
        "LQR": (lambda: tc.lqr(linear), RATE),
        "sampled LQR": (lambda: tc.lqr(linear, dt=PERIOD), RATE),
        "sampled LQR, any speed": (lambda: tc.lqr(linear, dt=PERIOD), np.inf),
        "LQG": (lambda: tc.lqg(linear, eyes, dt=PERIOD), RATE),
        "MPC": (lambda: tc.MPC(linear, horizon=horizon, dt=PERIOD, rate_max=RATE), RATE),
    }


def pushes(case: Case, rest: Equilibrium) -> dict[str, tc.Push]:
    """Pushes of a top node: away from the axis, along the ring, up and down."""
    node = f"P4_1_{case.m}"
    place = rest.nodes[rest.structure.node_labels.index(node)] - rest.nodes.mean(axis=0)
    out = np.array([place[0], place[1], 0.0]) / np.hypot(place[0], place[1])
    side = np.array([-out[1], out[0], 0.0])
    ways = dict(zip(WAYS, (out, side, [0, 0, 1], [0, 0, -1]), strict=True))
    return {name: tc.Push(node, [float(x) for x in way], 0.0, 0.1) for name, way in ways.items()}


def measure(name: str, *, contact: bool, only: list[str]) -> list[Point]:
    """All controllers and directions of one shell."""
    case = CASES[name]
    scene = case.scene()
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    linear, found = tc.linearize(dynamics, rest, outputs=()), []
    for label, (make, rate) in controllers(linear, case.horizon).items():
        if label not in only:
            continue
        controller = make()
        for way, push in pushes(case, rest).items():
            result = tc.recovery(
                dynamics, rest, controller, disturbances=[push], cap=CAP, t_end=T_END, rate_max=rate, width=0.1,
                below=2, collide=contact,
            )  # fmt: skip
            found.append(_point(name, label, way, contact, result))
            print(f"{name} {label}, {way}, {result} ({found[-1].strict})", flush=True)
    return found


def _point(case: str, controller: str, way: str, contact: bool, result: tc.Recovery) -> Point:
    (low, high), kept = result.bracket[0], result.kept[0]
    try:
        result.verify()
        strict = "same"
    except tc.SimulationError as error:
        strict = str(error)
    used = (0, 0.0, 0.0, 0.0, 0.0) if kept is None else (
        len(kept.slack), kept.slack_share, kept.floor_share, kept.rate_share, kept.peak
    )  # fmt: skip
    return Point(
        case, controller, way, contact, float(low), float(high), result.reasons[0], result.recovered_above[0], *used,
        strict,
    )  # fmt: skip


def largest_table(points: list[Point]) -> str:
    """Largest push by direction, N, and why the next larger one was lost."""
    rows = []
    for case, controller in dict.fromkeys((p.case, p.controller) for p in points):
        chosen = {p.way: p for p in points if (p.case, p.controller) == (case, controller)}
        reasons = sorted({p.reason for p in chosen.values() if p.reason})
        forces = [_force(chosen[way]) if way in chosen else "" for way in WAYS]
        rows.append([CASES[case].title, controller, *forces, ", ".join(reasons)])
    return page.table(["shell", "controller", *(f"{way}, N" for way in WAYS), "what ends it"], rows)


def _force(point: Point) -> str:
    return f"> {point.low:.0f}" if np.isinf(point.high) else f"{point.low:.0f}" + "*" * (point.above > 0)


def limits_table(points: list[Point]) -> str:
    """What is at its limit on the way back from the largest pushes: the ranges over directions."""
    rows = []
    for case, controller in dict.fromkeys((p.case, p.controller) for p in points):
        chosen = [p for p in points if (p.case, p.controller) == (case, controller)]
        shares = [[100 * getattr(p, f"{what}_share") for p in chosen] for what in ("slack", "floor", "rate")]
        peaks = [100 * p.peak for p in chosen]
        rows.append(
            [CASES[case].title, controller, _span([p.slack for p in chosen]), *map(_span, shares), _span(peaks)]
        )
    head = ["tendons that go slack", "any slack, % of the time", "any at its floor, %", "any at full speed, %"]
    return page.table(["shell", "controller", *head, "farthest node, cm"], rows)


def _span(values: list) -> str:
    low, high = round(min(values)), round(max(values))
    return f"{low}" if low == high else f"{low} to {high}"


def plot(points: list[Point], path: Path) -> None:
    """A panel a shell: the largest pushes, direction by direction."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    cases = list(dict.fromkeys(p.case for p in points))
    figure = Figure(figsize=(3.7 * len(cases), 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    grid = figure.subplots(1, len(cases), squeeze=False).ravel()
    for axes, case in zip(grid, cases, strict=True):
        for k, (controller, colour) in enumerate(COLOURS.items()):
            chosen = [p for p in points if (p.case, p.controller) == (case, controller)]
            places = [WAYS.index(p.way) + 0.13 * (k - 2.5) for p in chosen]
            axes.bar(places, [p.low for p in chosen], width=0.12, color=colour, label=controller)
        axes.set(title=CASES[case].title, xticks=range(len(WAYS)), xticklabels=WAYS, ylim=(0, None))
        axes.title.set_fontsize(10)
        axes.grid(axis="y", color="#e3e7eb")
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    grid[0].set_ylabel("largest push of 0.1 s, N")
    figure.legend(
        *grid[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(COLOURS), frameon=False, fontsize=8
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, metadata={"Date": None})


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--case", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--controller", nargs="+", choices=COLOURS, default=list(COLOURS))
    parser.add_argument("--through", action="store_true", help="let rods pass through each other, nothing else")
    parser.add_argument("--json", type=Path, help="write every point to a file")
    parser.add_argument("--points", type=Path, nargs="+", help="read points that --json wrote instead of measuring")
    parser.add_argument("--docs", action="store_true", help="renew docs/recovery.md and its picture")
    asked = parser.parse_args()
    points: list[Point] = []
    for path in asked.points or ():
        points += [Point(**point) for point in json.loads(path.read_text())]
    for name in () if asked.points else asked.case:
        if not asked.through:
            points += measure(name, contact=True, only=asked.controller)
        if asked.through or (asked.docs and name == "pinned-3-1"):
            points += measure(name, contact=False, only=asked.controller)
    points.sort(key=lambda p: (list(CASES).index(p.case), list(COLOURS).index(p.controller)))
    if asked.json:
        asked.json.write_text(json.dumps([asdict(p) for p in points], indent=1))
    touching, through = [p for p in points if p.contact], [p for p in points if not p.contact]
    tables = {
        "largest": largest_table(touching), "limits": limits_table(touching), "through": largest_table(through),
    }  # fmt: skip
    print("\n\n".join(tables.values()))
    if asked.docs:
        plot(touching, page.DOCS / "images" / "recovery.svg")
        page.write("recovery.md", tables)


if __name__ == "__main__":
    main()
