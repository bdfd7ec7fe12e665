"""Programs of prestress that are refused, miss their optimum, or pass although nothing fits: counts over a sweep.

python benchmarks/prestress_optima.py
OPENBLAS_CORETYPE=Haswell python benchmarks/prestress_optima.py    (other kernels, other rounding)

Feasible programs have an answer by construction: a floor below known tensions, a ceiling above them, or no ceiling on a
structure without mechanisms. Infeasible ones have a ceiling below what the least ratio of tensions allows.
"""

import time
from collections import Counter
from collections.abc import Iterator

import numpy as np

import tensctl as tc
from tensctl.errors import EquilibriumError
from tensctl.statics.prestress import admissible_prestress

EXACT = 1e-12


def settled(rng: np.random.Generator) -> Iterator[tuple]:
    """Class 1 shells, whose settled nodes balance to 1e-13: one self-stress, singular only to that."""
    for n, m in ((n, m) for n in range(3, 9) for m in range(1, 5) if n * m <= 24 or (n, m) == (8, 4)):
        rest = tc.find_equilibrium(tc.Scene(structure={"kind": "shell", "n": n, "m": m}))
        T, floor = rest.tensions, 0.5 * rest.tensions.min()
        at = rest.structure, rest.nodes
        yield *at, {"tension_min": floor}
        yield *at, {"tension_min": floor, "tension_max": 1.5 * T.max(), "goal": "largest minimum"}
        for scale in (1e-3, 1.0, 1e3):
            wanted = scale * T * rng.uniform(0.5, 2, T.size)
            yield *at, {"tension_min": scale * floor, "goal": "nearest", "wanted": wanted}


def joined(rng: np.random.Generator) -> Iterator[tuple]:
    """Class 2 shells with many self-stresses; pinned ones under loads of 0.03 to 10 N."""
    for n, m, pins in ((n, m, p) for n in range(3, 9) for m in range(2, 5) for p in ((), ("P1_*_1",)) if n * m <= 18):
        shell = tc.shell(n, m, cls=2, pins=pins)
        count, ceiling = len(shell.tendons), 1.05 * admissible_prestress(shell, tension_min=1.0).tensions.max()
        yield shell, None, {"tension_min": 0.1, "tension_max": ceiling, "goal": "largest minimum"}
        for scale in (1e-3, 1.0, 1.0, 1.0, 1e3):
            near = {"tension_min": scale, "goal": "nearest"}
            yield shell, None, near | {"wanted": scale * rng.uniform(0.5, 6, count)}
            wanted = scale * rng.uniform(0.5, 2 * ceiling, count)
            yield shell, None, near | {"wanted": wanted, "tension_max": scale * ceiling}
            if pins:
                loads = scale * 10.0 ** rng.uniform(-1.5, 1) * rng.standard_normal(shell.nodes.shape)
                yield shell, None, {"tension_min": scale, "loads": loads}


def prisms(short: float) -> Iterator[tuple]:
    """The sides' tension over the base's is known, and the ceiling differs from it by a part `short`."""
    for n in range(3, 10):
        prism = tc.prism(n)
        length = prism.tendon_lengths
        ratio = max(r := 2 * np.sin(np.pi / n) * length[2 * n] / length[0], 1 / r)
        for floor in (1e-3, 1.0, 1e3):
            yield prism, None, {"tension_min": floor, "tension_max": floor * ratio * (1 + short)}


def impossible() -> Iterator[tuple]:
    for short in (-1e-1, -1e-3, -1e-6):
        yield from prisms(short)
    for n in range(3, 10):
        yield tc.prism(n, twist=2.9), None, {"tension_min": 1.0}


def outcome(structure, nodes, given) -> str:
    try:
        found = admissible_prestress(structure, nodes, **given)
    except EquilibriumError as error:
        return "not decided" if "not decided" in str(error) else "refused"
    return "optimal" if max(found.residual, found.beyond, found.gap) <= EXACT else "not optimal"


def main() -> None:
    rng = np.random.default_rng(7)
    sweeps = {
        "settled shells": settled(rng),
        "joined shells": joined(rng),
        "prisms": (one for short in (1e-6, 1e-3, 1.0) for one in prisms(short)),
        "impossible": impossible(),
    }
    for name, programs in sweeps.items():
        start = time.perf_counter()
        counts = Counter(outcome(*one) for one in programs)
        print(f"{name:16s} {sum(counts.values()):4d} programs {dict(counts)} {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
