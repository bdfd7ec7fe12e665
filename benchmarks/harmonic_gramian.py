"""Gramians, observability and controllability harmonic by harmonic at (8,4) and (20,10): processor time and residual.

The table of `docs/controllability.md` is made by `python benchmarks/harmonic_gramian.py`, on one BLAS thread.
"""

import resource
import warnings

import page
from clock import timed

import tensctl as tc
from tensctl.analysis import (
    HarmonicReach,
    harmonic_controllability_gramian,
    harmonic_observability,
    harmonic_observability_gramian,
)
from tensctl.linear import harmonic_outputs
from tensctl.threads import one_blas_thread


def row(n: int, m: int, given: dict, tendons: dict) -> list[str]:
    structure = {"kind": "shell", "n": n, "m": m} | given
    scene = tc.Scene(structure=structure, tendons={"rest_ratio": 0.8} | tendons)
    model = tc.harmonics(tc.build_dynamics(scene), tc.find_equilibrium(scene))
    outputs = harmonic_outputs(model, ["lengths"])
    reach_time, reach = timed(lambda: harmonic_controllability_gramian(model, 10.0))
    sight_time, sight = timed(lambda: harmonic_observability_gramian(outputs, 10.0))
    energy_time, _ = timed(lambda: reach.outputs(outputs))
    report_time, report = timed(lambda: tc.harmonic_controllability(model))
    seen_time, seen = timed(lambda: harmonic_observability(outputs))
    rank_time, rank = timed(lambda: HarmonicReach(model).rank)
    times = [reach_time, sight_time, energy_time, report_time, seen_time, rank_time]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return [
        f"({n},{m}){', damped' if tendons else ''}", str(model.nx), *(f"{t:.2g}" for t in times),
        f"{max(reach.residual, sight.residual):.0e}", f"{report.driven}, {seen.driven}, {rank}", f"{memory:.0f}",
    ]  # fmt: skip


@one_blas_thread()
def main() -> None:
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    head = ["shell", "states", "reach Gramian, s", "length Gramian, s", "energies of all lengths, s"]
    head += ["controllability, s", "observability, s", "static reach, s", "residual", "driven, seen, rank"]
    head += ["process so far, MB"]
    cases = [(8, 4, {}), (20, 10, {"overlap": 0.15})]
    rows = [row(n, m, given, tendons) for n, m, given in cases for tendons in ({}, {"damping": 0.5})]
    table = page.table(head, rows)
    print(table)
    page.write("controllability.md", {"harmonic": table})


if __name__ == "__main__":
    main()
