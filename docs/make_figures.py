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


def draw(axes: Axes, structure: tc.Structure, nodes: np.ndarray, tensions: np.ndarray, title: str) -> None:
    """One view of a structure, tendons coloured by tension."""
    points = project(nodes)
    tendons = LineCollection(points[structure.tendons], cmap="viridis", linewidths=1.4)
    tendons.set_array(np.minimum(tensions, 16.0))
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


def main() -> None:
    """Write every picture."""
    images = HERE / "images"
    images.mkdir(exist_ok=True)
    mast(images / "mast.png")


if __name__ == "__main__":
    main()
