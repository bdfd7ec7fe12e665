"""Harmonic by harmonic or dense: the way that a scene's LQR or LQG takes, and why.

Both give the same controller where the rest, the weights and the sensors repeat from sector to sector. By harmonics
the work grows with the cube of a sector's size instead of the whole structure's, and nothing of full size is formed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tensctl.errors import LinearizationError, SynthesisError
from tensctl.linear import HarmonicModel, LinearModel, harmonics
from tensctl.pipeline.feedback import design_lqg, design_lqr, eyes, harmonic_cost_of
from tensctl.scene import LqgStage, LqrStage, SensorsStage
from tensctl.synthesis import (
    LQG,
    LQR,
    HarmonicLQG,
    HarmonicLQR,
    HarmonicSampledLQR,
    SampledLQR,
    harmonic_lqg,
    harmonic_lqr,
)
from tensctl.synthesis.harmonic_kalman import symmetric_noise
from tensctl.synthesis.weights import Cost

# Degrees of freedom from which on harmonics are tried unasked. A run with LQR takes twice as long there without
# them, and what they save begins to be felt, a quarter of a second; one with LQG 4.5 times. Below, either way will do.
WORTH_IT = {LqrStage: 100, LqgStage: 60}

Regulator = LQR | SampledLQR | HarmonicLQR | HarmonicSampledLQR


@dataclass(frozen=True)
class Way:
    """The way taken.

    Attributes
    ----------
    taken : "harmonics" or "dense"
    why : str
        What was found of the symmetry, or why it was not used.
    """

    taken: Literal["harmonics", "dense"]
    why: str

    def __str__(self) -> str:
        """Way and reason in one line."""
        return f"{'harmonic by harmonic' if self.taken == 'harmonics' else 'dense'}, since {self.why}"


@dataclass(frozen=True, eq=False)
class Symmetric:
    """A symmetric model and the weights of its harmonics."""

    model: HarmonicModel
    costs: tuple[Cost, ...]


def lqr_of(asked: LqrStage, linear: LinearModel) -> tuple[Regulator, Way]:
    """State feedback about the equilibrium of a linear model, and the way to it.

    Raises
    ------
    SynthesisError
        Where the scene insists on harmonics and has none, and as the designs do.
    """
    way, symmetric = way_of_lqr(asked, linear)
    if symmetric is None:
        return design_lqr(asked, linear), way
    return harmonic_lqr(symmetric.model, cost=symmetric.costs, dt=asked.dt), way


def lqg_of(asked: LqgStage, seen: SensorsStage, linear: LinearModel) -> tuple[LQG | HarmonicLQG, Way]:
    """Output feedback likewise."""
    way, symmetric = way_of_lqg(asked, seen, linear)
    if symmetric is None:
        return design_lqg(asked, seen, linear), way
    noise, dt = asked.force_noise, asked.dt
    return harmonic_lqg(symmetric.model, eyes(seen, linear), cost=symmetric.costs, force_noise=noise, dt=dt), way


def way_of_lqr(asked: LqrStage, linear: LinearModel) -> tuple[Way, Symmetric | None]:
    """The way of the LQR, with the harmonics where it is theirs.

    Raises
    ------
    SynthesisError
        Where the scene insists on harmonics and has none.
    """
    way = unasked(asked, linear)
    if way is not None:
        return way, None
    try:
        return _symmetric(asked, linear)
    except (LinearizationError, SynthesisError) as fault:
        return _broken(asked, "lqr", fault), None


def way_of_lqg(asked: LqgStage, seen: SensorsStage, linear: LinearModel) -> tuple[Way, Symmetric | None]:
    """The way of the LQG likewise; sensors and noise have to repeat too."""
    way = unasked(asked, linear)
    if way is None and asked.order is not None:
        way = Way("dense", "order asks for fewer states, and harmonics keep all")
    if way is not None:
        return way, None
    try:
        way, found = _symmetric(asked, linear)
        symmetric_noise(found.model, eyes(seen, linear), asked.force_noise)
    except (LinearizationError, SynthesisError) as fault:
        return _broken(asked, "lqg", fault), None
    return way, found


def unasked(asked: LqrStage | LqgStage, linear: LinearModel) -> Way | None:
    """Why harmonics are not even looked for; None where they are."""
    freedoms, least = linear.equilibrium.potential.manifold.size, WORTH_IT[type(asked)]
    if asked.way == "dense":
        return Way("dense", "the scene asks for it")
    if asked.way == "auto" and freedoms < least:
        return Way("dense", f"harmonics are taken from {least} degrees of freedom on, here are {freedoms}")
    if asked.way == "auto" and asked.stabilisable_only:
        return Way("dense", "stabilisable_only leaves modes out, and harmonics do not")
    return None


def _symmetric(asked: LqrStage | LqgStage, linear: LinearModel) -> tuple[Way, Symmetric]:
    model = harmonics(linear.dynamics, linear.equilibrium)
    way = Way("harmonics", f"{model.order} sectors are equal to {model.mismatch:.0e}")
    return way, Symmetric(model, harmonic_cost_of(asked, model))


def _broken(asked: LqrStage | LqgStage, section: str, error: Exception) -> Way:
    """What breaks the symmetry, as the reason of the dense way; an error where the scene insists."""
    fault = str(error).partition(";")[0].rstrip(".")  # what follows says what to try in Python
    if asked.way == "harmonics":
        raise SynthesisError(f'{section}.way is "harmonics", but {fault}; take "auto" or "dense".') from None
    return Way("dense", fault)
