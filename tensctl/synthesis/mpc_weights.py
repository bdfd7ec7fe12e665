"""Weights of a predictive controller, and what they mean for a linear model.

    stage cost   |e|^2 energy + sum |dy/size|^2 + v'R v,   R = input k  or  1/size^2 of each rest length

all integrated over time. |e|^2 is twice the energy of vibration, k v^2 twice the energy that a rest length stores; an
output or a rest length counts 1 at its size. Outputs are linear in (e, v), so their weight needs no cross term.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.linear.outputs import Output
from tensctl.scene.complaint import shown
from tensctl.scene.given import argument
from tensctl.scene.tables import Table, per_member
from tensctl.scene.values import Number
from tensctl.structure.labels import by_label
from tensctl.synthesis.shown import shown as showing
from tensctl.synthesis.weights import Size


@dataclass(frozen=True, eq=False)
class Weights:
    """Stage weights of predictive control.

    Attributes
    ----------
    energy : float
        Of twice the energy of vibration, J.
    input : float
        Of sum k u^2, J; not used with `rest_lengths`.
    outputs : table by output
        Size at which a deviation counts 1, in the output's unit: `{"nodes:P4_1_1": 1e-3, "tensions": 0.5}`, or a `Mix`.
    rest_lengths : number or table by label pattern, optional
        Size at which the change of a rest length counts 1, m.
    """

    energy: float = 1.0
    input: float = 1.0
    outputs: Mapping[Output, float] = field(default_factory=dict)
    rest_lengths: Size | None = None

    def __post_init__(self) -> None:
        for name, weight in (("energy", self.energy), ("input", self.input)):
            argument(f"weights.{name}", weight, Number(least=0))
        if self.input == 0 and self.rest_lengths is None:
            raise SynthesisError(
                "the weight of input is 0, and one direction of rest lengths changes the prestress only; a number > 0 "
                "is expected, or rest_lengths."
            )
        if not isinstance(self.outputs, Mapping):
            raise SynthesisError(
                f'outputs is {shown(self.outputs)}; a table of sizes is expected, as {{"nodes:P4_1_1": 1e-3}}.'
            )
        sizes = {str(output): size for output, size in self.outputs.items()}
        argument("weights.outputs", sizes, Table(Number("in the output's unit", above=0)))
        if self.rest_lengths is not None:
            argument("weights.rest_lengths", self.rest_lengths, per_member(Number("m", above=0)))

    def of_inputs(self, linear: LinearModel) -> Float[np.ndarray, "nu nu"]:
        """R of a linear model, per second.

        Raises
        ------
        SynthesisError
            When `rest_lengths` leaves an input without a cost.
        """
        if self.rest_lengths is None:
            return self.input * np.diag(input_stiffness(linear))
        labels = linear.dynamics.input_labels
        sizes = by_label(labels, self.rest_lengths, "rest_lengths", np.inf)
        free = np.flatnonzero(~np.isfinite(sizes))
        if free.size:
            raise SynthesisError(
                f'rest_lengths names no size for {labels[free[0]]}, which then costs nothing; add it, or a first "*".'
            )
        return np.diag(1 / sizes**2)

    def of_outputs(self, linear: LinearModel) -> Weighed:
        """The weighted outputs of a linear model."""
        models = [showing(linear, output) for output in self.outputs]
        sizes = [np.full(len(m.outputs), size) for m, size in zip(models, self.outputs.values(), strict=True)]
        model, size = showing(linear, *self.outputs), np.concatenate([np.zeros(0), *sizes])
        return Weighed(model, size, np.hstack([model.C, model.D]) / size[:, None])


@dataclass(frozen=True, eq=False)
class Weighed:
    """Weighted outputs.

    Attributes
    ----------
    linear : LinearModel
        Shows these outputs and no others.
    sizes : (ny,)
    rows : (ny, nx + nu)
        Outputs over their sizes from (e, v).
    """

    linear: LinearModel
    sizes: Float[np.ndarray, " ny"]
    rows: Float[np.ndarray, "ny n"]
