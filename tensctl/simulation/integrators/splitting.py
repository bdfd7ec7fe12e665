"""Undamped motion: kicks between exact flights, with slack-taut switches located or, for many rods, passed over.

    v += b h a(q),   q flies for a h;   orders 2, 4 and 6

Symplectic, rod lengths and momenta to rounding. The step follows from the tolerance and a bound on the frequencies at
rest, and is halved while rods turn or pass faster than that; a probe at the start, after each switch of loads and
every 64 steps compares one step with two halves, and shortens it for motions that are faster than that bound (spinning
rods, far from rest). Splitting tables lose their order, and their negative sub-steps anti-damp, when kicks depend on
velocity: damped scenes are refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.errors import SimulationError
from tensctl.jit import jit
from tensctl.model import Dynamics
from tensctl.model.kernel import springs
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.leap import Moment, Scratch, copy_moment, leap, moment, rates_at, refresh, scratch
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
_LONGEST: dict[Order, float] = {2: 1.0, 4: 2.0, 6: 2.0}
# Rounding of a position over the size, below which no probe can see.
_ROUNDING = 4e-15
_DONE, _STUCK_STATUS, _TOO_LONG, _LOST = 0, 1, 2, 3


@jit
def probe(data, drive, t, h, kicks, drifts, start, now, other, work):
    """Distance in m of one step and two half steps from the same start; `now` ends where it was."""
    copy_moment(now, start)
    leap(data, drive, t, h, kicks, drifts, now, work)
    copy_moment(start, other)
    refresh(data, drive, t, other, work)
    leap(data, drive, t, 0.5 * h, kicks, drifts, other, work)
    leap(data, drive, t + 0.5 * h, 0.5 * h, kicks, drifts, other, work)
    error = 0.0
    for r in range(now.q.shape[0]):
        for i in range(6):
            error = max(error, abs(now.q[r, i] - other.q[r, i]))
    copy_moment(start, now)
    refresh(data, drive, t, now, work)
    return error if error == error else np.inf


@jit
def pace(lengths, v):
    """How fast the fastest rod turns, or moves past the others in its own lengths, rad/s."""
    x, y, z, worst = 0.0, 0.0, 0.0, 0.0
    for r in range(lengths.size):
        x, y, z = x + v[r, 0], y + v[r, 1], z + v[r, 2]
    x, y, z = x / lengths.size, y / lengths.size, z / lengths.size
    for r in range(lengths.size):
        drift = 0.25 * ((v[r, 0] - x) ** 2 + (v[r, 1] - y) ** 2 + (v[r, 2] - z) ** 2)
        worst = max(worst, max(drift, v[r, 3] ** 2 + v[r, 4] ** 2 + v[r, 5] ** 2) / lengths[r] ** 2)
    return np.sqrt(worst)


@jit
def halvings(pace, rate):
    """Power of two by which a step made for a rate is shortened at a pace; in powers, so that it seldom changes."""
    shrink = 1.0
    while pace > shrink * rate and shrink < 1e9:
        shrink *= 2.0
    return shrink


@jit
def write(q, v, out_q, out_v, k):
    """Keep a state as record k."""
    for r in range(q.shape[0]):
        for i in range(6):
            out_q[k, r, i], out_v[k, r, i] = q[r, i], v[r, i]


@jit
def march(data, drive, times, step, limits, order, kicks, drifts, start, now, other, work, locate, out_q, out_v):
    """Move `now` from times[0] to times[-1] and write the state at every later time.

    A time within a step is reached by a step of its own from the same start, so recording does not change the motion,
    and what is recorded is as exact, as symplectic and as well conserved as the motion itself.

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
    out_q, out_v : (m, nr, 6)

    Returns
    -------
    status, time reached, step, evaluations, switches
    """
    t, t_end, k = times[0], times[-1], 1
    stages = drifts.size
    refresh(data, drive, t, now, work)
    for j in range(work.on.size):
        work.on[j] = 1.0 if now.gap[j] > 0.0 or not locate else 0.0
    springs(data, work.rest, work.on, work.spring)
    refresh(data, drive, t, now, work)
    if locate:
        rates_at(data, drive, t, now, work)
    evaluations, switches, since, stuck = 2, 0, _PROBE, 0
    while t < t_end:
        shrink = halvings(pace(data.lengths, now.v), limits[2])
        count = max(1.0, np.ceil((t_end - t) / step * shrink * (1 - 1e-12)))
        h = (t_end - t) / count
        if since >= _PROBE:
            error = probe(data, drive, t, h, kicks, drifts, start, now, other, work)
            evaluations += 3 * stages + 2
            bound = max(limits[0] * h, limits[1])
            if error > bound:
                step = shrink * h * max(0.2, 0.9 * (bound / error) ** (1.0 / order))
                if not t + step > t:
                    return _TOO_LONG, t, step, evaluations, switches
                continue
            since = 0
        copy_moment(now, start)
        leap(data, drive, t, h, kicks, drifts, now, work)
        evaluations += stages
        taken, tendon = h, -1
        if locate:
            rates_at(data, drive, t + h, now, work)
            left, _, _ = first_to_leave(work.on, work.rest, start.gap, start.rate, now.gap, now.rate, h)
            if left >= 0:
                taken, tendon, tried = settle(data, drive, t, h, kicks, drifts, start, now, work)
                evaluations += stages * tried
            stuck = stuck + 1 if taken < 1e-12 * step else 0
            if stuck > _STUCK:
                return _STUCK_STATUS, t, step, evaluations, switches
        since += 1
        reached = t_end if count == 1.0 and taken == h else t + taken
        if np.isnan(now.q[0, 0]):
            return _LOST, t, step, evaluations, switches
        while k < times.size - 1 and times[k] < reached:
            copy_moment(start, other)
            leap(data, drive, t, times[k] - t, kicks, drifts, other, work)
            evaluations += stages
            write(other.q, other.v, out_q, out_v, k)
            k += 1
        if tendon >= 0:
            switches += change_over(data, drive, reached, tendon, now, work)
            evaluations += 1
        t = reached
    write(now.q, now.v, out_q, out_v, k)
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
    """

    dynamics: Dynamics
    order: Order
    step: float
    tol: float = np.inf
    locate: bool = True
    rate: float = np.inf
    evaluations: int = 0
    switches: int = 0

    @classmethod
    def fitted(cls, dynamics: Dynamics, order: Order, tol: float, rate: float, *, locate: bool = True) -> Splitting:
        """The step that a tolerance asks for when no frequency is above `rate`, rad/s."""
        return cls(dynamics, order, min(_REACH[order] * tol ** (1 / order), _LONGEST[order]) / rate, tol, locate, rate)

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
        start, now, other, work = self._room(drive)
        now.q[:], now.v[:] = q, v
        size = float(np.ptp(self.dynamics.structure.nodes, axis=0).max())
        limits = np.array([self.tol * size, _ROUNDING * size, self.rate])
        table = TABLES[self.order]
        status, t, step, evaluations, switches = march(
            self.dynamics.kernel, drive, times, self.step, limits, self.order, table.kicks, table.drifts,
            start, now, other, work, self.locate, out_q, out_v,
        )  # fmt: skip
        self.evaluations += evaluations
        self.switches += switches
        if status != _DONE:
            raise SimulationError(_TROUBLE[status].format(t=t, step=step))
        q[:], v[:] = now.q, now.v

    def _room(self, drive: Drive) -> tuple[Moment, Moment, Moment, Scratch]:
        rods, tendons = len(self.dynamics.structure.rods), len(self.dynamics.structure.tendons)
        start, now, other = (moment(rods, tendons) for _ in range(3))
        work = scratch(self.dynamics.structure.nodes, drive.rest, drive.force, frozen=self.locate)
        return start, now, other, work


_TROUBLE = {
    _STUCK_STATUS: "tendons go slack and taut without end at {t:g} s; use a smaller tol, or method = dopri5.",
    _TOO_LONG: "the step of the splitting fell to {step:.1e} s at {t:g} s without reaching tol; use a larger tol.",
    _LOST: "the motion was lost at {t:g} s: the step of {step:.1e} s is too long for it; use a smaller tol.",
}
