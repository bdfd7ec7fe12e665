"""A scene's LQR by harmonics and dense: the design alone, and all that `tensctl run` does with it.

python benchmarks/scene_way.py           # prints the table
python benchmarks/scene_way.py --docs    # and writes it into docs/riccati.md

Free shells with [lqr] and [report]. The design begins with the equilibrium and ends with gain and sample time; the run
begins with the scene and ends with the report. Processor time with one BLAS thread and kernels at hand, both ways taken
in turn in one process, the better of two. Dense ones stop at (8,4).
"""

import argparse
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
HEAD += ["`tensctl run` by harmonics, s", "dense, s", "times", "gains differ by"]


def designed(scene: tc.Scene, way: str) -> tuple[tc.LinearModel, Regulator]:
    linear = tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene), outputs=())
    found, _ = lqr_of(LqrStage.model_validate({"way": way}), linear)
    assert found.dt > 0
    return linear, found


def ran(scene: tc.Scene, way: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        tc.run(scene.replaced(lqr={"way": way}, report={}), Path(folder) / "out")


def row(n: int, m: int) -> list[str]:
    scene, taken, found = shell(n, m), {}, {}
    ways = ("harmonics", "dense") if (n, m) != (20, 10) else ("harmonics",)
    for way in 2 * ways:
        seconds, found[way] = timed(lambda way=way: designed(scene, way))
        both = np.array([seconds, timed(lambda way=way: ran(scene, way))[0]])
        taken[way] = np.minimum(taken.get(way, np.inf), both)
    linear, design = found["harmonics"]
    cells = [f"({n},{m})", str(linear.equilibrium.potential.manifold.size)]
    for own, dense in zip(taken["harmonics"], taken.get("dense", (None, None)), strict=True):
        cells += [f"{own:.2g}", *(("", "") if dense is None else (f"{dense:.2g}", f"{dense / own:.2g}"))]
    if "dense" in found:
        wanted = found["dense"][1].K
        cells.append(f"{np.abs(design.dense(linear)[0] - wanted).max() / np.abs(wanted).max():.0e}")
    return cells + [""] * (len(HEAD) - len(cells))


@one_blas_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--docs", action="store_true", help="write the table into docs/riccati.md")
    docs, rows = parser.parse_args().docs, []
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    ran(shell(3, 1), "dense")
    for size in SIZES:
        rows.append(row(*size))
        print(rows[-1], flush=True)
    text = page.table(HEAD, rows)
    print(text)
    if docs:
        page.write("riccati.md", {"scenes": text})


if __name__ == "__main__":
    main()
