"""Long runs and hard cases: what is kept, what drifts, what is refused.

    python benchmarks/stability.py               # every row, some minutes
    python benchmarks/stability.py --only spin   # rows whose name holds a word
    python benchmarks/stability.py --docs        # also renews docs/stability.md

Each row says what was run, what was found against what is wanted, and whether it holds. Trajectories are compared with
references made without tensctl's kernels (`motions.py`), energies and momenta with their first values.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import page
from motions import MOTIONS, TIMES, Motion, distance, kicked, released, scene

import tensctl as tc
from tensctl.errors import SimulationError
from tensctl.simulation import momenta, total_energy
from tensctl.simulation.integrators.tables import LONG, TABLES

# How long a trial runs that tells how many steps a second of motion takes, s; the first second has fewer than most.
_TRIAL = 20.0


@dataclass(frozen=True)
class Found:
    """One number beside the largest that is acceptable."""

    what: str
    value: float
    limit: float

    @property
    def holds(self) -> bool:
        """Whether it is acceptable; nan is not."""
        return bool(self.value <= self.limit)


@dataclass(frozen=True)
class Row:
    """What was run and what was found."""

    name: str
    what: str
    found: tuple[Found, ...]
    remark: str = ""

    @property
    def holds(self) -> bool:
        """Whether everything is acceptable."""
        return all(f.holds for f in self.found)


def simulated(motion: Motion, times: np.ndarray = TIMES, **settings) -> tc.Run:
    """A run of a motion at the default settings, unless others are given."""
    return tc.simulate(motion.dynamics, (motion.nodes, motion.velocities), timepts=times, **settings)


def momentum_drift(dynamics: tc.Dynamics, run: tc.Run) -> float:
    """Largest change of the momentum, and of the angular momentum about the mass centre, over their terms' sizes."""
    rods, mass = dynamics.structure.rods, dynamics.members.mass
    linear, about_origin = momenta(dynamics, run)
    centres = run.nodes[:, rods].mean(axis=2)
    centre = np.einsum("r,tri->ti", mass, centres) / mass.sum()
    angular = about_origin - np.cross(centre, linear)
    speed = np.linalg.norm(run.velocities[:, rods], axis=3).max(axis=2)
    size = np.linalg.norm(run.nodes[:, rods] - centre[:, None, None], axis=3).max(axis=2)
    scale = (mass * speed).sum(axis=1).max()
    turning = (mass * speed * size).sum(axis=1).max()
    worst = np.abs(linear - linear[0]).max() / scale, np.abs(angular - angular[0]).max() / turning
    return float(max(worst))


def energy_of(dynamics: tc.Dynamics, run: tc.Run) -> np.ndarray:
    """Energy over its first value, less one."""
    energy = total_energy(dynamics, run)
    return energy / energy[0] - 1


def secular(energy: np.ndarray) -> float:
    """How far the energy's mean moves from the first half of a run to the second."""
    half = len(energy) // 2
    return float(abs(energy[half:].mean() - energy[:half].mean()))


def standing(motion: Motion) -> Motion:
    """The same motion seen from its mass centre, so that it does not drift away to where rounding is coarser."""
    rods, mass = motion.dynamics.structure.rods, motion.dynamics.members.mass
    drift = np.einsum("r,rni->i", mass, motion.velocities[rods]) / (2 * mass.sum())
    return replace(motion, velocities=motion.velocities - drift)


def kept(motion: Motion, run: tc.Run, energy: float, momentum: float = 1e-12) -> tuple[Found, ...]:
    """Rod lengths, momenta and energy of a free undamped run."""
    swing = float(np.abs(energy_of(motion.dynamics, run)).max())
    return (
        Found("rod length", run.rod_drift, 1e-13),
        Found("momenta", momentum_drift(motion.dynamics, run), momentum),
        Found("energy", swing, energy),
    )


def long_taut() -> Row:
    """Steps without end on a motion that stays taut: rounding walks, nothing else may."""
    motion = standing(kicked("long", "", scene(3, 1), 0.05))
    # Rounding of 1e7 steps walks to about 1e7^(1/2) eps = 7e-13; a systematic loss would reach 1e7 eps = 2e-9.
    return _long("1e7 steps, taut", motion, 1e7, LONG[4].drifts.size, drift=1e-11)


def long_switching() -> Row:
    """Steps without end with slack-taut switches; energy is kept as well as switches are met."""
    return _long("1e6 steps, switching", MOTIONS["switching_3_1"](), 1e6, TABLES[4].drifts.size, drift=1e-6)


def _long(name: str, motion: Motion, steps: float, flights: int, drift: float) -> Row:
    """Steps are force evaluations over a table's flights: trials of a landing count, as they cost what a step does."""
    trial = simulated(motion, np.array([0.0, _TRIAL]), tol=1e-6, method="splitting4")
    end = _TRIAL * steps * flights / trial.evaluations
    began = time.process_time()
    run = simulated(motion, np.linspace(0, end, 401), tol=1e-6, method="splitting4")
    seconds = time.process_time() - began
    moved = secular(energy_of(motion.dynamics, run))
    remark = f"{run.evaluations / flights:.2g} steps, {end:.2g} s of motion, {run.switches} switches, {seconds:.0f} s"
    found = (*kept(motion, run, 1e-6), Found("energy, half against half", moved, drift))
    return Row(name, "free (3,1), tol 1e-6", found, remark)


