"""Why a mode is not driven, or not seen: one sentence each."""

from __future__ import annotations

import numpy as np

from tensctl.analysis.verdict import Verdict
from tensctl.linear import LinearModel, Mode

_STILL = 1e-9


def why_not_driven(linear: LinearModel, mode: Mode, position: int, verdict: Verdict, driven: int) -> str:
    """Name what keeps the tendons from driving a mode.

    Parameters
    ----------
    position : int
        Row of the mode in the model.
    driven : int
        How many directions of its group of equal frequencies are driven.
    """
    if mode.kind == "rigid-body":
        return f"rigid-body {mode.name}: tendons pull on both of their ends, which adds up to no force and no moment"
    if verdict == "undecided":
        return "the drive is too near to rounding to be told from none in double precision"
    stretch, taut = np.abs(linear.stretch), linear.equilibrium.tensions > 0
    largest = stretch[taut].max(initial=0.0)
    moved = taut & (stretch[:, position] > _STILL * largest)
    if not moved.any():
        return "not stretched at first order: the mode changes the length of no taut tendon"
    acting = np.zeros(len(taut), bool)
    acting[linear.dynamics.members.inputs] = True
    if not (moved & acting).any():
        labels = [linear.dynamics.structure.tendon_labels[t] for t in np.flatnonzero(moved)[:3]]
        return f"unactuated: it stretches only tendons without actuator ({', '.join(labels)} ...)"
    if driven:
        return f"symmetry: the inputs reach {driven} of the {mode.multiplicity} directions of this repeated frequency"
    return "the pulls of the actuated tendons on this mode cancel"


def why_not_seen(linear: LinearModel, mode: Mode, position: int, verdict: Verdict, driven: int) -> str:
    """Name what hides a mode from the outputs."""
    if verdict == "undecided":
        return "the trace in the outputs is too near to rounding to be told from none in double precision"
    if mode.kind == "rigid-body":
        return f"rigid-body {mode.name}: lengths and tensions do not change"
    if driven:
        return f"symmetry: the outputs show {driven} of the {mode.multiplicity} directions of this repeated frequency"
    return "no output changes with this mode at first order"
