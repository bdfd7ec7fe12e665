"""Stiff motion: adaptive Rosenbrock steps on exact Jacobians, with tendons that go slack or taut located like events.

A step after which a spring or damper should have changed over is shortened to the place where it does (found on the
method's own dense output, then stepped to), and the motion starts anew from there. Rods keep their lengths by
construction: every step has its own chart (`chart`).

Errors of a step are of order h^6 in smooth motion. A tendon that comes and goes between two stages is not seen.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tensctl.errors import SimulationError
from tensctl.jit import bare
from tensctl.model import Dynamics
from tensctl.model.kernel import copy, tidy
from tensctl.simulation.drive import Drive, drive_at
from tensctl.simulation.integrators.chart import leave_chart, place_ends
from tensctl.simulation.integrators.frozen import sides, worst_side
from tensctl.simulation.integrators.kept import Kept
from tensctl.simulation.integrators.rodas import RODAS5P
from tensctl.simulation.integrators.rosenbrock_step import linearise, stages, within
from tensctl.simulation.integrators.stiff_layout import Plan, Room, Task, plan_steps, room_for, unpacked

# Switches are not told apart that come sooner than this after a step's start, over the time that it is: some hundred
# times its rounding. A step that errors push below a tenth of it ends the run. Near zero, time has digits to spare: it
# counts as this part of the run there, and a violent start is followed, however short it is.
_SOONEST, _AT_LEAST = 1e-13, 1e-6
# Parts of the band past a switch: where a shortened step aims, how far off it may end, and how far past a tendon
# has to be to change over. The margin keeps tendons that carry next to nothing from chattering.
_AIM, _NEAR, _MARGIN = 0.5, 0.25, 0.125
# Places of a step at which tendons are looked at when a stage saw one that should have changed over.
_LOOKS = 4
# Step-size control after K. Gustafsson (as in RADAU5): safety, least and largest change, and the least error over the
# allowed one that counts.
_SAFE, _SHRINK, _GROW, _LEAST = 0.9, 0.1, 6.0, 1e-10
# Error allowed in one step over tol: on stiff scenes of some hundred oscillations errors then add up to about tol.
_STRICT = 0.1
# A step that ends within this part of the allowed error past a switch ends on it; but not less than what lengths lose
# by rounding, over the size.
_BAND, _ROUNDING = 0.01, 1e-13
# Order of the method, and times that a switch is looked for in a step.
_ORDER, _TRIALS = 5, 64
# First step times the fastest rate.
_FIRST = 0.01


@bare
def trespass(task, t, y, span):
    """How far the worst tendon is on the wrong side at chart coordinates y within a step of length span, m."""
    data, plan, drive, _, room = unpacked(task)
    place_ends(data, room.frame, y, room.place, room.speed)
    if drive.ramped or drive.swept:
        drive_at(drive, t, room.rest, room.load)
    sides(data, room.place, room.speed, room.rest, plan.decay, span, room.side)
    return worst_side(room.side, room.on)


@bare
def first_switch(task, t, h, band, span):
    """Part of the step at which a tendon is between zero and `band` on the wrong side; 1 when none is beyond it."""
    _, _, _, table, room = unpacked(task)
    aim, y = _AIM * band, room.right
    low, f_low, high, f_high, side = 0.0, -band, 2.0, band, 0
    for k in range(1, _TRIALS):
        looking = high > 1.0
        if looking:
            x = k / _LOOKS
        else:
            x = low + (high - low) * f_low / (f_low - f_high) if f_low < 0.0 else 0.5 * (low + high)
        within(table.H, x, room.y, room.end, room.U, y)
        f = trespass(task, t + x * h, y, span) - aim
        if looking:
            if f > band - aim:
                high, f_high = x, f
            elif k == _LOOKS:
                return 1.0
            else:
                low, f_low = x, f
        elif abs(f) <= _NEAR * band or high - low < 1e-15:
            return x
        elif f > 0.0:
            high, f_high = x, f
            f_low *= 0.5 if side == 1 else 1.0
            side = 1
        else:
            low, f_low = x, f
            f_high *= 0.5 if side == -1 else 1.0
            side = -1
    return high


@bare
def attempt(task, t, h, q_scale, v_scale, band):
    """Take a step of length h; its error over the allowed one, and the part of it up to the first switch."""
    _, _, _, table, room = unpacked(task)
    fine, crossed = stages(task, t, h)
    if not fine:
        return np.inf, 1.0
    error, half, u = 0.0, room.start.size, room.U[table.d.size - 1]
    for k in range(half):
        error = max(error, abs(u[k]) / q_scale, abs(u[half + k]) / v_scale)
        if not (abs(room.end[k]) < np.inf and abs(room.end[half + k]) < np.inf):
            return np.inf, 1.0
    if error <= 1.0:
        late = trespass(task, t + h, room.end, 0.0) > band
        if late or crossed:
            return error, first_switch(task, t, h, band, 0.0 if late else h)
    return error, 1.0


@bare
def record(task, y, q, v):
    """Fill q, v with the state at chart coordinates, rods at their lengths to the last digit."""
    data, _, _, _, room = unpacked(task)
    place_ends(data, room.frame, y, room.place, room.speed)
    leave_chart(data, y, room.place, room.speed, q, v)
    tidy(data, q, v)


@bare
def march(task, q, v, times, first, q_scale, v_scale, band, out_q, out_v):
    """Move q and v through times; returns the time reached, the next step, steps, changes, sum of errors.

    Parameters
    ----------
    task : Kept of Task
    first : float, s
        Step to try first.
    q_scale, v_scale : float, m, m/s
        Errors allowed in a step.
    band : float, m
        How far past its switch a tendon may be when a step ends there.
    """
    _, _, _, table, room = unpacked(task)
    t, t_end, h, row, tries, changes, total = times[0], times[-1], first, 1, 0, 0, 0.0
    before, refused, cut, moved, anew = 1.0, False, False, True, True
    usual, least = first, _AT_LEAST * (t_end - t)
    while t < t_end:
        soonest = _SOONEST * max(abs(t), least)
        if moved:
            changed = linearise(task, t, q, v, 0.0 if anew else _MARGIN * band)
            changes += 0 if anew else changed
            anew, moved = False, False
        last = t + 1.000001 * h >= t_end - soonest
        if last:
            h = t_end - t
        if not last and h < 0.1 * soonest:
            break
        error, x = attempt(task, t, h, q_scale, v_scale, band)
        tries += 1
        if not error <= 1.0:
            if h < 0.1 * soonest:
                break
            h *= max(_SHRINK, min(_SAFE, _SAFE * error ** (-1.0 / _ORDER))) if error < np.inf else _SHRINK
            refused, cut = True, False
            continue
        if x < 1.0 and h > soonest:
            usual = usual if cut else h
            h, cut = max(h * x, soonest), True
            continue
        reached = t_end if last else t + h
        while row < times.size - 1 and times[row] <= reached:
            within(table.H, (times[row] - t) / h, room.y, room.end, room.U, room.right)
            copy(q, out_q[row])
            copy(v, out_v[row])
            record(task, room.right, out_q[row], out_v[row])
            row += 1
        record(task, room.end, q, v)
        total += error * q_scale
        t, moved, error = reached, True, max(error, _LEAST)
        if cut:
            h = usual
        else:
            grow = _SAFE * error ** (-0.7 / _ORDER) * before ** (0.4 / _ORDER)
            h *= min(1.0 if refused else _GROW, max(0.2, grow))
            usual = usual if last else h
        before, refused, cut = error, False, False
    copy(q, out_q[-1])
    copy(v, out_v[-1])
    return t, max(usual, h), tries, changes, total


@dataclass(eq=False)
class Rosenbrock:
    """Adaptive Rosenbrock steps of order 5 on exact Jacobians.

    Attributes
    ----------
    dynamics : Dynamics
    tol : float
        A tenth of it, over the size, is the error of place allowed in a step.
    rate : float, rad/s
        A bound on the frequencies: gives the first step.
    """

    dynamics: Dynamics
    tol: float
    rate: float
    name: str = "rosenbrock"
    evaluations: int = 0
    switches: int = 0
    step: float = 0.0
    local_errors: float = 0.0
    _kept: tuple[Kept, Kept] | None = field(default=None, init=False, repr=False)

    @cached_property
    def _pace(self) -> float:
        """Errors allowed in velocities over those in places, 1/s.

        One in the fastest mode moves rods by 1/rate of it, one in a rigid-body motion by a second of it: the geometric
        mean is taken.
        """
        return float(np.sqrt(self.rate))

    @cached_property
    def _room(self) -> tuple[Plan, Room]:
        plan = plan_steps(self.dynamics.kernel)
        return plan, room_for(self.dynamics.kernel, plan, RODAS5P.d.size)

    def _task(self, drive: Drive) -> Kept:
        """What a march works on, made once for all drives of one form."""
        if self._kept is None or not self._kept[0].renew(drive):
            kept = Kept(drive)
            self._kept = kept, Kept(Task(self.dynamics.kernel, self._room[0], kept, RODAS5P, self._room[1]))
        return self._kept[1]

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the step falls to nothing.
        """
        _, room = self._room
        room.rest[:], room.load[:] = drive.rest, drive.force.ravel()
        size = float(self.dynamics.potential.manifold.lengths.max())
        scale = _STRICT * self.tol * size
        t, self.step, tries, changes, total = march(
            self._task(drive), q, v, times, self.step or _FIRST / self.rate, scale,
            scale * self._pace, max(_BAND * scale, _ROUNDING * size), out_q, out_v,
        )  # fmt: skip
        self.evaluations += RODAS5P.d.size * tries
        self.switches += changes
        self.local_errors += total
        if t < times[-1]:
            raise SimulationError(f"the step size fell to nothing at {t:g} s; loosen tol, or lower the stiffness.")
