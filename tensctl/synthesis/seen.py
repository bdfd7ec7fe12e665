"""What a sample tells a predictive controller: a state, or nothing.

Rods keep their lengths, so nodes between which a rod has grown or shrunk by half are no measurement of this structure;
neither are numbers that are missing (NaN), infinite or beyond all measure, nor a sample that never came (None).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from tensctl.errors import SynthesisError
from tensctl.scene.given import argument
from tensctl.scene.values import Number
from tensctl.structure import Structure
from tensctl.synthesis.feedback import Measured

# Part of its length by which a rod may seem changed: far beyond the noise of any sensor that could control a shape.
FITS = 0.5
# What is larger is no number, as in exported source: squares and products of it would soon be none.
LARGEST = 1e40
_TIME = Number("s, the time of the sample")


@dataclass(frozen=True, eq=False)
class Seen:
    """A sample with a state.

    Attributes
    ----------
    nodes, velocities : (N, 3) m, m/s
    inputs : (nu,) m
        Rest-length changes as they are.
    tensions : (nt,) N, or None
        As measured; a sample need not tell them.
    commands : (nu,) m, or None
        Rest-length changes as commanded, where actuators lag.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    velocities: Float[np.ndarray, "nodes 3"]
    inputs: Float[np.ndarray, " nu"]
    tensions: Float[np.ndarray, " nt"] | None = None
    commands: Float[np.ndarray, " nu"] | None = None


def sampled_at(t: object) -> float:
    """The time of a sample, s.

    Raises
    ------
    SynthesisError
        What is no finite number.
    """
    return argument("t", t, _TIME)


def numbers(values: object) -> Bool[np.ndarray, "..."]:
    """Where values are numbers, and no larger than any that could have been measured."""
    return np.abs(np.asarray(values, float)) <= LARGEST


def refuse_misshapen(structure: Structure, inputs: int, measurement: object) -> None:
    """Refuse a sample whose arrays have another shape than this structure's; tensions and commands need not be there.

    Raises
    ------
    SynthesisError
        With the first array that does not fit, and what is expected.
    """
    nodes, tendons = structure.nodes.shape, (len(structure.tendons),)
    shapes = {"nodes": nodes, "velocities": nodes, "inputs": (inputs,), "tensions": tendons, "commands": (inputs,)}
    for name, shape in shapes.items():
        given = getattr(measurement, name, None)
        if not (name in ("tensions", "commands") if given is None else np.shape(given) == shape):
            has = f"no {name}" if given is None else f"{name} of shape {np.shape(given)}"
            raise SynthesisError(
                f"the measurement has {has}; {shape} is expected, with NaN for what was not measured, or None instead "
                "of a measurement that never came."
            )


def seen(
    structure: Structure, measurement: Measured | None, inputs: Float[np.ndarray, " nu"],
    commands: Float[np.ndarray, " nu"] | None = None,
) -> Seen | None:  # fmt: skip
    """The sample, with inputs that are known in any case; None where it tells no state of the structure."""
    if measurement is None:
        return None
    nodes, velocities = np.asarray(measurement.nodes), np.asarray(measurement.velocities)
    ends, moving = nodes[structure.rods], velocities[structure.rods]
    stretch = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / structure.rod_lengths - 1.0
    fits = np.abs(stretch).max() <= FITS  # never of numbers that are missing
    if not (fits and numbers(moving).all()):
        return None
    tensions = getattr(measurement, "tensions", None)
    return Seen(nodes, velocities, inputs, None if tensions is None else np.asarray(tensions), commands)


def known_inputs(measured: np.ndarray | None, believed: Float[np.ndarray, " nu"]) -> Float[np.ndarray, " nu"]:
    """Inputs as measured, and as believed where nothing was measured, m."""
    return believed if measured is None else np.where(numbers(measured), measured, believed)