def stiffnesses() -> Row:
    """The same motion in other units of time: k from 1 to 1e9."""
    base = MOTIONS["switching_3_1"]()
    worst = 0.0
    for exponent in range(10):
        k = 10.0**exponent
        motion = released("", "", scene(3, 1, stiffness=k))
        run = simulated(motion, TIMES * np.sqrt(100 / k))
        worst = max(worst, distance(run.nodes, base.reference.nodes))
    found = (Found("error, m", worst, 1e-9),)
    return Row("k from 1 to 1e9 N/m", "(3,1) released, time scaled with sqrt(k)", found, "ten stiffnesses")


def mixed_stiffness() -> Row:
    """Tendons of 1 and 1e9 N/m in one structure."""
    tendons = {
        "stiffness": {"*": 1.0, "t5_*": 1e9, "t8_*": 1e9},
        "rest_ratio": {"*": 0.8, "t5_*": 0.999, "t8_*": 0.999},
    }
    motion = released("", "", tc.Scene(structure=tc.shell(3, 1), tendons=tendons))
    run = simulated(motion, np.linspace(0, 0.1, 11))
    return Row("stiffness ratio 1e9", "(3,1), t5 and t8 with 1e9 N/m, others 1", kept(motion, run, 1e-6), _counts(run))


def mass_ratios() -> list[Row]:
    """One heavy rod among light ones."""
    rows = []
    for ratio in (1e2, 1e4, 1e6, 1e8):
        asked = scene(3, 1).replaced(rods={"mass": {"*": 1.0, "r1_1_1": ratio}})
        motion = released("", "", asked)
        run = simulated(motion)
        name, what = f"rod mass ratio {ratio:.0e}", "(3,1) released, one heavy rod"
        rows.append(Row(name, what, kept(motion, run, 1e-8), _counts(run)))
    return rows


def too_large_steps() -> list[Row]:
    """The loosest tolerances there are: an answer that keeps its energy, or a refusal."""
    rows = []
    for tol in (0.1, 0.5, 0.99):
        for name in ("switching_3_1", "smooth_3_1"):
            motion = MOTIONS[name]()
            rows.append(_coarse(f"tol {tol:g} on {name}", motion, tol))
    for speed in (10.0, 1e3, 1e5):
        motion = kicked("fast", f"(3,1), kicked at {speed:g} m/s", scene(3, 1), speed)
        rows.append(_coarse(f"kicked at {speed:g} m/s", motion, 1e-4, np.array([0.0, 1.0])))
    return rows


def _coarse(name: str, motion: Motion, tol: float, times: np.ndarray = TIMES) -> Row:
    try:
        run = simulated(motion, times, tol=tol)
    except SimulationError as refusal:
        return Row(name, motion.what, (), f"refused: {refusal}")
    swing = float(np.abs(energy_of(motion.dynamics, run)).max())
    # Where a run ends far away, rod lengths are lost to the rounding of its coordinates.
    rounding = 4 * np.finfo(float).eps * np.abs(run.nodes).max() / motion.dynamics.structure.rod_lengths.min()
    found = Found("rod length", run.rod_drift, max(1e-13, rounding)), Found("energy", swing, max(1e-3, 0.1 * tol))
    return Row(name, motion.what, found, _counts(run))


def switching() -> Row:
    """Many switches a second at the default setting."""
    motion = MOTIONS["switching_3_1"]()
    run = simulated(motion)
    found = (Found("error, m", distance(run.nodes, motion.reference.nodes), 1e-10), *kept(motion, run, 1e-10))
    return Row(
        "switches", motion.what, found, f"{motion.reference.switches} switches; counted by the run: {run.switches}"
    )


def caught() -> Row:
    """Every tendon slack, rods flying apart, the net catching them."""
    base = released("caught", "(3,1), rest lengths 1.05 l, flying apart", scene(3, 1, rest_ratio=1.05))
    rods = base.dynamics.structure.rods
    middles = base.nodes[rods].mean(axis=1)
    away = 0.6 * (middles - middles.mean(axis=0))
    velocities = np.zeros_like(base.nodes)
    velocities[rods] = away[:, None]
    motion = replace(base, velocities=velocities)
    run = simulated(motion)
    slack = [(length <= rest).all() for length, rest in zip(run.lengths, run.rest_lengths, strict=True)]
    found = (Found("error, m", distance(run.nodes, motion.reference.nodes), 1e-9), *kept(motion, run, 1e-9))
    remark = f"{motion.reference.switches} switches; all slack at {sum(slack)} of {len(slack)} records"
    return Row("all slack, caught again", motion.what, found, remark)


