"""The MPC problem, condensed: states are eliminated, the inputs of the horizon remain.

With e the state's and v the inputs' deviation from the reference, and rest lengths that ramp within a period,

    (e, v)_(k+1) = A (e, v)_k + B v_(k+1),   cost  sum e'Q e + |W (y - r)|^2 + v'R v  +  (e, v)_N' P (e, v)_N
    hard         lower <= v <= upper,  |change of the total input| <= rate_max dt
    soft         force_max >= T = T_ref + C e + D v >= tension_min at the end of every period

P solves the discrete Riccati equation, so without active constraints the first input is the infinite-horizon optimum.
Weighted outputs y = C e + D v are there when asked for, their wish r when a signal is (`synthesis.following`): r is
known over the horizon and held after it.
Tension rows are divided by the stiffness: every row is in metres. A stall limit force_max is a row of its own, turned
about, so that all of them are floors; without one there is no such row.

Where actuators lag, the last states of e are rest lengths and v are commands (`linear.actuated`): floors and limits of
commands then hold for rest lengths as well, which are always between commands of the past.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NoReturn

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, Sampled, sample_ramped
from tensctl.synthesis.crossed import undecided
from tensctl.synthesis.doubling import no_solution
from tensctl.synthesis.following import Following, following
from tensctl.synthesis.mpc_weights import Weights
from tensctl.synthesis.riccati import Riccati, dare
from tensctl.synthesis.sampling_limit import refuse_short
from tensctl.synthesis.shown import shown
from tensctl.synthesis.stabilisable import refuse_undriven, unreached
from tensctl.synthesis.unseen import unseen
from tensctl.synthesis.weights import Cost
from tensctl.threads import one_blas_thread

# A mode that decays by less than this part of itself in a period is one that no weighted output shows.
_LEAST_DECAY = 1e-9
# Entries of rows from which on their products leave out zeros: a step of the free (8,4) shell, 18 million, is then
# done in 19 ms where it took 35; up to here calls take longer than zeros.
_LARGE = 2_000_000
# Parts of the horizon in such products: a sixteenth of what is read is zero then.
_PARTS = 8


@dataclass(frozen=True, eq=False)
class Condensed:
    """All matrices of the condensed QP; only vectors change from step to step.

    Attributes
    ----------
    H : (N nu, N nu), J/m^2 s
    from_state : (N nu, nx + nu)
        f = from_state (e_0, v_0).
    tension_rows, tension_from_state : maps of v and (e_0, v_0) to scaled tension deviations, (N nT, .) m
    rows : (N nT + N nu, N nu)
        Tension rows, then rate rows.
    tension_scale : (nT,) N/m
    tendons : (nT,)
        Whose tension each row bounds.
    side : (nT,)
        1 for rows of tension_min, -1 for rows of force_max, which are turned about.
    force_max : (nT,) N
        Stall limit of each row's tendon.
    offset : (nx + nu, nx + nu)
        Half its quadratic form in (e_0, v_0) is the constant part of the cost.
    following : Following or None
        How wanted outputs pull on the plan; None without a signal.
    unlimited : (N nu + N nT + N nu, nx + nu + N ny) or None
        All that is bounded, the plan and its rows, at the minimum without limits: of (e_0, v_0), and of what is wanted.
        None where H has no Cholesky factor.
    """

    horizon: int
    sampled: Sampled
    A: Float[np.ndarray, "n n"]
    B: Float[np.ndarray, "n nu"]
    Q: Float[np.ndarray, "n n"]
    R: Float[np.ndarray, "nu nu"]
    P: Float[np.ndarray, "n n"]
    K: Float[np.ndarray, "nu n"]
    riccati_residual: float
    tension: Float[np.ndarray, "nT n"]
    tendons: np.ndarray
    side: Float[np.ndarray, " nT"]
    force_max: Float[np.ndarray, " nT"]
    tension_scale: Float[np.ndarray, " nT"]
    H: np.ndarray
    from_state: np.ndarray
    tension_from_state: np.ndarray
    rows: np.ndarray
    offset: Float[np.ndarray, "n n"]
    following: Following | None = None
    unlimited: np.ndarray | None = None

    @property
    def floored(self) -> np.ndarray:
        """Tendons that have a tension floor: taut at the equilibrium, not between pins."""
        return self.tendons[self.side > 0]

    def rows_at(self, plan: Float[np.ndarray, " v"]) -> Float[np.ndarray, " r"]:
        """All rows by what is not zero in them: rates are differences, and floors know of nothing that comes later."""
        if self.rows.size < _LARGE:
            return self.rows @ plan
        changes, inputs = plan.copy(), plan.size // self.horizon
        changes[inputs:] -= plan[:-inputs]
        return np.concatenate([self.tensions_at(plan), changes])

    def tensions_at(self, plan: Float[np.ndarray, " v"]) -> Float[np.ndarray, " NnT"]:
        """The tension rows' part of it."""
        floors, inputs = self.tension.shape[0], plan.size // self.horizon
        ends = [self.horizon * k // _PARTS for k in range(_PARTS + 1)]
        return np.concatenate(
            [self.rows[a * floors : b * floors, : b * inputs] @ plan[: b * inputs] for a, b in pairwise(ends)]
        )

    def scaled(self, tensions: Float[np.ndarray, "*k tendons"]) -> Float[np.ndarray, "*k nT"]:
        """Tensions, N, as the rows count them, m: turned about where a row is a stall limit."""
        return self.side * tensions[..., self.tendons] / self.tension_scale

    def margin(self, tensions: Float[np.ndarray, "*k tendons"], tension_min: float) -> Float[np.ndarray, "*k nT"]:
        """How far tensions, N, are within the limit of each row, scaled, m."""
        limit = np.where(self.side > 0, tension_min, self.force_max)
        return self.scaled(tensions) - self.side * limit / self.tension_scale

    def constant(self, start: Float[np.ndarray, " n"], wanted: Float[np.ndarray, "N ny"] | None = None) -> float:
        """The part of the cost that no input changes, which the condensed objective drops; without what only r has."""
        pulled = 0.0 if self.following is None or wanted is None else self.following.start @ wanted.ravel()
        return float(start @ (0.5 * self.offset @ start + pulled))


@one_blas_thread()
def condense(linear: LinearModel, horizon: int, dt: float, weights: Weights, *, follows: bool = False) -> Condensed:
    """Build the condensed problem of a flexible linear model; with `follows`, for outputs that follow a signal.

    Raises
    ------
    SynthesisError
        When the discrete Riccati equation of the terminal weight has no solution, with the mode that inputs do not
        bring to rest.
    """
    nx, nu = linear.B.shape
    sampled = sample_ramped(linear.A, linear.B, dt)
    A, B = sampled.with_input_state()
    Q, R = stage_weights(linear, dt, weights)
    try:
        terminal = terminal_weight(A, B, Q, R, weights)
    except SynthesisError:
        refuse_undriven(linear.mechanics)
        raise
    tension, tendons, side = _tension(linear)
    free, forced = _predict(A, B, horizon)
    stages = _by_stage(Q, terminal.X, horizon)
    weighted = stages @ forced
    stacked, weighted = forced.reshape(-1, horizon * nu), weighted.reshape(-1, horizon * nu)
    H = stacked.T @ weighted + np.kron(np.eye(horizon), R)
    tension_rows = (tension @ forced).reshape(-1, horizon * nu)
    pull = None
    if follows:
        weighed, loop = weights.of_outputs(linear), A - B @ terminal.K
        pull = following(weighed, weights.energy, R, dt, loop, terminal.K, (free, forced))
    rate_rows = np.kron(np.eye(horizon) - np.eye(horizon, k=-1), np.eye(nu))
    H, rows = 0.5 * (H + H.T), np.vstack([tension_rows, rate_rows])
    from_state = weighted.T @ free.reshape(-1, nx + nu)
    return Condensed(
        horizon=horizon, sampled=sampled, A=A, B=B, Q=Q, R=R, P=terminal.X, K=terminal.K,
        riccati_residual=terminal.residual, tension=tension, tendons=tendons, side=side,
        force_max=linear.dynamics.members.force_max[tendons], tension_scale=_scale(linear, tendons),
        H=H,
        from_state=from_state,
        tension_from_state=(tension @ free).reshape(-1, nx + nu),
        rows=rows,
        offset=np.einsum("kji,kjl->il", free, stages @ free),
        following=pull,
        unlimited=_unlimited(H, rows, from_state if pull is None else np.hstack([from_state, pull.plan])),
    )  # fmt: skip


def stage_weights(linear: LinearModel, dt: float, weights: Weights) -> tuple[np.ndarray, np.ndarray]:
    """Q of (e, v), (nx + nu, nx + nu), and R, (nu, nu), of one period.

    Raises
    ------
    SynthesisError
        A period too short for double precision, or an input without a cost.
    """
    refuse_short(linear.scales, dt)
    nx, nu = linear.B.shape
    Q, moving = np.zeros((nx + nu, nx + nu)), len(linear.mechanics.A)
    Q[:moving, :moving] = weights.energy * dt * np.eye(moving)
    if weights.outputs:
        rows = weights.of_outputs(linear).rows
        Q += dt * rows.T @ rows
    return Q, dt * weights.of_inputs(linear)


def terminal_weight(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray, weights: Weights) -> Riccati:
    """The terminal weight; without a weight of energy, modes that no output shows would swing for ever.

    Raises
    ------
    SynthesisError
        When the equation has no solution, or one that leaves a mode swinging: whether inputs do not reach it, outputs
        do not show it, or weights are too far apart.
    """
    try:
        found = dare(A, B, Q, R)
    except SynthesisError:
        return _refuse_unsolved(A, B, Q)
    decay = 1 - float(np.abs(np.linalg.eigvals(A - B @ found.K)).max(initial=0.0)) if weights.energy == 0 else 1.0
    if decay < _LEAST_DECAY:
        _refuse_unsolved(A, B, Q, f"the loop's slowest mode decays by {max(decay, 0.0):.1e} of itself in a period")
    return found


def _refuse_unsolved(A: np.ndarray, B: np.ndarray, Q: np.ndarray, found: str = "") -> NoReturn:
    """Say why a sampled model has no terminal weight, or one that leaves what was `found`.

    (A - I)(A + I)^-1 has the eigenvectors of A, and its undamped poles on the imaginary axis.
    """
    one, none = np.eye(len(A)), np.zeros((0, 0))
    turning = np.linalg.solve((A + one).T, (A - one).T).T
    if unreached(turning, B).size:
        raise no_solution()
    if next(unseen(turning, Cost(Q, none, np.zeros((len(A), 0)))), None) is not None:
        raise SynthesisError(
            "without a weight of energy some mode swings for ever: the weighted outputs do not show every mode, so add "
            "outputs or give energy a weight > 0."
        )
    if found:
        raise SynthesisError(
            f"without a weight of energy {found}: at their sizes the weighted outputs count too little beside what "
            "rest lengths cost, so lower the sizes or give energy a weight > 0."
        )
    raise undecided("give weights nearer to each other")


def _tension(linear: LinearModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Scaled tension map of (e, v), the tendons of its rows (taut, not between pins) and their sides."""
    members = linear.dynamics.members
    kept = _floored(linear)
    stalling = kept[np.isfinite(members.force_max[kept])]
    tendons, side = np.concatenate([kept, stalling]), np.repeat([1.0, -1.0], [kept.size, stalling.size])
    model = shown(linear, "tensions")
    return np.hstack([model.C, model.D])[tendons] * (side / _scale(linear, tendons))[:, None], tendons, side


def stiffness_spread(linear: LinearModel) -> float:
    """The stiffest over the softest tendon that has a floor; 1 without any."""
    scale = _scale(linear, _floored(linear))
    return float(scale.max() / scale.min()) if scale.size else 1.0


def _floored(linear: LinearModel) -> np.ndarray:
    """Tendons that are taut, and not between pins."""
    structure = linear.dynamics.structure
    return np.flatnonzero((linear.equilibrium.tensions > 0) & ~structure.grounded_tendons)


def _scale(linear: LinearModel, tendons: np.ndarray) -> np.ndarray:
    """Newtons that a metre of these tendons stands for."""
    members = linear.dynamics.members
    return members.stiffness[tendons] / (1.0 if members.law == "k" else members.rest_lengths[tendons])


def _predict(A: np.ndarray, B: np.ndarray, horizon: int) -> tuple[np.ndarray, np.ndarray]:
    """States of stages 1..N from the start, (N, n, n), and from the stacked inputs, (N, n, N nu)."""
    n, nu = B.shape
    free, forced = np.empty((horizon, n, n)), np.zeros((horizon, n, horizon * nu))
    state, drive = np.eye(n), np.zeros((n, horizon * nu))
    for k in range(horizon):
        state, drive = A @ state, A @ drive
        drive[:, k * nu : (k + 1) * nu] = B
        free[k], forced[k] = state, drive
    return free, forced


def _unlimited(H: np.ndarray, rows: np.ndarray, slopes: np.ndarray) -> np.ndarray | None:
    try:
        plan = -sla.cho_solve(sla.cho_factor(H), slopes)
    except np.linalg.LinAlgError:
        return None
    return np.vstack([plan, rows @ plan])


def _by_stage(Q: np.ndarray, P: np.ndarray, horizon: int) -> np.ndarray:
    weights = np.broadcast_to(Q, (horizon, *Q.shape)).copy()
    weights[-1] = P
    return weights
