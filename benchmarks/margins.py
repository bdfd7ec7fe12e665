"""What enclosed disk margins cost beside the designs that they judge.

python benchmarks/margins.py           # prints the table
python benchmarks/margins.py --docs    # and writes it into docs/control.md

Base rings are pinned, every tendon's length is measured to a millimetre, the period is 20 ms. By harmonics the design
begins at the harmonics. Processor time of one process with one BLAS thread.
"""

import argparse
from collections.abc import Iterator
from itertools import chain

import page
from clock import timed
from riccati import SHAPES

import tensctl as tc
from tensctl.synthesis.harmonic_margins import HarmonicSensitivity
from tensctl.synthesis.margins import Sensitivity
from tensctl.threads import one_blas_thread

SIZES = ((3, 1), (4, 2), (8, 4))
HARMONIC = (20, 10)
DT = 0.02
HEAD = ["shell", "loop", "states", "design, s", "weakest input, s", "each input, s", "all at once, s"]
HEAD += ["alpha of the weakest", "of all at once"]


def pinned(n: int, m: int) -> tuple[tc.Dynamics, tc.Equilibrium]:
    shape, ratio = SHAPES.get((n, m), ({}, 0.8))
    structure = {"kind": "shell", "n": n, "m": m, "pins": ["P1_*_1"]} | shape
    scene = tc.Scene(structure=structure, tendons={"rest_ratio": ratio})
    return tc.build_dynamics(scene), tc.find_equilibrium(scene)


def by_harmonics(n: int, m: int) -> Iterator[tuple[str, float, HarmonicSensitivity]]:
    model = tc.harmonics(*pinned(n, m))
    for dt in (None, DT):
        taken, design = timed(lambda dt=dt: tc.harmonic_lqr(model, dt=dt))
        yield f"LQR by harmonics, {'sampled' if dt else 'continuous'}", taken, design.sensitivity


def loops(n: int, m: int) -> Iterator[tuple[str, float, Sensitivity]]:
    dynamics, rest = pinned(n, m)
    linear = tc.linearize(dynamics, rest, outputs=())
    eyes = tc.sensors(dynamics.structure, lengths=1e-3)
    for dt in (None, DT):
        kind = "sampled" if dt else "continuous"
        taken, design = timed(lambda dt=dt: tc.lqr(linear, dt=dt))
        yield f"LQR, {kind}", taken, design.sensitivity
        taken, design = timed(lambda dt=dt: tc.lqg(linear, eyes, dt=dt))
        yield f"LQG, {kind}", taken, design.sensitivity


def rows(n: int, m: int) -> Iterator[list[object]]:
    found = by_harmonics(n, m) if n > 4 else iter(())
    for name, designed, s in chain(loops(n, m) if (n, m) in SIZES else (), found):
        weakest, (margin, _) = timed(lambda s=s: s.weakest_input)
        each = f"{timed(lambda s=s: s.each_input)[0]:.2g}" if isinstance(s, Sensitivity) else "–"
        whole, alpha = "–", "–"
        if not s.costly:
            taken, found = timed(lambda s=s: s.all_inputs)
            whole, alpha = f"{taken:.2g}", f"{found.alpha:.4f}"
        times = (f"{designed:.2g}", f"{weakest:.2g}", each)
        yield [f"({n},{m})", name, states(s), *times, whole, f"{margin.alpha:.4f}", alpha]


def states(s: Sensitivity | HarmonicSensitivity) -> int:
    if isinstance(s, Sensitivity):
        return len(s.A)
    return sum(block.copies * len(one.A) for block, one in zip(s.linear.blocks, s.blocks, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", action="store_true", help="write the table into docs/control.md")
    asked = parser.parse_args()
    with one_blas_thread():
        text = page.table(HEAD, [row for size in (*SIZES, HARMONIC) for row in rows(*size)])
    print(text)
    if asked.docs:
        page.write("control.md", {"margins": text})


if __name__ == "__main__":
    main()