def spinning() -> list[Row]:
    """One rod of a resting shell turns fast about its middle; no record in between shortens the steps."""
    rows = []
    for spin in (10.0, 100.0, 1000.0, 1e4):
        end = np.array([0.0, min(1.0, 30.0 / spin)])
        motion = _spinning(spin)
        run = simulated(motion, end)
        strict = simulated(motion, end, tol=1e-13)
        other = simulated(motion, end, tol=1e-10, method="dopri5")
        found = (
            Found("against tol 1e-13, m", distance(run.nodes, strict.nodes), 1e-8),
            Found("against dopri5, m", distance(run.nodes, other.nodes), 1e-6),
            *kept(motion, run, 1e-8),
        )
        rows.append(Row(f"rod spinning at {spin:g} rad/s", f"(3,1) at rest, {end[1]:g} s", found, _counts(run)))
        if spin >= 1000:
            rows.append(_coarse(f"rod spinning at {spin:g} rad/s, tol 1e-4", motion, 1e-4, end))
    return rows


def _spinning(spin: float) -> Motion:
    motion = kicked("spin", "one rod spins", scene(3, 1), 0.0)
    a, b = motion.dynamics.structure.rods[0]
    rod = motion.nodes[b] - motion.nodes[a]
    across = np.cross(rod, [0.3, -0.5, 0.8])
    across *= 0.5 * np.linalg.norm(rod) * spin / np.linalg.norm(across)
    velocities = np.zeros_like(motion.nodes)
    velocities[a], velocities[b] = -across, across
    return replace(motion, velocities=velocities)


def on_the_boundary() -> list[Row]:
    """Every tendon exactly as long as its rest length."""
    still = released("", "(3,1), rest lengths = lengths, at rest", scene(3, 1, rest_ratio=1.0))
    run = simulated(still)
    moved = float(np.abs(run.nodes - still.nodes).max())
    rows = [Row("at rest on the slack boundary", still.what, (Found("moved, m", moved, 1e-14),), _counts(run))]
    rest = kicked("boundary", "(3,1), rest lengths = lengths, kicked", scene(3, 1, rest_ratio=1.0), 0.0)
    velocities = (rest.dynamics.potential.manifold.tangent(still.nodes) @ np.full(30, 0.2)).reshape(-1, 3)
    motion = replace(rest, nodes=still.nodes, velocities=velocities)
    run = simulated(motion)
    found = (Found("error, m", distance(run.nodes, motion.reference.nodes), 1e-9), *kept(motion, run, 1e-9))
    rows.append(Row("kicked off the slack boundary", motion.what, found, f"{motion.reference.switches} switches"))
    return rows


def units() -> list[Row]:
    """The same motion of structures of a micrometre and of a thousand kilometres, of a microgram and a gigagram."""
    base, rows = MOTIONS["switching_3_1"](), []
    for size, mass in ((1e-6, 1.0), (1e6, 1.0), (1.0, 1e-9), (1.0, 1e9), (1e-6, 1e-9), (1e6, 1e9)):
        shell = tc.shell(3, 1, radius=size, height=size, overlap=0.3 * size)
        asked = tc.Scene(structure=shell, rods={"mass": mass}, tendons={"stiffness": 100 * mass})
        run = simulated(released("", "", asked))
        error = distance(run.nodes / size, base.reference.nodes)
        rows.append(
            Row(f"{size:g} m, {mass:g} kg", "(3,1) released", (Found("error over size", error, 1e-10),), _counts(run))
        )
    return rows


def _counts(run: tc.Run) -> str:
    return f"{run.method}, {run.evaluations} right-hand sides, {run.switches} switches"


ROWS: dict[str, Callable[[], Row | list[Row]]] = {
    "switches": switching,
    "caught": caught,
    "boundary": on_the_boundary,
    "stiffness": stiffnesses,
    "mixed stiffness": mixed_stiffness,
    "mass": mass_ratios,
    "units": units,
    "spin": spinning,
    "coarse": too_large_steps,
    "long switching": long_switching,
    "long taut": long_taut,
}


def as_table(rows: list[Row]) -> str:
    """The rows as a markdown table."""
    cells = []
    for row in rows:
        found = "; ".join(f"{f.what} {f.value:.1e} ({f.limit:.0e})" for f in row.found)
        cells.append([row.name, row.what, found or "-", row.remark, "holds" if row.holds else "**fails**"])
    return page.table(["case", "motion", "found (wanted)", "remark", "verdict"], cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", default="", help="rows whose name holds this")
    parser.add_argument("--docs", action="store_true", help="renew docs/stability.md")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # rods that pass through each other are told of; here that is no matter
    rows: list[Row] = []
    for name, make in ROWS.items():
        if asked.only not in name:
            continue
        try:
            made = make()
        except SimulationError as fault:
            made = Row(name, (make.__doc__ or "").splitlines()[0], (Found("an answer", np.nan, 0),), str(fault))
        made = made if isinstance(made, list) else [made]
        rows += made
        print(as_table(made).split("\n", 2)[2], flush=True)
    if asked.docs:
        page.write("stability.md", {"stability": as_table(rows)})


if __name__ == "__main__":
    main()
