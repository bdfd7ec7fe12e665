"""Harmonic by harmonic or dense: the way that a scene's LQR takes, and why.

Both give the same controller where the rest and the weights repeat from sector to sector. By harmonics the work grows
with the cube of a sector's size instead of the whole structure's, and nothing of full size is formed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tensctl.errors import LinearizationError, SynthesisError
from tensctl.linear import HarmonicModel, LinearModel, harmonics
from tensctl.pipeline.feedback import design_lqr, harmonic_cost_of
from tensctl.scene import LqrStage
from tensctl.synthesis import LQR, HarmonicLQR, HarmonicSampledLQR, SampledLQR, harmonic_lqr
from tensctl.synthesis.weights import Cost

# Degrees of freedom from which on harmonics are tried unasked: there a run without them takes 1.6 times as long, and
# what they save begins to be felt, a tenth of a second. Below, either way will do.
WORTH_IT = 100

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
    way, symmetric = way_of(asked, linear)
    if symmetric is None:
        return design_lqr(asked, linear), way
    return harmonic_lqr(symmetric.model, cost=symmetric.costs, dt=asked.dt), way


def way_of(asked: LqrStage, linear: LinearModel) -> tuple[Way, Symmetric | None]:
    """The way, with the harmonics where it is theirs.

    Raises
    ------
    SynthesisError
        Where the scene insists on harmonics and has none.
    """
    if asked.way == "dense":
        return Way("dense", "the scene asks for it"), None
    freedoms = linear.equilibrium.potential.manifold.size
    if asked.way == "auto" and freedoms < WORTH_IT:
        return Way("dense", f"harmonics are taken from {WORTH_IT} degrees of freedom on, here are {freedoms}"), None
    if asked.way == "auto" and asked.stabilisable_only:
        return Way("dense", "stabilisable_only leaves modes out, and harmonics do not"), None
    try:
        model = harmonics(linear.dynamics, linear.equilibrium)
        costs = harmonic_cost_of(asked, model)
    except (LinearizationError, SynthesisError) as error:
        fault = str(error).partition(";")[0].rstrip(".")  # what follows says what to try in Python
        if asked.way == "harmonics":
            raise SynthesisError(f'lqr.way is "harmonics", but {fault}; take "auto" or "dense".') from None
        return Way("dense", fault), None
    return Way("harmonics", f"{model.order} sectors are equal to {model.mismatch:.0e}"), Symmetric(model, costs)
