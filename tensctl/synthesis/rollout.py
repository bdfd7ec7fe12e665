"""A plan rolled out on the nonlinear structure, with the exact derivative of every state by every input of the plan.

    q'' = a(q, q', L(t)),   L(t) = L0 - G u(t),   u(t) straight from u_k to u_(k+1) within a period

Where actuators lag, commands go straight and u follows them, tau u' = c - u: at each stage a known linear function of u
at the start and of all commands so far, whose weights depend on the stage and on how many periods ago each command was.

Classical Runge-Kutta steps of equal length, rods put back to their lengths after each; the columns that go along are
the derivative of these very steps, not of the motion that they approximate. Slack tendons carry nothing at any stage.
Joints and guides push at every stage and are closed after each step, their columns along (`model.joint_columns`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.jit import bare
from tensctl.model import Dynamics
from tensctl.model.joint_columns import close_columns, tie_columns, tie_room
from tensctl.model.kernel import copy
from tensctl.model.kernel_columns import (
    acceleration_columns,
    column_room,
    copy_columns,
    place_columns,
    stretch_columns,
    tidy_columns,
)
from tensctl.synthesis.lagging import followed_along

# Phase of the fastest frequency in one step, rad: the error of a step is its fifth power over 120, 6e-4 of the fastest
# mode's motion, and falls with the fourth power of the step.
_PHASE = 0.6
# Most steps of a period; more are a sign of a period too long for the structure, or of stiff dampers.
_MOST = 64
# A period that is told is a little shorter, lest three digits make it too long.
_BELOW = 0.995


@dataclass(frozen=True, eq=False)
class Rollout:
    """The structure at the end of every period ahead, and derivatives by the inputs z of the plan, (N nu,).

    Attributes
    ----------
    nodes, velocities : (N, K, 3) m, m/s
    stretches : (N, nt) m
        Tension over stiffness as it would be were the tendon taut; negative when slack.
    by_inputs : (N, 2, K, 3, N nu)
        Derivatives of nodes and of velocities (1/s).
    stretch_by_inputs : (N, nt, N nu)
    inputs : (N, nu) m, or None
        Rest-length changes, where actuators lag behind the plan.
    inputs_by_plan : (N, N), or None
        Their derivatives by the commands of the plan, the same for each input.
    """

    nodes: Float[np.ndarray, "N K 3"]
    velocities: Float[np.ndarray, "N K 3"]
    stretches: Float[np.ndarray, "N nt"]
    by_inputs: Float[np.ndarray, "N 2 K 3 z"]
    stretch_by_inputs: Float[np.ndarray, "N nt z"]
    inputs: Float[np.ndarray, "N nu"] | None = None
    inputs_by_plan: Float[np.ndarray, "N N"] | None = None

    @property
    def finite(self) -> bool:
        """Whether the motion and its derivatives are numbers: one far too fast for the steps is not."""
        parts = self.nodes, self.velocities, self.stretches, self.by_inputs, self.stretch_by_inputs
        return all(bool(np.isfinite(part).all()) for part in parts)


@dataclass(frozen=True, eq=False)
class Rolling:
    """Rolls plans of one structure out.

    Attributes
    ----------
    dynamics : Dynamics
    dt : float, s
        Period.
    steps : int
        Steps of a period.
    lag : float, s
        By which rest lengths are behind the plan.
    """

    dynamics: Dynamics
    dt: float
    steps: int
    lag: float = 0.0

    @cached_property
    def _gear(self) -> Float[np.ndarray, "nt nu"]:
        """Shortening of every tendon by every input."""
        members = self.dynamics.members
        gear = np.zeros((members.rest_lengths.size, members.gearing.size))
        gear[members.inputs] = members.gearing.matrix.toarray()
        return gear

    def __call__(
        self,
        nodes: Float[np.ndarray, "K 3"],
        velocities: Float[np.ndarray, "K 3"],
        now: Float[np.ndarray, " nu"],
        plan: Float[np.ndarray, "N nu"],
        *,
        commands: Float[np.ndarray, " nu"] | None = None,
        columns: bool = True,
    ) -> Rollout:
        """Roll a plan (m, total changes at the ends of periods) out from a state and the inputs as they are now.

        Where actuators lag the plan is one of commands, and so are `commands` as they are now; without, `now`.
        """
        dynamics, (periods, nu) = self.dynamics, plan.shape
        asked = np.vstack([now if commands is None else commands, plan])
        parts = np.arange(2 * self.steps + 1) / (2 * self.steps)
        first, *ramps = (dynamics.members.shortened(u) for u in (now, *asked))
        rest = followed_along(self.lag, self.dt, parts, first, np.array(ramps))
        by_age = self._by_age(parts, periods)
        q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
        width = periods * nu if columns else 0
        room = column_room(dynamics.kernel, width)
        size, nt = room.place.size, rest.shape[2]
        states, changes = np.zeros((periods, 2, size)), np.zeros((periods, 2, size, width))
        stretch, stretches = np.zeros((periods, nt)), np.zeros((periods, nt, width))
        load = dynamics.layout.spread(dynamics.members.forces).ravel()
        work = tuple(np.zeros(q.shape) for _ in range(5)), tuple(np.zeros((*q.shape, width)) for _ in range(7))
        lengths = np.zeros(nt), np.zeros((nt, width))
        tie = tie_room(dynamics.kernel, width) if dynamics.tied else None
        moved = _roll(
            dynamics.kernel, q, v, rest, by_age, dynamics.members.rest_lengths, self._gear[:, : nu if columns else 0],
            self.dt / self.steps, self.steps, load, room, work, lengths, tie, states, changes, stretch, stretches,
        )  # fmt: skip
        shape = (periods, 2, size // 3, 3)
        states, changes = states.reshape(shape), changes.reshape(*shape, width)
        if dynamics.tied:
            states, changes = states[:, :, dynamics.layout.place], changes[:, :, dynamics.layout.place]
        if not moved:
            states = np.full_like(states, np.nan)
        found = Rollout(states[:, 0], states[:, 1], stretch, changes, stretches)
        if not self.lag:
            return found
        inputs = followed_along(self.lag, self.dt, parts[-1:], now, asked)[:, 0]
        return replace(found, inputs=inputs, inputs_by_plan=sla.toeplitz(by_age[-1], np.zeros(periods)))

    def _by_age(self, parts: Float[np.ndarray, " p"], periods: int) -> Float[np.ndarray, "p ages"]:
        """What is there, at parts of a period, of a unit that the plan asks for at the end of so many periods before.

        Age 0 is the period whose end asks for it. Without lag all of it is gone two periods later.
        """
        ages = periods if self.lag else 2
        asked = np.zeros((ages + 1, 1))
        asked[1] = 1.0
        return np.ascontiguousarray(followed_along(self.lag, self.dt, parts, np.zeros(1), asked)[:, :, 0].T)


def rolling(dynamics: Dynamics, dt: float) -> Rolling:
    """Make ready to roll plans out, in steps that follow the structure's fastest frequency and decay.

    Raises
    ------
    SynthesisError
        A period too long for the fastest motion.
    """
    fastest = max(dynamics.fastest_rate, dynamics.fastest_decay if dynamics.damped else 0.0)
    steps = int(np.ceil(max(fastest * dt / _PHASE, 1.0)))
    if steps > _MOST:
        raise SynthesisError(
            f"a period of {dt:g} s takes {steps} steps of the fastest motion, {fastest:.3g} 1/s ({_cause(dynamics)}); "
            f"at most {_MOST} are expected, so take dt below {_BELOW * _MOST * _PHASE / fastest:.3g} s, or tc.MPC, "
            'which with modes = "truncate" leaves such motions out.'
        )
    return Rolling(dynamics, dt, steps)


def _cause(dynamics: Dynamics) -> str:
    """What makes a structure's fastest motion fast, in words."""
    if dynamics.damped and dynamics.fastest_decay > dynamics.fastest_rate:
        return "dampers and drag stop it"
    members, labels = dynamics.members, dynamics.structure.tendon_labels
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    stiffest, ratio = int(stiffness.argmax()), stiffness.max() / np.median(stiffness)
    return (
        f"tendon {labels[stiffest]} has {stiffness[stiffest]:.3g} N/m, {ratio:.2g} times the median, and the lightest "
        f"rod {members.mass.min():.3g} kg, of {members.mass.max():.3g} at most"
    )


