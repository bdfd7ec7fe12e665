"""The condensed QP with its states back in: sparse, banded by stages, so that a solve costs the same for any limits.

    variables of stage k   (v_k, e_k, slack_k),   e_k = A e_(k-1) + G v_(k-1) + B v_k
    minimise  sum of the stages' own quadratic forms,   rows  C e_k + D v_k + slack_k >= floor,   v_k - v_(k-1) bounded

Limits are those of the condensed problem, one by one, so its multipliers are theirs and answers are judged by its data.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.synthesis.condensed import Condensed
from tensctl.synthesis.qp import QP


@dataclass(frozen=True, eq=False)
class Vectors:
    """What changes from step to step: cost, states' equations, bounds of variables and of rows."""

    cost: np.ndarray
    motion: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    row_lower: np.ndarray
    row_upper: np.ndarray


@dataclass(frozen=True, eq=False)
class Stages:
    """A predictive controller's problem by stages.

    Attributes
    ----------
    problem : Condensed
    curvature : float or None
        Curvature on the slack of each stage's tension rows; None where floors are hard and have no slack.
    """

    problem: Condensed
    curvature: float | None = None

    @property
    def slacks(self) -> int:
        """Slacks of a stage."""
        return 0 if self.curvature is None else 1

    @cached_property
    def sizes(self) -> tuple[int, int, int, int]:
        """Stages, inputs, states and tension rows of a stage."""
        n, nu = self.problem.B.shape
        return self.problem.horizon, nu, n - nu, len(self.problem.tension)

    @cached_property
    def cost(self) -> sp.csc_matrix:
        """Quadratic cost, both triangles."""
        stages, nu, _, _ = self.sizes
        problem = self.problem
        blocks = []
        for k in range(stages):
            weight = problem.P if k == stages - 1 else problem.Q
            turned = np.roll(np.roll(weight, nu, axis=0), nu, axis=1)  # inputs first
            turned[:nu, :nu] += problem.R
            blocks.append(turned)
            if self.curvature is not None:
                blocks.append(np.array([[self.curvature]]))
        return sp.csc_matrix(sp.block_diag(blocks))

    @cached_property
    def motion(self) -> sp.csc_matrix:
        """States' equations: e_k - A e_(k-1) - G v_(k-1) - B v_k."""
        stages, _, nx, _ = self.sizes
        A, B, none = self.problem.A[:nx], self.problem.B[:nx], np.zeros((nx, self.slacks))
        now, before = np.hstack([-B, np.eye(nx), none]), np.hstack([-A[:, nx:], -A[:, :nx], none])
        return _banded(now, before, stages)

    @cached_property
    def rows(self) -> sp.csc_matrix:
        """Tension rows and rate rows, stage by stage."""
        stages, nu, nx, nt = self.sizes
        C, slack = self.problem.tension, np.ones((nt, self.slacks))
        tension = np.hstack([C[:, nx:], C[:, :nx], slack])
        rate = np.hstack([np.eye(nu), np.zeros((nu, nx + self.slacks))])
        return _banded(np.vstack([tension, rate]), np.vstack([0 * tension, -rate]), stages)

    def vectors(self, qp: QP) -> Vectors:
        """The vectors of one step from those of its condensed form.

        The QP's `start` is where the states begin; its tension bounds are told without what the start alone does.
        """
        assert qp.start is not None
        stages, nu, nx, nt = self.sizes
        n = stages * nu
        slack = slice(n, n + stages * self.slacks)
        cost = np.zeros((stages, nu + nx + self.slacks))
        lower, upper = np.full(cost.shape, -np.inf), np.full(cost.shape, np.inf)
        lower[:, :nu], upper[:, :nu] = qp.lower[:n].reshape(stages, nu), qp.upper[:n].reshape(stages, nu)
        if self.problem.following is not None:  # what is wanted of states, as the inputs that drive them feel it
            cost[:, :nu] = (qp.f[:n] - self.problem.from_state @ qp.start).reshape(stages, nu)
        if self.slacks:
            cost[:, -1], lower[:, -1] = qp.f[slack], qp.lower[slack]
        motion = np.zeros((stages, nx))
        motion[0] = self.problem.A[:nx] @ qp.start
        floors = qp.lower[slack.stop : slack.stop + stages * nt] + self.problem.tension_from_state @ qp.start
        change = slice(slack.stop + stages * nt, None)
        least = np.hstack([floors.reshape(stages, nt), qp.lower[change].reshape(stages, nu)])
        most = np.hstack([np.full((stages, nt), np.inf), qp.upper[change].reshape(stages, nu)])
        return Vectors(cost.ravel(), motion.ravel(), lower.ravel(), upper.ravel(), least.ravel(), most.ravel())

    def condensed(
        self, x: np.ndarray, bounds: np.ndarray, rows: np.ndarray
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " m"]]:
        """Variables and multipliers of the condensed form, from the variables and their multipliers by stages."""
        stages, nu, _, nt = self.sizes
        x, bounds, rows = x.reshape(stages, -1), bounds.reshape(stages, -1), rows.reshape(stages, -1)
        last = slice(x.shape[1] - self.slacks, None)
        z = np.concatenate([x[:, :nu].ravel(), x[:, last].ravel()])
        y = [bounds[:, :nu], bounds[:, last], rows[:, :nt], rows[:, nt:]]
        return z, np.concatenate([part.ravel() for part in y])


def _banded(now: np.ndarray, before: np.ndarray, stages: int) -> sp.csc_matrix:
    """The same rows in every stage, over its own variables and those of the stage before."""
    return sp.csc_matrix(sp.kron(sp.eye_array(stages), now) + sp.kron(sp.eye_array(stages, k=-1), before))
