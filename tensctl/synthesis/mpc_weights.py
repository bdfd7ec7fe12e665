"""Weights of a predictive controller, and what they mean for a linear model.

    stage cost   |e|^2 energy + sum |dy/size|^2 + v'R v,   R = input k  or  1/size^2 of each rest length

all integrated over time. |e|^2 is twice the energy of vibration, k v^2 twice the energy that a rest length stores; an
output or a rest length counts 1 at its size. Outputs are linear in (e, v), so their weight needs no cross term.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real

import numpy as np
from jaxtyping import Float

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.linear.outputs import Output
from tensctl.structure.labels import by_label
from tensctl.synthesis.shown import shown
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
            if not (isinstance(weight, Real) and 0 <= weight < np.inf):
                raise SynthesisError(f"the weight of {name} is {weight!r}; a finite number >= 0 is expected.")
        if self.input == 0 and self.rest_lengths is None:
            raise SynthesisError(
                "the weight of input is 0, and one direction of rest lengths changes the prestress only; a number > 0 "
                "is expected, or rest_lengths."
            )
        if not isinstance(self.outputs, Mapping):
            raise SynthesisError(
                f'outputs is {self.outputs!r}; a table of sizes by output is expected, as {{"nodes:P4_1_1": 1e-3}}.'
            )
        sizes = {f"the output {name}": size for name, size in self.outputs.items()}
        if self.rest_lengths is not None:
            table = self.rest_lengths if isinstance(self.rest_lengths, Mapping) else {"*": self.rest_lengths}
            sizes |= {f"rest_lengths {pattern}": size for pattern, size in table.items()}
        for name, size in sizes.items():
            if not (isinstance(size, Real) and 0 < size < np.inf):
                raise SynthesisError(f"{name} has the size {size!r}; a finite number > 0 is expected.")

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
        models = [shown(linear, output) for output in self.outputs]
        sizes = [np.full(len(m.outputs), size) for m, size in zip(models, self.outputs.values(), strict=True)]
        model, size = shown(linear, *self.outputs), np.concatenate([np.zeros(0), *sizes])
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
