"""Draw the pictures of the README and the docs from fresh runs.

python docs/make_figures.py
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

import tensctl as tc
from tensctl.synthesis import shell_height

HERE = Path(__file__).parent
INK, GREY, BLUE, ORANGE = "#26323f", "#9aa5b1", "#0b64a8", "#d9801a"


def project(nodes: np.ndarray, turn: float = 0.5, tilt: float = 0.22) -> np.ndarray:
    """Nodes (N, 3) seen from the side, turned about z and tilted: (N, 2)."""
    x = np.cos(turn) * nodes[:, 0] + np.sin(turn) * nodes[:, 1]
    depth = -np.sin(turn) * nodes[:, 0] + np.cos(turn) * nodes[:, 1]
    return np.column_stack([x, np.cos(tilt) * nodes[:, 2] + np.sin(tilt) * depth])


def draw(
    axes: Axes, structure: tc.Structure, nodes: np.ndarray, tensions: np.ndarray, title: str, full: float = 16.0
) -> None:
    """One view of a structure, tendons coloured by tension from 0 to full, N."""
    points = project(nodes)
    tendons = LineCollection(points[structure.tendons], cmap="viridis", linewidths=1.4)
    tendons.set_array(tensions)
    tendons.set_clim(0.0, full)
    axes.add_collection(tendons)
    axes.add_collection(LineCollection(points[structure.rods], colors=INK, linewidths=4.5, capstyle="round"))
    held = points[structure.pinned]
    axes.plot(held[:, 0], held[:, 1] - 0.05, "^", color=INK, markersize=8)
    axes.set(xlim=(-1.35, 1.35), ylim=(-0.5, 1.75), aspect="equal", title=title)
    axes.axis("off")


def mast(out: Path) -> None:
    """The example scene before and after, and its way there."""
    scene = tc.load_scene(HERE.parent / "examples" / "shell_3_1.toml").replaced(report=None)
    with TemporaryDirectory() as folder:
        results = tc.run(scene, Path(folder) / "run")
    run = results.run
    assert run is not None
    figure = Figure(figsize=(11, 3.9), layout="constrained", dpi=160)
    FigureCanvasAgg(figure)
    before, after, error = figure.subplots(1, 3, width_ratios=[1, 1, 1.25])
    height = shell_height(run.structure)
    draw(before, run.structure, run.nodes[0], run.tensions[0], f"at rest: {height.of(run.nodes[0]):.3f} m")
    draw(after, run.structure, run.nodes[-1], run.tensions[-1], f"after 10 s: {height.of(run.nodes[-1]):.3f} m")
    error.semilogy(run.time, 1e3 * run.distance_to(results.wanted.nodes), color=BLUE)
    error.axvspan(5.0, 5.1, color=ORANGE, alpha=0.5)
    error.annotate("5 N push", (5.2, 200), color=ORANGE)
    error.set(xlabel="time, s", ylabel="farthest node from the wanted shape, mm")
    error.grid(axis="y", color="#e3e7eb")
    error.spines[["top", "right"]].set_visible(False)
    figure.savefig(out)


def relaxation(out: Path) -> None:
    """The shell of [S]'s Appendix D: on its cylinder, at rest, and its tendon lengths on the way (Figs. 10 to 12)."""
    scene = tc.load_scene(HERE.parent / "examples" / "appendix_d.toml").replaced(report=None)
    with TemporaryDirectory() as folder:
        run = tc.run(scene, Path(folder) / "run").run
    assert run is not None
    figure = Figure(figsize=(11, 3.9), layout="constrained", dpi=120)
    FigureCanvasAgg(figure)
    start, end, over_time = figure.subplots(1, 3, width_ratios=[1, 1, 1.35])
    highest = float(run.tensions.max())
    draw(start, run.structure, run.nodes[0], run.tensions[0], "start: nodes on a cylinder", highest)
    draw(end, run.structure, run.nodes[-1], run.tensions[-1], f"steady state, after {run.time[-1]:g} s", highest)
    for axes in (start, end):
        axes.set(ylim=(-0.45, 2.05))
    angle = np.linspace(0, 2 * np.pi, 100)
    for level in (run.nodes[0, :, 2].min(), run.nodes[0, :, 2].max()):
        ring = project(np.column_stack([np.cos(angle), np.sin(angle), np.full(100, level)]))
        start.plot(*ring.T, color=GREY, linewidth=0.8, zorder=0)
    for k, (length, index) in enumerate(zip(*np.unique(run.lengths[0].round(9), return_index=True), strict=True)):
        label = f"{length:.3f} m at the start"
        over_time.plot(run.time, run.lengths[:, index], color=(BLUE, ORANGE, GREY, INK)[k], label=label)
    over_time.set(xlabel="time, s", ylabel="tendon length, m", xlim=(0, 1.0))
    over_time.legend(frameon=False)
    over_time.grid(axis="y", color="#e3e7eb")
    over_time.spines[["top", "right"]].set_visible(False)
    figure.savefig(out)


def main() -> None:
    """Write every picture."""
    images = HERE / "images"
    images.mkdir(exist_ok=True)
    mast(images / "mast.png")
    relaxation(images / "appendix_d.png")


if __name__ == "__main__":
    main()
