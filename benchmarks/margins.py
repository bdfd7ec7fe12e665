"""What enclosed disk margins cost beside the designs that they judge.

python benchmarks/margins.py           # prints the table
python benchmarks/margins.py --docs    # and writes it into docs/control.md

Base rings are pinned, every tendon's length is measured to a millimetre, the period is 20 ms. Processor time of one
process with one BLAS thread.
"""

import argparse
from collections.abc import Iterator

import page
from clock import timed

import tensctl as tc
from tensctl.synthesis.margins import Sensitivity
from tensctl.threads import one_blas_thread

SIZES = ((3, 1), (4, 2), (8, 4))
DT = 0.02
HEAD = ["shell", "loop", "states", "design, s", "weakest input, s", "each input, s", "all at once, s"]
HEAD += ["alpha of the weakest", "of all at once"]


def loops(n: int, m: int) -> Iterator[tuple[str, float, Sensitivity]]:
    scene = tc.Scene(structure={"kind": "shell", "n": n, "m": m, "pins": ["P1_*_1"]})
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    linear = tc.linearize(dynamics, rest, outputs=())
    eyes = tc.sensors(dynamics.structure, lengths=1e-3)
    for dt in (None, DT):
        kind = "sampled" if dt else "continuous"
        taken, design = timed(lambda dt=dt: tc.lqr(linear, dt=dt))
        yield f"LQR, {kind}", taken, design.sensitivity
        taken, design = timed(lambda dt=dt: tc.lqg(linear, eyes, dt=dt))
        yield f"LQG, {kind}", taken, design.sensitivity


def rows(n: int, m: int) -> Iterator[list[object]]:
    for name, designed, s in loops(n, m):
        weakest, (margin, _) = timed(lambda s=s: s.weakest_input)
        each, _ = timed(lambda s=s: s.each_input)
        whole, alpha = "–", "–"
        if not s.costly:
            taken, found = timed(lambda s=s: s.all_inputs)
            whole, alpha = f"{taken:.2g}", f"{found.alpha:.4f}"
        times = (f"{taken:.2g}" for taken in (designed, weakest, each))
        yield [f"({n},{m})", name, len(s.A), *times, whole, f"{margin.alpha:.4f}", alpha]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--docs", action="store_true", help="write the table into docs/control.md")
    asked = parser.parse_args()
    with one_blas_thread():
        text = page.table(HEAD, [row for size in SIZES for row in rows(*size)])
    print(text)
    if asked.docs:
        page.write("control.md", {"margins": text})


if __name__ == "__main__":
    main()
