"""Rest lengths that follow commands: ramps, a rate limit, a floor, and first-order lag.

    c ramps to each command within its period, |dc/dt| <= rate_max, c >= floor;   dL/dt = (c - L)/tau, or L = c

Between edges c is a straight line, so L is one plus an exponential, exactly. Times of edges carry rounding, 1e-13 s
after some minutes, and a ramp that ends so much later would pass the floor by that times its rate: lengths stop at it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.structure import Members


class Actuators:
    """Rest lengths of all tendons and what is asked of them.

    Attributes
    ----------
    rest : (nt,) m
        Rest lengths now.
    asked : (nt,) m
        Commanded rest lengths now.
    rate : (nt,) m/s
        How the command ramps until the next one.
    rate_max : float, m/s
    """

    def __init__(self, members: Members, rest: Float[np.ndarray, " tendons"], rate_max: float) -> None:
        self._members, self.rate_max, self._tau = members, rate_max, members.lag
        self.rest, self.asked, self.rate = rest.copy(), rest.copy(), np.zeros_like(rest)

    @property
    def inputs(self) -> Float[np.ndarray, " inputs"]:
        """Rest-length changes u as they are now, m."""
        return self._members.inputs_of(self.rest)

    @property
    def asked_inputs(self) -> Float[np.ndarray, " inputs"]:
        """Rest-length changes u as commanded now, m."""
        return self._members.inputs_of(self.asked)

    def command(self, u: Float[np.ndarray, " inputs"], period: float) -> None:
        """From now on ramp to the total change u, to be reached after a period; tendons of a gang keep their ratios."""
        members, gearing = self._members, self._members.gearing
        reach = self.rate_max * period / gearing.largest
        lower, upper = members.input_bounds
        change = np.minimum(np.maximum(u, lower), upper) - self.asked_inputs
        change = np.minimum(np.maximum(change, -reach), reach)
        self.rate = np.zeros_like(self.rest)
        self.rate[members.inputs] = -gearing.spread(change) / period

    def lag(self) -> Float[np.ndarray, " tendons"]:
        """Amplitude of the exponential by which rest lengths approach their ramp, m."""
        return self.asked - self.rest - self._tau * self.rate if self._tau > 0 else np.zeros_like(self.rest)

    def after(self, seconds: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t tendons"]:
        """Rest lengths some time from now."""
        rest = self.rest + seconds[:, None] * self.rate
        if self._tau > 0:
            rest -= np.expm1(-seconds / self._tau)[:, None] * self.lag()
        return self._kept(self.rest, rest)

    def asked_after(self, seconds: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t tendons"]:
        """Commanded rest lengths some time from now."""
        return self._kept(self.asked, self.asked + seconds[:, None] * self.rate)

    def advance(self, seconds: Float[np.ndarray, " t"]) -> Float[np.ndarray, "t tendons"]:
        """Let time pass to the last of these; rest lengths at each of them."""
        passed = self.after(seconds)
        self.rest, self.asked = passed[-1], self.asked_after(seconds[-1:])[0]
        return passed

    def _kept(self, before: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Lengths that keep their floors to the last bit; those that began below go no lower."""
        return np.maximum(lengths, np.minimum(before, self._members.floors))