@bare
def _roll(
    data, q, v, rest, aged, natural, gear, h, steps, load, room, work, lengths, tie, states, by_plan, stretch, stretches
):
    """Move q and v through all periods; fill nodes, stretches and their columns at the end of each.

    False where joints or guides lock on the way. Without any, tie is None, and nothing of theirs is compiled.
    """
    nu, (length, dL) = gear.shape[1], lengths
    (q_sum, v_sum, q_at, v_at, a), (dq, dv, dq_sum, dv_sum, dq_at, dv_at, da) = work
    for k in range(states.shape[0]):
        count, begins = (k + 1) * nu, max(0, (k + 1 - aged.shape[1]) * nu)
        for n in range(steps):
            copy(q, q_sum)
            copy(v, v_sum)
            copy(q, q_at)
            copy(v, v_at)
            copy_columns(dq, dq_sum, count)
            copy_columns(dv, dv_sum, count)
            copy_columns(dq, dq_at, count)
            copy_columns(dv, dv_at, count)
            for stage in range(4):
                part = 2 * n + (0 if stage == 0 else 2 if stage == 3 else 1)
                _rest_at(rest[k, part], aged[part], gear, k, length, dL)
                acceleration_columns(data, q_at, v_at, length, load, dq_at, dv_at, dL, begins, count, room, a, da)
                if tie is not None and not tie_columns(data, q_at, dq_at, tie.still, count, tie, a, da):
                    return False
                weight = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
                ahead = h if stage == 2 else 0.5 * h
                for r in range(q.shape[0]):
                    for i in range(6):
                        q_sum[r, i] += weight * v_at[r, i]
                        v_sum[r, i] += weight * a[r, i]
                        q_at[r, i], v_at[r, i] = q[r, i] + ahead * v_at[r, i], v[r, i] + ahead * a[r, i]
                        for c in range(count):
                            dq_sum[r, i, c] += weight * dv_at[r, i, c]
                            dv_sum[r, i, c] += weight * da[r, i, c]
                            dq_at[r, i, c] = dq[r, i, c] + ahead * dv_at[r, i, c]
                            dv_at[r, i, c] = dv[r, i, c] + ahead * da[r, i, c]
            copy(q_sum, q)
            copy(v_sum, v)
            copy_columns(dq_sum, dq, count)
            copy_columns(dv_sum, dv, count)
            tidy_columns(data, q, v, dq, dv, count)
            if tie is not None and not close_columns(data, q, v, dq, dv, count, tie):
                return False
        place_columns(data, q, dq, count, room.place, room.places)
        place_columns(data, v, dv, count, room.speed, room.speeds)
        _rest_at(rest[k, 2 * steps], aged[2 * steps], gear, k, length, dL)
        stretch_columns(data, length, natural, dL, begins, count, room, stretch[k], stretches[k])
        for i in range(room.place.size):
            states[k, 0, i], states[k, 1, i] = room.place[i], room.speed[i]
            for c in range(count):
                by_plan[k, 0, i, c], by_plan[k, 1, i, c] = room.places[i, c], room.speeds[i, c]
    return True


@bare
def _rest_at(rest, by_age, gear, k, length, dL):
    """Fill the rest lengths at a stage of a period and their columns, those of the inputs that they still feel."""
    nu = gear.shape[1]
    for t in range(length.size):
        length[t] = rest[t]
        for age in range(min(k + 1, by_age.size)):
            for j in range(nu):
                dL[t, (k - age) * nu + j] = -by_age[age] * gear[t, j]
