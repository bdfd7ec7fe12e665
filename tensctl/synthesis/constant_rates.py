"""Where a search may begin when the last plan is far from the optimum: every input changes at a constant rate.

    w = now + E v,   v the changes of inputs in each part of the horizon, E spreads them evenly over the part's stages
    minimise    v'(E'G E)v/2 + (g + G now)'E v + L price sum eps + L c |eps|^2/2,   L the stages of a part
    subject to  limits of rates and inputs,   M E v + eps >= floor - M now,   one eps a part

It is the problem of `synthesis.primal` with parts for stages, so the same search solves it, in 1 ms with 24 inputs.
The horizon is one part first, then two halves. Where a part ends within a stage, the stage's rows belong to both.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.synthesis import primal
from tensctl.synthesis.bordered import Form

# Parts of the horizon, and the share of the whole search's work that each may take. Four parts took four times as long
# and held floors no better (`docs/decisions.md`).
PARTS = ((1, 0.25), (2, 0.5))
# Wrong multipliers over the largest slope: a beginning needs no more.
TOL = 1e-9


class ConstantRates:
    """A problem in rates with fewer of them.

    Parameters
    ----------
    form : Form
        Of all stages.
    parts : int
        Of the horizon, at most its stages.

    Attributes
    ----------
    form : Form
        Of the parts.
    """

    def __init__(self, form: Form, parts: int) -> None:
        self._whole, self._stages = form, form.stages
        self._starts = np.array([-(-k * form.stages // parts) for k in range(parts)])
        self._long = np.diff(self._starts, append=form.stages)
        halfway = self._spread(form.G)
        G, by_rate = self._spread(np.ascontiguousarray(halfway.T)), self._spread(form.by_rate)
        self.form = Form(
            0.5 * (G + G.T), np.ascontiguousarray(by_rate.T), by_rate, form.curvature * form.stages / parts, parts
        )  # fmt: skip

    def plan(
        self, step: primal.Step, now: Float[np.ndarray, " nu"], near: Float[np.ndarray, " n"], work: float
    ) -> Float[np.ndarray, " n"]:
        """Inputs of all stages.

        Parameters
        ----------
        step : Step
            What changes in the problem of all stages.
        now : (nu,)
            Inputs before the first stage.
        near : (n,)
            Inputs of all stages, at whose values at the ends of parts the search begins.
        work : float
            Multiplications after which it ends where it is.
        """
        nu, whole = now.size, self._whole
        began = np.zeros(step.g.size)
        began[:nu] = now
        lower, upper = self._inmost(step.lower - began, step.upper - began)
        low, high = self._inmost(step.low - np.tile(now, self._stages), step.high - np.tile(now, self._stages))
        asked = primal.Step(
            g=self._spread((step.g + now @ whole.G[:nu])[:, None])[:, 0],
            price=step.price * self._stages / self._long.size,
            lower=np.repeat(self._long, nu) * lower,
            upper=np.repeat(self._long, nu) * upper,
            floor=step.floor - now @ whole.by_rate[:nu],
            low=low,
            high=high,
        )
        ends = near.reshape(self._stages, nu)[self._starts + self._long - 1]
        room = 2 * self._long.size * (nu + 1)
        x = primal.search(self.form, asked, (ends - now).ravel(), room, TOL, work)[1]
        rates = x[: lower.size].reshape(-1, nu) / self._long[:, None]
        return (now + np.repeat(rates, self._long, axis=0).cumsum(axis=0)).ravel()

    def _spread(self, slopes: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "m k"]:
        """E' times slopes by the rates of all stages."""
        staged = slopes.reshape(self._stages, -1, slopes.shape[1])
        mean = np.add.reduceat(staged, self._starts, axis=0) / self._long[:, None, None]
        return np.ascontiguousarray(mean.reshape(-1, slopes.shape[1]))

    def _inmost(self, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The narrowest limits of each part."""
        staged = lower.reshape(self._stages, -1), upper.reshape(self._stages, -1)
        most = np.maximum.reduceat(staged[0], self._starts, axis=0)
        return most.ravel(), np.minimum.reduceat(staged[1], self._starts, axis=0).ravel()
