"""State feedback that remembers its last command, which goes on where a sample tells nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.feedback import Measured
from tensctl.synthesis.seen import numbers, refuse_misshapen, sampled_at


class Holding:
    """A controller whose answer depends on nothing but the sample, as long as that tells anything."""

    linear: Any
    # Whether inputs are fed back as the command that they answer.
    sees_inputs = False

    def step(self, t: float, measurement: Measured | None) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0, m, kept above the rest-length floors.

        A measurement that is None, or has an entry that is no number, tells nothing: the last command goes on, and
        before the first one that of the reference.

        Raises
        ------
        SynthesisError
            A time that is no finite number, or a measurement whose arrays have another shape than this structure's.
        """
        t = sampled_at(t)
        u = self._answer(t, measurement) if measurement is not None and self._tells(t, measurement) else self._last(t)
        vars(self)["_command"] = u
        return u

    def reset(self) -> None:
        """Forget the last command."""
        self.restore({})

    def state(self) -> dict[str, np.ndarray]:
        """The last command, (nu,) m; nothing before the first."""
        last = vars(self).get("_command")
        return {} if last is None else {"command": last}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from this command."""
        vars(self)["_command"] = state.get("command")

    def _model(self, t: float) -> Any:
        """The linear model that answers at a time."""
        return self.linear

    def _first(self, t: float) -> Float[np.ndarray, " nu"]:
        """The command where there was none."""
        return self.linear.equilibrium.inputs

    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        raise NotImplementedError

    def _last(self, t: float) -> Float[np.ndarray, " nu"]:
        last = vars(self).get("_command")
        return self._first(t) if last is None else last

    def _tells(self, t: float, measurement: Measured) -> bool:
        linear = self._model(t)
        refuse_misshapen(linear.dynamics.structure, linear.equilibrium.inputs.size, measurement)
        parts = [measurement.nodes, measurement.velocities]
        parts += [measurement.inputs] * bool(self.sees_inputs or linear.lag)
        parts += [getattr(measurement, "commands", None)] * bool(self.sees_inputs and linear.lag)
        return all(numbers(part).all() for part in parts if part is not None)
