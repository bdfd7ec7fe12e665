"""What outputs should do over time: a function, or values at times with straight lines between, held at the ends."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.scene.complaint import shown
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.reference import Hold, outputs_along

# Farthest from rest that an output may be wanted, in sizes at which it counts 1: a kilometre where a millimetre does.
# On the (3,1) mast, N = 20, steps take 70 ms at most up to 1e7 sizes; at 1e9 one took 5 s, at 1e18 all took 15 to 30 s
# and gave no answer: limits are rounded away beside the pull.
_FARTHEST = 1e6


@dataclass(frozen=True, eq=False)
class Courses:
    """Courses of some outputs about what they are on the path; the other weighted outputs stay there.

    Attributes
    ----------
    table : by output label of (times, values)
        s, and deviations in the output's own unit; straight lines between times, held at the ends.
    """

    table: Mapping[str, tuple[Sequence[float], Sequence[float]]]

    def __post_init__(self) -> None:
        given = self.table.values() if isinstance(self.table, Mapping) else [None]
        if not all(isinstance(course, tuple | list) and len(course) == 2 for course in given):
            raise SynthesisError(
                'courses are a table of (times, values) by output, as {"P4_1_1_x": ([0.0, 1.0], [0.0, 0.01])}; '
                f"{shown(self.table)} was given."
            )


Wanted = Callable[[float], Any] | tuple[Any, Any] | Courses


@dataclass(frozen=True, eq=False)
class Signal:
    """A signal for given outputs.

    Attributes
    ----------
    labels : tuple of str
    given : function of time, (times, values), or Courses
        Values in the outputs' own units, in total but for courses, (ny,) or (times, ny).
    sizes : (ny,)
        At which deviations count 1.
    rest : (ny,)
        What the outputs are at rest.
    """

    labels: Sequence[str]
    given: Wanted
    sizes: Float[np.ndarray, " ny"]
    rest: Float[np.ndarray, " ny"]

    @property
    def knots(self) -> Float[np.ndarray, " k"] | None:
        """Times between which it goes in straight lines, s; None for a function."""
        if isinstance(self.given, Courses):
            return np.unique(np.concatenate([np.asarray(course[0], float) for course in self.given.table.values()]))
        return np.asarray(self.given[0], float) if isinstance(self.given, tuple) else None

    @property
    def about_path(self) -> bool:
        """Whether values are deviations from the path."""
        return isinstance(self.given, Courses)

    def at(self, times: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k ny"]:
        """Values at times.

        Raises
        ------
        SynthesisError
            Values of another shape, not finite, or farther from rest than can be weighed.
        """
        values = self._values(times)
        far = np.abs(values if self.about_path else values - self.rest) / self.sizes
        if far.max(initial=0.0) > _FARTHEST:
            k, i = map(int, np.unravel_index(far.argmax(), far.shape))
            raise SynthesisError(
                f"the signal wants {values[k, i]:.3g} of {self.labels[i]} at {times[k]:g} s, {far[k, i]:.3g} times the "
                f"size at which weights count 1 away from rest; at most {_FARTHEST:.0e} times are expected, so give "
                "values in the output's own unit (m, m/s, N), or a larger size."
            )
        return values

    def _values(self, times: np.ndarray) -> np.ndarray:
        if isinstance(self.given, tuple):
            return self._between(times, self.given, self.labels)
        if isinstance(self.given, Courses):
            return self._courses(times, self.given)
        return np.stack([self._checked(f"signal({t:g})", self.given(float(t)), (len(self.labels),)) for t in times])

    def _courses(self, times: np.ndarray, given: Courses) -> np.ndarray:
        values = np.zeros((len(times), len(self.labels)))
        for label, course in given.table.items():
            if label not in self.labels:
                raise SynthesisError(f"{label} has a course, but no weight; weighted are {', '.join(self.labels)}.")
            values[:, self.labels.index(label)] = self._between(times, course, (label,))[:, 0]
        return values

    def _between(self, times: np.ndarray, given: tuple[Any, Any], labels: Sequence[str]) -> np.ndarray:
        knots = _numbers("the times of a signal", given[0])
        if knots.ndim != 1 or not knots.size or not np.isfinite(knots).all() or (np.diff(knots) <= 0).any():
            raise SynthesisError("the times of a signal do not ascend; expected finite times, each after the last, s.")
        values = self._checked("the signal's table", given[1], (knots.size, len(labels)))
        return np.stack([np.interp(times, knots, column) for column in values.T], axis=1)

    def _checked(self, name: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
        values = _numbers(name, given)
        values = values[..., None] if values.shape == shape[:-1] and shape[-1] == 1 else values
        if values.shape != shape or not np.isfinite(values).all():
            odd = " and not all finite" if values.shape == shape else ""
            raise SynthesisError(
                f"{name} is of shape {values.shape}{odd}; finite {shape} is expected, one value an output: "
                f"{', '.join(self.labels)}."
            )
        return values


def _numbers(name: str, given: Any) -> np.ndarray:
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError, OverflowError):
        raise SynthesisError(f"{name} is {shown(given)}; finite numbers are expected.") from None


def _takes_time(given: Callable[..., Any]) -> bool:
    try:
        signature(given).bind(0.0)
    except TypeError:
        return False
    except ValueError:  # a compiled function does not tell
        return True
    return True


def signal_for(weights: Weights, linear: LinearModel, given: Wanted | None) -> Signal | None:
    """The signal for the weighted outputs, checked at t = 0 and at all times of a table.

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
    if not (callable(given) or isinstance(given, Courses) or (isinstance(given, tuple) and len(given) == 2)):
        raise SynthesisError(
            f"signal is of type {type(given).__name__}; a function of time, two arrays (times, values), or tc.Courses "
            "is expected."
        )
    if callable(given) and not _takes_time(given):
        raise SynthesisError("signal takes no time; a function of one number, s, is expected.")
    weighed = weights.of_outputs(linear)
    rest = outputs_along(Hold(linear.equilibrium), weighed.linear, np.zeros(1))[0]
    signal = Signal(weighed.linear.outputs, given, weighed.sizes, rest)
    signal.at(np.zeros(1))
    if (knots := signal.knots) is not None:
        signal.at(knots)
    return signal
