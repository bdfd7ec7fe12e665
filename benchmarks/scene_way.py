"""A scene's LQR and LQG by harmonics and dense: the LQR alone, and all that `tensctl run` does with either.

python benchmarks/scene_way.py           # prints the table
python benchmarks/scene_way.py --docs    # and writes it into docs/riccati.md

Free shells with [lqr], or [lqg] with every length measured, and [report]. The design begins with the scene and ends
with gain and sample time; the run ends with the report. Processor time with one BLAS thread and kernels at hand, both
ways taken in turn in one process, the better of two. Dense LQR stops at (8,4), dense LQG at (5,2).
"""

import tempfile
import warnings
from pathlib import Path

import numpy as np
import page
from clock import timed
from riccati import shell

import tensctl as tc
from tensctl.pipeline.way import Regulator, lqr_of
from tensctl.scene import LqrStage
from tensctl.threads import one_blas_thread

SIZES = ((3, 1), (4, 1), (3, 2), (4, 2), (5, 2), (6, 3), (8, 4), (20, 10))
HEAD = ["shell", "degrees of freedom", "design by harmonics, s", "dense, s", "times"]
HEAD += ["run with LQR by harmonics, s", "dense, s", "times", "gains differ by"]
HEAD += ["run with LQG by harmonics, s", "dense, s", "times"]
LQR_UP_TO, LQG_UP_TO = 320, 100  # degrees of freedom that dense designs are made of


def designed(scene: tc.Scene, way: str) -> tuple[tc.LinearModel, Regulator]:
    linear = tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene), outputs=())
    found, _ = lqr_of(LqrStage.model_validate({"way": way}), linear)
    assert found.dt > 0
    return linear, found


def ran(scene: tc.Scene, way: str, section: str = "lqr") -> float:
    """Processor time of a whole run."""
    asked: dict = {section: {"way": way}, "report": {}}
    if section == "lqg":
        asked["sensors"] = {"lengths": 1e-3}
    with tempfile.TemporaryDirectory() as folder:
        return timed(lambda: tc.run(scene.replaced(**asked), Path(folder) / "out"))[0]


def row(n: int, m: int) -> list[str]:
    scene, taken, found = shell(n, m), {}, {}
    freedoms = tc.find_equilibrium(scene).potential.manifold.size
    for way in 2 * ("harmonics", "dense"):
        allowed = freedoms if way == "harmonics" else 0
        seconds = np.full(3, np.inf)
        if freedoms <= max(allowed, LQR_UP_TO):
            seconds[0], found[way] = timed(lambda way=way: designed(scene, way))
            seconds[1] = ran(scene, way)
        if freedoms <= max(allowed, LQG_UP_TO):
            seconds[2] = ran(scene, way, "lqg")
        taken[way] = np.minimum(taken.get(way, np.inf), seconds)
    pairs = [beside(*pair) for pair in zip(taken["harmonics"], taken["dense"], strict=True)]
    gap = ""
    if "dense" in found:
        (linear, design), (_, wanted) = found["harmonics"], found["dense"]
        gap = f"{np.abs(design.dense(linear)[0] - wanted.K).max() / np.abs(wanted.K).max():.0e}"
    return [f"({n},{m})", str(freedoms), *pairs[0], *pairs[1], gap, *pairs[2]]


def beside(own: float, dense: float) -> list[str]:
    """Both times and their ratio; without a dense one its cells are empty."""
    known = np.isfinite(dense)
    return [f"{own:.2g}", f"{dense:.2g}" if known else "", f"{dense / own:.2g}" if known else ""]


@one_blas_thread()
def main() -> None:
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    ran(shell(3, 1), "dense")
    page.tell("riccati.md", "scenes", HEAD, (row(*size) for size in SIZES))


if __name__ == "__main__":
    main()
