"""The vectors of one control step: where it starts and what it must not pass; all deviations from the reference.

lower <= v <= upper,   change_lower <= v_(k+1) - v_k <= change_upper,   C e_k + D v_k + margin_k >= 0
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.qp import QP
from tensctl.synthesis.step_record import missing


@dataclass(frozen=True, eq=False)
class Ahead:
    """What a reference asks of the coming periods; once it rests, the same at every step.

    Attributes
    ----------
    start : (nx + nu,)
        Its state, a deviation from the model's equilibrium, and its total inputs when a command begins to act.
    bounds : dict of (N, .) arrays
        Those attributes of `Limits` that depend on the reference alone.
    """

    start: Float[np.ndarray, " n"]
    bounds: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Limits:
    """Start and bounds of one step.

    Attributes
    ----------
    start : (nx + nu,)
        (e_0, v_0).
    tension_margin : (N, nT) m
        How far the reference tension is above its floor, or below its stall limit, over the stiffness.
    input_lower, input_upper : (N, nu) m
        From the rest-length floors and the largest change of a rest length.
    change_lower, change_upper : (N, nu) m
        From the rate limit and the reference's own motion.
    about : (N, nu) m
        The reference's inputs, from which v deviates.
    wanted : (N, ny), optional
        What is wanted of the weighted outputs over their sizes, deviations from the reference; None without a signal.
    plan : (N, nu) m, optional
        What the last plan would do next: where a search may begin.
    """

    start: Float[np.ndarray, " n"]
    tension_margin: Float[np.ndarray, "N nT"]
    input_lower: Float[np.ndarray, "N nu"]
    input_upper: Float[np.ndarray, "N nu"]
    change_lower: Float[np.ndarray, "N nu"]
    change_upper: Float[np.ndarray, "N nu"]
    about: Float[np.ndarray, "N nu"]
    wanted: Float[np.ndarray, "N ny"] | None = None
    plan: Float[np.ndarray, "N nu"] | None = None

    def assemble(self, problem: Condensed) -> QP:
        """The condensed QP of this step."""
        now, inputs, floors = self.start[-self.about.shape[1] :], self.about.size, self.tension_margin.size
        lower = np.concatenate([self.input_lower, -self.tension_margin, self.change_lower], axis=None)
        upper = np.concatenate([self.input_upper, np.full(floors, np.inf), self.change_upper], axis=None)
        rates = slice(inputs + floors, inputs + floors + now.size)
        lower[inputs : inputs + floors] -= problem.tension_from_state @ self.start
        lower[rates] += now  # the first period begins where rest lengths are
        upper[rates] += now
        f, given, unlimited = problem.from_state @ self.start, self.start, problem.unlimited
        if problem.following is not None and self.wanted is not None:
            f = f + problem.following.plan @ self.wanted.ravel()
            given = np.concatenate([self.start, self.wanted], axis=None)
        return QP(
            H=problem.H,
            f=f,
            A=problem.rows,
            lower=lower,
            upper=upper,
            start=self.start,
            free=None if unlimited is None else unlimited[:, : given.size] @ given,
            guess=np.tile(now, len(self.about)) if self.plan is None else self.plan.ravel(),
            product=problem.rows_at,
        )

    def shortfall(self, problem: Condensed, plan: Float[np.ndarray, "N nu"]) -> float:
        """Largest tension that the plan leaves missing below a floor, or has above a stall limit, N; 0 with none."""
        predicted = problem.tension_from_state @ self.start + problem.tensions_at(plan.ravel())
        below = -(predicted.reshape(self.tension_margin.shape) + self.tension_margin)
        return missing(below, problem.tension_scale)
