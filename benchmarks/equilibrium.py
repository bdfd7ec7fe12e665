"""Equilibria: what they cost, how exact they are, and what they say in extreme cases.

python benchmarks/equilibrium.py            # all tables, printed and written into docs/equilibrium.md, and the plot
python benchmarks/equilibrium.py --one 20 10 pushed   # one row of the cost table

Each row of the cost table is a process of its own on one core, so that memory is that of the row alone.
"""

import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import tensctl as tc
from tensctl.elements import Potential
from tensctl.statics import Newton, settle
from tensctl.threads import one_blas_thread

DOCS = Path(__file__).parent.parent / "docs"
SIZES = ((3, 1), (4, 2), (6, 3), (8, 4), (12, 6), (20, 10), (50, 40), (100, 50))
SHAPES = {
    (20, 10): ({"overlap": 0.15}, 0.8),
    (50, 40): ({"radius": 1.25, "overlap": 0.05, "twist": 1.6}, 0.9),
    (100, 50): ({"radius": 1.25, "overlap": 0.05, "twist": 1.6}, 0.9),
}
WAYS = {
    "sector": "free, in one sector",
    "whole": "free, on the whole",
    "pushed": "base pinned, top pushed",
    "pushed-whole": "base pinned, top pushed, symmetry left aside",
}
TARGETS = {
    ("sector", 8): 0.05,
    ("sector", 20): 0.5,
    ("sector", 50): 5.0,
    ("sector", 100): 20.0,
    ("pushed", 8): 0.3,
    ("pushed", 20): 2.0,
    ("pushed", 50): 60.0,
}


def scene(n: int, m: int, way: str) -> tc.Scene:
    shape, ratio = SHAPES.get((n, m), ({}, 0.8))
    pushed = way.startswith("pushed")
    # The tall mast is soft: 0.02 N move its top by 11 m, 0.3 N would move it by 60 m.
    size = 0.02 if n >= 50 else 0.3
    loads = {"loads": {f"P4_1_{m}": [size, -0.6 * size, -1.3 * size]}} if pushed else {}
    pins = ["P1_*_1"] if pushed else []
    structure = {"kind": "shell", "n": n, "m": m, "pins": pins} | shape
    return tc.Scene(structure=structure, tendons={"rest_ratio": ratio}, **loads)


def one(n: int, m: int, way: str) -> dict:
    """The best of a few runs, warm: a small structure of the same kind is solved before."""
    timed(scene(4, 2, way), way)
    row = min((timed(scene(n, m, way), way) for _ in range(5 if n <= 20 else 1)), key=lambda found: found["total"])
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6  # GB on Linux
    return row | {"n": n, "m": m, "way": way, "memory": memory}


def timed(asked: tc.Scene, way: str) -> dict:
    """Cost of building, solving and judging, s."""
    began = time.perf_counter()
    potential = Potential.of(asked)
    built = time.perf_counter()
    rest = settle(potential, symmetric=not way.endswith("whole"))
    solved = time.perf_counter()
    verdict = str(rest.stable)
    judged = time.perf_counter()
    return {
        "build": built - began,
        "solve": solved - built,
        "judge": judged - solved,
        "total": judged - began,
        "freedoms": potential.manifold.size,
        "tendons": len(rest.tensions),
        "steps": rest.iterations,
        "residual": rest.residual,
        "slack": int((rest.tensions == 0).sum()),
        "verdict": verdict,
    }


def in_own_process(n: int, m: int, way: str) -> dict:
    done = subprocess.run(
        [sys.executable, __file__, "--one", str(n), str(m), way],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "MKL", "OMP")},
    )
    return json.loads(done.stdout)


def cost_rows() -> list[dict]:
    rows = []
    for way in WAYS:
        for n, m in SIZES:
            if (n, m) == (100, 50) and way != "sector":
                continue
            rows.append(in_own_process(n, m, way))
            print(".", end="", file=sys.stderr, flush=True)
    return rows


