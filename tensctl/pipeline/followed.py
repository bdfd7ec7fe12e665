"""How well outputs followed their courses in a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.pipeline.results import Results, frames_of
from tensctl.synthesis import MPC, OutputMPC
from tensctl.synthesis.reference import outputs_along
from tensctl.synthesis.signal import Courses


@dataclass(frozen=True)
class Followed:
    """One output, in its own unit.

    Attributes
    ----------
    label : str
    reach : float
        Largest change that was asked of it.
    worst, rms : float
        Distance from where it should be over the recorded times.
    """

    label: str
    reach: float
    worst: float
    rms: float


def followed(results: Results) -> tuple[Followed, ...]:
    """Every output that the scene gives a course; none without a run under predictive control."""
    mpc, run = results.mpc, results.run
    if not isinstance(mpc, MPC) or run is None or mpc.signal is None or not isinstance(mpc.signal.given, Courses):
        return ()
    linear = mpc.weights.of_outputs(mpc.linear).linear
    reference = mpc.wanted if isinstance(mpc, OutputMPC) else mpc.reference
    frames, nodes = frames_of(results.wanted, run), run.nodes
    if frames is not None:
        nodes = np.stack([frame.nodes(p) for frame, p in zip(frames, nodes, strict=True)])
    raw = [nodes.reshape(len(nodes), -1), run.velocities.reshape(len(nodes), -1), run.lengths, run.tensions]
    shown = (linear.outputs_map.weights @ np.hstack(raw).T).T
    asked = mpc.signal.at(run.time)
    miss = shown - outputs_along(reference, linear, run.time) - asked
    found = []
    for label in mpc.signal.given.table:
        k = linear.outputs.index(label)
        reach, missed = float(np.abs(asked[:, k]).max()), miss[:, k]
        found.append(Followed(label, reach, float(np.abs(missed).max()), float(np.sqrt(np.mean(missed**2)))))
    return tuple(found)
