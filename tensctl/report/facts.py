"""The headline: what a reader wants to know first, each fact with a mark when it can be good or bad."""

from dataclasses import dataclass

import numpy as np

from tensctl.report.case import Case
from tensctl.report.floor import floor_story
from tensctl.report.numbers import count, number, plain, plural, seconds
from tensctl.structure import Structure

GOOD, BAD, DOUBT, PLAIN = "good", "bad", "doubt", ""
_NOT_DRIVEN = (("no", "not driven"), ("undecided", "undecided"))
# A gain that is known to fewer than three digits is marked: its residual alone would look good.
KNOWN = 1e-3
_STABILITY = {"yes": GOOD, "no": BAD, "undecided": DOUBT, "no prestress": BAD}


@dataclass(frozen=True)
class Tile:
    """One fact: name, value with unit, a line of explanation, a mark (good, bad, doubt or none)."""

    label: str
    value: str
    note: str = ""
    mark: str = PLAIN


def tiles(case: Case) -> tuple[Tile, ...]:
    """The headline facts that the case has, in the order of the work."""
    groups = (_built(case), _rest(case), _designed(case), _ran(case))
    return tuple(tile for group in groups for tile in group)


def verdict(case: Case) -> Tile | None:
    """One sentence about all numerical checks together; None without checks."""
    if not case.checks:
        return None
    failed = [check.name for check in case.checks if not check.ok]
    if not failed:
        count = len(case.checks)
        said = "The one numerical check holds" if count == 1 else f"All {count} numerical checks hold"
        return Tile("Checks", said, "", GOOD)
    names = ", ".join(failed)
    return Tile("Checks", f"{len(failed)} of {plural(len(case.checks), 'numerical check')} failed", names, BAD)


def _built(case: Case) -> list[Tile]:
    structure, linear = case.structure, case.linear
    pieces = len(structure.segments)
    cables = f"cables among them, {count(pieces)} segments" if pieces > len(structure.tendons) else ""
    facts = [
        Tile(
            "Rods",
            count(len(structure.rods)),
            _ground(structure),
        ),
        Tile("Tendons", count(len(structure.tendons)), cables),
    ]
    if linear is not None:
        facts.append(Tile("Inputs", count(len(linear.inputs)), "rest lengths"))
        facts.append(Tile("Degrees of freedom", count(len(linear.modes)), plural(len(linear.states), "state")))
    return facts


def _rest(case: Case) -> list[Tile]:
    rest = case.equilibrium
    if rest is None:
        return []
    stable = str.__str__(rest.stable)
    note = f"least ω² {number(rest.smallest, 3)} rad²/s²"
    return [
        Tile(f"Stable{_within(case.structure)}", stable, note, _STABILITY.get(stable, DOUBT)),
        Tile(
            "Energy",
            f"{number(rest.energy)} J",
            f"tensions {number(float(np.min(rest.tensions)), 3)} to {number(float(np.max(rest.tensions)), 3)} N",
        ),
        Tile("Force residual", number(rest.residual, 2), f"after {plural(rest.iterations, 'iteration')}"),
    ]


def _designed(case: Case) -> list[Tile]:
    facts = []
    if case.controllability is not None:
        words = [str.__str__(mode.verdict) for mode in case.controllability.modes]
        driven, of = words.count("yes"), len(words)
        others = [f"{words.count(word)} {said}" for word, said in _NOT_DRIVEN if word in words]
        note = ", ".join(others) or "every mode is driven"
        mark = DOUBT if "undecided" in words else GOOD if driven == of else PLAIN
        facts.append(Tile("Controllable modes", f"{driven} of {of}", note, mark))
    if case.lqr is not None:
        slowest = float(np.max(np.real(case.lqr.poles), initial=-np.inf))
        doubt = case.lqr.gain_doubt
        note = f"slowest pole {number(slowest, 3)} 1/s; the data fix the gain to {number(doubt, 1)} of itself"
        mark = BAD if not slowest < 0 else GOOD if doubt < KNOWN else DOUBT
        facts.append(Tile("LQR residual", number(case.lqr.residual, 2), note, mark))
    return facts


def _ran(case: Case) -> list[Tile]:
    facts = []
    run = case.run
    if run is not None and len(run.solve_time):
        middle, worst = float(np.median(run.solve_time)), float(np.max(run.solve_time))
        period = None if case.mpc_check is None else case.mpc_check.dt
        keeps = PLAIN if period is None else GOOD if worst <= period else DOUBT
        note = "median / worst" + ("" if period is None else f" in {seconds(period)}")
        value = f"{number(1e3 * middle, 2)} / {number(1e3 * worst, 2)} ms"
        facts.append(Tile("MPC solve", value, note, keeps))
    story = floor_story(case)
    if story is not None:
        kept = "kept" if story.kept else f"below at {plural(story.times_below, 'time')}"
        note = f"floor {plain(story.floor)} N, {kept}"
        facts.append(Tile("Least tension", f"{number(story.least, 3)} N", note, GOOD if story.kept else DOUBT))
    if case.shape_error is not None and len(case.shape_error):
        note = f"from {number(1e3 * float(case.shape_error[0]), 3)} mm at the start"
        facts.append(Tile("Final shape error", f"{number(1e3 * float(case.shape_error[-1]), 3)} mm", note))
    if case.carried is not None:
        moved, turned = case.carried
        value = f"{number(moved, 3)} m, {number(float(np.degrees(turned)), 3)}°"
        facts.append(Tile("Moved, turned as a whole", value, "no tendon can take that back"))
    if case.demand is not None:
        power, at = case.demand.peak_supply
        force, speed = case.demand.peak_force.value.max(), case.demand.peak_speed.value.max()
        note = f"at {number(at, 3)} s; one at most {number(force, 3)} N, {number(speed, 3)} m/s"
        facts.append(Tile("Power of all actuators", f"{number(power, 3)} W", note))
    if case.sanity is not None:
        found = len(case.sanity.warnings)
        note = "see Sanity" if found else "no contact, no collapse found"
        facts.append(Tile("Physical", plural(found, "warning") if found else "yes", note, DOUBT if found else GOOD))
    best = None if case.accuracy is None else case.accuracy.advised()
    if case.accuracy is not None and best is not None:
        note = f"tol {plain(best.tol)} is the fastest to {plain(case.accuracy.wanted)} m"
        facts.append(Tile("Integrator to use", best.method, note))
    if case.seconds:
        facts.append(Tile("Run time", seconds(sum(case.seconds.values())), plural(len(case.seconds), "stage")))
    return facts


def _within(structure: Structure) -> str:
    return " in the plane" if structure.planar else ""


def _ground(structure: Structure) -> str:
    """What the ground holds, in words."""
    pinned, guided = int(structure.pinned.sum()), int(structure.guides.any(axis=1).sum())
    held = [f"{plural(n, 'node')} {how}" for n, how in ((pinned, "pinned"), (guided, "guided")) if n]
    return " and ".join(held) or ("free in the plane" if structure.planar else "free in space")