def cost_table(rows: list[dict]) -> str:
    head = "| way | (n,m) | dof | tendons | steps | build s | solve s | judge s | total s | target s | GB | residual "
    head += "| slack | stable |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    lines = []
    for r in rows:
        target = TARGETS.get((r["way"], r["n"]))
        cells = [WAYS[r["way"]], f"({r['n']},{r['m']})", r["freedoms"], r["tendons"], r["steps"]]
        cells += [f"{r[key]:.3f}" for key in ("build", "solve", "judge", "total")]
        cells += [target or "", f"{r['memory']:.2f}", f"{r['residual']:.0e}", r["slack"], r["verdict"]]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return head + "\n".join(lines)


def plot(rows: list[dict]) -> None:
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "tensctl"
    import matplotlib.pyplot as plt

    figure, (times, memories) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    for way, mark in zip(WAYS, "os^v", strict=True):
        own = [r for r in rows if r["way"] == way]
        nm = [r["n"] * r["m"] for r in own]
        times.loglog(nm, [r["total"] for r in own], marker=mark, label=WAYS[way])
        memories.loglog(nm, [r["memory"] for r in own], marker=mark)
    targets = [(n * m, t) for (way, k), t in TARGETS.items() for n, m in SIZES if way == "sector" and k == n]
    times.plot(*zip(*targets, strict=True), "k_", markersize=14, label="target in one sector")
    times.set(xlabel="nm, half the number of rods", ylabel="build, solve and judge, s")
    memories.set(xlabel="nm", ylabel="memory of the process, GB")
    for axes in (times, memories):
        axes.grid(True, which="major", alpha=0.3)
    times.legend(fontsize=7)
    figure.savefig(DOCS / "images" / "equilibrium_cost.svg", metadata={"Date": None})


def exact_lengths(rest, digits: int = 40) -> np.ndarray:
    """Tendon lengths at the rest to many digits, as offsets from the given ones: Newton with an exact right side.

    Nodes are decimals; the correction solves with the Hessian in double precision, so each round adds some ten digits.
    """
    from decimal import Decimal, getcontext

    getcontext().prec = digits
    dec = np.vectorize(Decimal, otypes=[object])
    structure, members, manifold = rest.structure, rest.potential.members, rest.potential.manifold
    nodes = dec(rest.nodes)
    lengths, stiffness, loads = dec(rest.rest_lengths), dec(members.stiffness), dec(members.forces)
    rod_lengths = dec(structure.rod_lengths)
    J, held = rest.point.tangent.toarray(), np.linalg.qr(rest.spectrum.rigid.basis)[0]
    H = rest.point.hessian.toarray() + held @ held.T * np.abs(rest.point.hessian).max()
    root = np.vectorize(lambda x: x.sqrt(), otypes=[object])

    def spans():
        d = nodes[structure.tendons[:, 1]] - nodes[structure.tendons[:, 0]]
        return d, root((d * d).sum(axis=1))

    size = np.inf
    for _ in range(8):
        d, long = spans()
        stretch = (long - lengths) * dec((long > lengths).astype(float))
        pull = (stiffness * stretch)[:, None] * d / long[:, None]
        force = loads.copy()
        for (a, b), f in zip(structure.tendons, pull, strict=True):
            force[a] += f
            force[b] -= f
        across = force.copy()
        for r, (a, b) in enumerate(structure.rods):
            e = (nodes[b] - nodes[a]) / rod_lengths[r]
            pair = (
                (force[b] - force[a]) if manifold.hold[r] == 0 else (force[b] if manifold.hold[r] == 1 else -force[a])
            )
            thrust = (pair * e).sum() / (2 if manifold.hold[r] == 0 else 1)
            across[a] += thrust * e
            across[b] -= thrust * e
        across[structure.pinned] = Decimal(0)
        size = float(max(abs(x) for x in across.ravel()))
        if size < 1e-30:
            break
        step = np.linalg.solve(H, J.T @ (across / Decimal(size)).astype(float).ravel())
        nodes = nodes + dec((J @ step).reshape(-1, 3)) * Decimal(size)
        _restore_rods(nodes, structure, manifold, rod_lengths, Decimal)
    assert size < 1e-20, f"the reference is balanced to {size:.0e} N only"
    return (spans()[1] - dec(rest.lengths)).astype(float)


