"""Undamped motion: kicks between exact flights, with slack-taut switches located or, for many rods, passed over.

    v += b h a(q),   q flies for a h;   orders 2, 4 and 6

Symplectic, rod lengths and momenta to rounding. The step follows from the tolerance and a bound on the frequencies at
rest, and is halved while rods turn or pass faster than that; a probe at the start, after each switch of loads and
every 64 steps compares one step with two halves, and shortens it for motions that are faster than that bound (spinning
rods, far from rest). Splitting tables lose their order, and their negative sub-steps anti-damp, when kicks depend on
velocity: damped scenes are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tensctl.errors import SimulationError
from tensctl.jit import bare
from tensctl.model import Dynamics
from tensctl.model.kernel import springs
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.leap import Moment, Scratch, copy_moment, leap, moment, rates_at, refresh, scratch
from tensctl.simulation.integrators.rows import Rows, rows_of
from tensctl.simulation.integrators.switching import change_over, first_to_leave, settle
from tensctl.simulation.integrators.tables import TABLES, Order

# Steps between two probes.
_PROBE = 64
# Landings in a row shorter than 1e-12 of the step: more than this and the motion cannot be followed.
_STUCK = 1000
# Step times omega_max over tol^(1/order): the (3,1) and (4,2) shells, released at rest, then err by a fifth of tol in
# 1 s.
_REACH: dict[Order, float] = {2: 2.0, 4: 15.0, 6: 10.0}
# Longest step times omega_max. The compositions of order 4 and 6 stay stable to 3; Verlet to 2.
_LONGEST: dict[Order, float] = {2: 1.0, 4: 2.0, 6: 2.7}
# Nodes pass each other at twice the speed of the fastest at most, so a gap that is left and taken again within a step
# is nowhere wider than the speed times its length; four times that covers speeds that rise and fall within the step.
_FAR = 4.0
# Rounding of a position over the size, below which no probe can see.
_ROUNDING = 4e-15
_DONE, _STUCK_STATUS, _TOO_LONG, _LOST = 0, 1, 2, 3


@bare
def probe(rows, drive, t, h, kicks, drifts, start, now, other, work):
    """Distance in m of one step, left in `now`, and two half steps, left in `other`, from what is kept in `start`."""
    copy_moment(now, start)
    copy_moment(now, other)
    leap(rows, drive, t, h, kicks, drifts, now, work)
    leap(rows, drive, t, 0.5 * h, kicks, drifts, other, work)
    leap(rows, drive, t + 0.5 * h, 0.5 * h, kicks, drifts, other, work)
    error = 0.0
    for i in range(6):
        for r in range(rows.rods):
            error = max(error, abs(now.q[i, r] - other.q[i, r]))
    return error if error == error else np.inf


@bare
def pace(rows, v):
    """How fast the fastest rod turns or passes the others in its own lengths, rad/s, and the fastest node, m/s."""
    count, x, y, z = rows.rods, 0.0, 0.0, 0.0
    for r in range(count):
        x, y, z = x + v[0, r], y + v[1, r], z + v[2, r]
    x, y, z = x / count, y / count, z / count
    worst, drifting, turning = 0.0, 0.0, 0.0
    for r in range(count):
        passing = 0.25 * ((v[0, r] - x) ** 2 + (v[1, r] - y) ** 2 + (v[2, r] - z) ** 2)
        swing = v[3, r] ** 2 + v[4, r] ** 2 + v[5, r] ** 2
        worst = max(worst, rows.over[r] * max(passing, swing))
        drifting, turning = max(drifting, passing), max(turning, swing)
    return np.sqrt(worst), np.sqrt(drifting) + 0.5 * np.sqrt(turning)


@bare
def far(on, before, after, reach):
    """Whether every tendon is on its side, and farther than reach from its boundary, at both ends of a step."""
    for t in range(on.size):
        side = 2.0 * on[t] - 1.0
        if not min(side * before[t], side * after[t]) > reach:
            return False
    return True


@bare
def halvings(pace, rate):
    """Power of two by which a step made for a rate is shortened at a pace; in powers, so that it seldom changes."""
    shrink = 1.0
    while pace > shrink * rate and shrink < 1e9:
        shrink *= 2.0
    return shrink


@bare
def write(rows, q, v, out_q, out_v, k):
    """Keep a state as record k."""
    for r in range(rows.rods):
        for i in range(6):
            out_q[k, r, i], out_v[k, r, i] = q[i, r], v[i, r]


@bare
def march(rows, drive, times, step, limits, order, kicks, drifts, start, now, other, work, locate, stop, out_q, out_v):
    """Move `now` from times[0] to times[-1] and write the state at every later time.

    Without `stop`, a time within a step is reached by a step of its own from the same start, so recording does not
    change the motion, and what is recorded is as exact, as symplectic and as well conserved as the motion itself.

    Parameters
    ----------
    times : (m,) s
    step : float, s
        Longest step; the last before an edge is shortened with all that follow it.
    limits : (3,)
        Error of a step in m per second of its length, the rounding that is always allowed, m, and the rate, rad/s,
        that the step was made for: while rods turn or pass each other faster, it is halved as often as that takes.
    start, other : Moment
        Room to work in.
    locate : bool
        Whether to land on switches.
    stop : bool
        Whether steps end at every time.
    out_q, out_v : (m, nr, 6)

    Returns
    -------
    status, time reached, step, evaluations, switches
    """
    t, t_end, k = times[0], times[-1], 1
    stages = drifts.size
    refresh(rows, drive, t, now, work)
    for j in range(work.on.size):
        work.on[j] = 1.0 if now.gap[j] > 0.0 or not locate else 0.0
    springs(rows, work.rest, work.on, work.spring)
    refresh(rows, drive, t, now, work)
    evaluations, switches, since, stuck, rates_known = 2, 0, _PROBE, 0, False
    turning, speed = pace(rows, now.v)
    while t < t_end:
        goal = times[k] if stop else t_end
        shrink = halvings(turning, limits[2])
        count = max(1.0, np.ceil((goal - t) / step * shrink * (1 - 1e-12)))
        h = (goal - t) / count
        if since >= _PROBE and limits[0] < np.inf:
            error = probe(rows, drive, t, h, kicks, drifts, start, now, other, work)
            evaluations += 3 * stages
            bound = max(limits[0] * h, limits[1])
            if error > bound:
                copy_moment(start, now)
                step = shrink * h * max(0.2, 0.9 * (bound / error) ** (1.0 / order))
                if not t + step > t:
                    return _TOO_LONG, t, step, evaluations, switches
                continue
            since = 0
            if stop and t == times[0]:  # already there; at every probe, half steps would make energy wander
                copy_moment(other, now)
        else:
            copy_moment(now, start)
            leap(rows, drive, t, h, kicks, drifts, now, work)
            evaluations += stages
        taken, tendon, before = h, -1, speed
        turning, speed = pace(rows, now.v)
        if locate:
            rated = rates_known
            rates_known = drive.ramped or not far(work.on, start.gap, now.gap, _FAR * h * max(before, speed))
            if rates_known:
                if not rated:
                    rates_at(rows, drive, t, start, work)
                rates_at(rows, drive, t + h, now, work)
                left, _, _ = first_to_leave(work.on, work.rest, start.gap, start.rate, now.gap, now.rate, h)
                if left >= 0:
                    taken, tendon, tried = settle(rows, drive, t, h, kicks, drifts, start, now, work)
                    evaluations += stages * tried
                    turning, speed = pace(rows, now.v)
            stuck = stuck + 1 if taken < 1e-12 * step else 0
            if stuck > _STUCK:
                return _STUCK_STATUS, t, step, evaluations, switches
        since += 1
        reached = goal if count == 1.0 and taken == h else t + taken
        if np.isnan(now.q[0, 0]):
            return _LOST, t, step, evaluations, switches
        while k < times.size - 1 and times[k] < reached:
            copy_moment(start, other)
            leap(rows, drive, t, times[k] - t, kicks, drifts, other, work)
            evaluations += stages
            write(rows, other.q, other.v, out_q, out_v, k)
            k += 1
        if tendon >= 0:
            switches += change_over(rows, drive, reached, tendon, now, work)
            evaluations += 1
        if stop and k < times.size - 1 and reached == goal:
            write(rows, now.q, now.v, out_q, out_v, k)
            k += 1
        t = reached
    write(rows, now.q, now.v, out_q, out_v, k)
    return _DONE, t, step, evaluations, switches


@dataclass(eq=False)
class Splitting:
    """A splitting of one order for one structure.

    Attributes
    ----------
    dynamics : Dynamics
    order : 2, 4 or 6
    step : float, s
        Longest step.
    tol : float
        Error that a step may make, over the size of the structure and per second of the step; infinite: no probes.
    locate : bool
        Whether to land on slack-taut switches; without, a switch costs the step its order.
    rate : float, rad/s
        The rate that the step was made for; infinite: it is never halved for fast rods.
    stop : bool
        Whether steps end at every time to record, which is cheaper where times are as far apart as steps are long.
    """

    dynamics: Dynamics
    order: Order
    step: float
    tol: float = np.inf
    locate: bool = True
    rate: float = np.inf
    stop: bool = False
    evaluations: int = 0
    switches: int = 0
    _kept: tuple[Drive, tuple[Moment, Moment, Moment, Scratch]] | None = field(default=None, init=False, repr=False)

    @classmethod
    def fitted(
        cls, dynamics: Dynamics, order: Order, tol: float, rate: float, *, locate: bool = True, stop: bool = False
    ) -> Splitting:
        """The step that a tolerance asks for when no frequency is above `rate`, rad/s."""
        step = min(_REACH[order] * tol ** (1 / order), _LONGEST[order]) / rate
        return cls(dynamics, order, step, tol, locate, rate, stop)

    @cached_property
    def _rows(self) -> Rows:
        return rows_of(self.dynamics)

    @property
    def name(self) -> str:
        """Name of the method."""
        return f"splitting{self.order}"

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the motion cannot be followed.
        """
        rows, (start, now, other, work) = self._rows, self._room(drive)
        rows.filled(q, now.q)
        rows.filled(v, now.v)
        table = TABLES[self.order]
        status, t, step, evaluations, switches = march(
            rows, drive, times, self.step, self._limits, self.order, table.kicks, table.drifts,
            start, now, other, work, self.locate, self.stop, out_q, out_v,
        )  # fmt: skip
        self.evaluations += evaluations
        self.switches += switches
        if status != _DONE:
            raise SimulationError(_TROUBLE[status].format(t=t, step=step))
        q[:], v[:] = rows.taken(now.q), rows.taken(now.v)

    @cached_property
    def _limits(self) -> np.ndarray:
        size = float(np.ptp(self.dynamics.structure.nodes, axis=0).max())
        return np.array([self.tol * size, _ROUNDING * size, self.rate])

    def _room(self, drive: Drive) -> tuple[Moment, Moment, Moment, Scratch]:
        """Room to work in, kept for as long as the drive is the same."""
        if self._kept is None or self._kept[0] is not drive:
            start, now, other = (moment(self._rows) for _ in range(3))
            work = scratch(self._rows, self.dynamics.layout.anchor, drive, frozen=self.locate)
            self._kept = drive, (start, now, other, work)
        return self._kept[1]


_TROUBLE = {
    _STUCK_STATUS: "tendons go slack and taut without end at {t:g} s; use a smaller tol, or method = dopri5.",
    _TOO_LONG: "the step of the splitting fell to {step:.1e} s at {t:g} s without reaching tol; use a larger tol.",
    _LOST: "the motion was lost at {t:g} s: the step of {step:.1e} s is too long for it; use a smaller tol.",
}
