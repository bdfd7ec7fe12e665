"""What outputs should do over time: a function, or values at times with straight lines between, held at the ends."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.synthesis.mpc_weights import Weights

Wanted = Callable[[float], Any] | tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Signal:
    """A signal for given outputs.

    Attributes
    ----------
    labels : tuple of str
    given : function of time, or (times, values)
        Values in the outputs' own units, in total, (ny,) or (times, ny).
    """

    labels: Sequence[str]
    given: Wanted

    def at(self, times: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k ny"]:
        """Values at times.

        Raises
        ------
        SynthesisError
            Values of another shape or not finite.
        """
        if isinstance(self.given, tuple):
            return self._between(times)
        return np.stack([self._checked(f"signal({t:g})", self.given(float(t)), (len(self.labels),)) for t in times])

    def _between(self, times: np.ndarray) -> np.ndarray:
        assert isinstance(self.given, tuple)
        knots = np.asarray(self.given[0], float)
        if knots.ndim != 1 or not knots.size or not np.isfinite(knots).all() or (np.diff(knots) <= 0).any():
            raise SynthesisError("the times of a signal do not ascend; expected finite times, each after the last, s.")
        values = self._checked("the signal's table", self.given[1], (knots.size, len(self.labels)))
        return np.stack([np.interp(times, knots, column) for column in values.T], axis=1)

    def _checked(self, name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
        values = np.asarray(given, float)
        values = values[..., None] if values.shape == shape[:-1] and shape[-1] == 1 else values
        if values.shape != shape or not np.isfinite(values).all():
            odd = " and not all finite" if values.shape == shape else ""
            raise SynthesisError(
                f"{name} is of shape {values.shape}{odd}; finite {shape} is expected, one value an output: "
                f"{', '.join(self.labels)}."
            )
        return values


def signal_for(weights: Weights, linear: LinearModel, given: Wanted | None) -> Signal | None:
    """The signal for the weighted outputs, checked at t = 0.

    Raises
    ------
    SynthesisError
        When it does not fit them.
    """
    if given is None:
        return None
    if not weights.outputs:
        raise SynthesisError(
            'a signal is given, but no output; weights=tc.Weights(outputs={"nodes:P4_1_1": 1e-3}) names some.'
        )
    signal = Signal(weights.of_outputs(linear).linear.outputs, given)
    signal.at(np.zeros(1))
    return signal