def _restore_rods(nodes, structure, manifold, rod_lengths, decimal) -> None:
    """Rod lengths exact again, about the centre or the held end."""
    for r, (a, b) in enumerate(structure.rods):
        e = nodes[b] - nodes[a]
        size = (e * e).sum().sqrt()
        surplus = e * (decimal(1) - rod_lengths[r] / size)
        if manifold.hold[r] == 0:
            nodes[a], nodes[b] = nodes[a] + surplus / 2, nodes[b] - surplus / 2
        elif manifold.hold[r] == 1:
            nodes[b] = nodes[b] - surplus
        elif manifold.hold[r] == 2:
            nodes[a] = nodes[a] + surplus


def precision_table() -> str:
    """Error of tendon lengths against time, over tolerances, against decimals of 40 digits."""
    base = {"kind": "shell", "n": 3, "m": 1}
    cases = {
        "(3,1) free": tc.Scene(structure=base),
        "(3,1) pinned, pushed": tc.Scene(structure=base | {"pins": ["P1_*_1"]}, loads={"P4_1_1": [5.0, 0.0, -10.0]}),
        "(4,2) free": tc.Scene(structure={"kind": "shell", "n": 4, "m": 2}),
        "prism, prestress 1e-6 k l": tc.Scene(structure={"kind": "prism", "n": 3}, tendons={"rest_ratio": 1 - 1e-6}),
    }
    lines = ["| case | tol | steps | residual | attainable | largest error of a length, m | ms |"]
    lines.append("|---|---|---|---|---|---|---|")
    for name, asked in cases.items():
        potential = Potential.of(asked)
        reference = settle(potential, newton=Newton(1e-16))
        offsets = exact_lengths(reference)
        for tol in (1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
            runs = [_newton(potential, reference.rest_lengths, tol) for _ in range(5)]
            rest, best = runs[0][0], min(seconds for _, seconds in runs)
            error = np.abs(rest.lengths - reference.lengths - offsets).max()
            cells = [
                name,
                f"{tol:.0e}",
                rest.iterations,
                f"{rest.residual:.1e}",
                f"{rest.attainable:.1e}",
                f"{error:.1e}",
            ]
            lines.append("| " + " | ".join(map(str, [*cells, f"{1e3 * best:.1f}"])) + " |")
    return "\n".join(lines)


def _newton(potential: Potential, rest_lengths: np.ndarray, tol: float) -> tuple[tc.Equilibrium, float]:
    began = time.perf_counter()
    point, steps = Newton(tol).minimise(potential, potential.structure.nodes, rest_lengths)
    return tc.Equilibrium(potential, point.nodes, rest_lengths, steps), time.perf_counter() - began


def extreme_scenes() -> dict[str, tc.Scene]:
    base = {"kind": "shell", "n": 3, "m": 1, "pins": ["P1_*_1"]}
    found = {}
    for ratio in (1.0, 1e3, 1e6, 1e9, 1e12):
        stiffness = {"*": 100.0, "t5_1_1": 100.0 * ratio}
        found[f"(3,1), one tendon {ratio:.0e} times stiffer"] = tc.Scene(
            structure=base, tendons={"stiffness": stiffness}
        )
    for part in (1e-9, 1e-6, 1e-3, 0.5, 0.99):
        found[f"prism, rest_ratio 1 - {part:g} (first-order mechanism)"] = tc.Scene(
            structure={"kind": "prism", "n": 3}, tendons={"rest_ratio": 1 - part}
        )
    for part in (1e-9, 1e-3):
        found[f"(3,1) on its base, rest_ratio 1 - {part:g} (tendons come loose)"] = tc.Scene(
            structure=base, tendons={"rest_ratio": 1 - part}
        )
    for length in (1.0, 1e3, 1e6):
        found[f"(3,1) tied to a hanging rod of {length:.0e} m"] = _hung(length)
        found[f"prism with a rod of {length:.0e} m that only hangs by one end"] = _dangling(length)
    for gap in (1e-6, 1e-12):
        found[f"prism and a rod, two nodes {gap:.0e} m apart"] = _close(gap)
    found["(3,1) squashed by 100 N a node"] = tc.Scene(structure=base, loads={"P4_*_1": [0.0, 0.0, -100.0]})
    found["stayed post pushed into a corner (half of the stays slack)"] = _stayed()
    found["(3,1) all slack"] = tc.Scene(structure=base, tendons={"rest_ratio": 1.2})
    pendulum = {"kind": "network", "rods": {"rod": ["o", "head"]}, "tendons": {"tie": ["head", "anchor"]}}
    pendulum |= {"nodes": {"o": [0, 0, 0], "head": [1, 0, 0], "anchor": [-1.5, 0, 0]}, "pins": ["o", "anchor"]}
    found["rod pulled towards its pin (nothing stable here)"] = tc.Scene(structure=pendulum)
    return found


def _hung(length: float) -> tc.Scene:
    recipe = tc.shell(3, 1, pins=["P1_*_1"]).as_recipe()
    top = max(p[2] for p in recipe["nodes"].values())
    recipe["nodes"] |= {"foot": [0, 0, top + 0.5], "far": [0, 0, top + 0.5 + length]}
    recipe["rods"]["long"], recipe["pins"] = ["foot", "far"], [*recipe["pins"], "far"]
    recipe["tendons"] |= {f"x{i}": ["foot", f"P4_{i}_1"] for i in (1, 2, 3)}
    return tc.Scene(structure=recipe)


def _dangling(length: float) -> tc.Scene:
    recipe = tc.prism(3).as_recipe()
    recipe["nodes"] |= {"c": [0, 0, -2.0], "d": [0, 0, -2.0 - length]}
    recipe["rods"]["long"] = ["c", "d"]
    recipe["tendons"] |= {f"x{i}": ["c", f"a{i}"] for i in (1, 2, 3)}
    return tc.Scene(structure=recipe)


def _close(gap: float) -> tc.Scene:
    recipe = tc.prism(3).as_recipe()
    x, y, z = recipe["nodes"]["b1"]
    recipe["nodes"] |= {"e": [x + gap, y, z], "f": [x + 1, y, z + 1]}
    recipe["rods"]["x"] = ["e", "f"]
    recipe["tendons"] |= {f"y{i}": ["e", f"b{i}"] for i in (1, 2, 3)} | {f"z{i}": ["f", f"b{i}"] for i in (1, 2, 3)}
    return tc.Scene(structure=recipe, tendons={"rest_length": {"*": 0.8, "y1": 0.5 * gap}})


def _stayed() -> tc.Scene:
    nodes = {"foot": [0, 0, 0], "head": [0, 0, 2.0]}
    nodes |= {f"g{k}": [3 * np.cos(k * np.pi / 2), 3 * np.sin(k * np.pi / 2), 0] for k in range(4)}
    ties = {f"s{k}": ["head", f"g{k}"] for k in range(4)}
    recipe = {"kind": "network", "nodes": nodes, "rods": {"mast": ["foot", "head"]}, "tendons": ties}
    return tc.Scene(structure=recipe | {"pins": ["foot", "g*"]}, loads={"head": [200.0, 200.0, 0.0]})


def extreme_table() -> str:
    lines = ["| case | steps | residual | attainable | slack | smallest omega^2, rad^2/s^2 | stable |"]
    lines.append("|---|---|---|---|---|---|---|")
    for name, asked in extreme_scenes().items():
        rest = tc.find_equilibrium(asked)
        slack = f"{(rest.tensions == 0).sum()} of {len(rest.tensions)}"
        cells = [name, rest.iterations, f"{rest.residual:.0e}", f"{rest.attainable:.0e}", slack]
        lines.append("| " + " | ".join(map(str, [*cells, f"{rest.smallest:.2e}", rest.stable])) + " |")
    return "\n".join(lines)


def write(tables: dict[str, str]) -> None:
    """Put each table between its markers in the page."""
    page = DOCS / "equilibrium.md"
    text = page.read_text(encoding="utf-8")
    for name, table in tables.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        text = re.sub(pattern, lambda found, table=table: f"{found[1]}{table}\n{found[2]}", text, flags=re.DOTALL)
    page.write_text(text, encoding="utf-8")


@one_blas_thread()
def main() -> None:
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(one(int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])))
        return
    rows = cost_rows()
    plot(rows)
    tables = {"cost": cost_table(rows), "precision": precision_table(), "extremes": extreme_table()}
    for table in tables.values():
        print(f"\n{table}")
    write(tables)


if __name__ == "__main__":
    main()
