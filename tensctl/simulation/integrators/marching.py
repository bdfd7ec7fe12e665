"""The way of a splitting through time, compiled: steps, probes of their length, landings on switches, records.

    t_(k+1) = t_k + h,   h = (goal - t)/n <= step/shrink

`shrink` halves steps while rods are fast. A probe compares one step with two halves and shortens what is too long.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare
from tensctl.model.kernel import springs
from tensctl.simulation.integrators.kept import opened
from tensctl.simulation.integrators.leap import Moment, copy_moment, leap, rates_at, refresh
from tensctl.simulation.integrators.rows import fill, take
from tensctl.simulation.integrators.switching import change_over, first_to_leave, settle

DONE, STUCK, TOO_LONG, LOST = 0, 1, 2, 3
"""How a march ended."""

# Steps between two probes.
_PROBE = 64
# Landings in a row shorter than 1e-12 of the step: more than this and the motion cannot be followed.
_LANDINGS = 1000
# Nodes pass each other at twice the speed of the fastest at most, so a gap that is left and taken again within a step
# is nowhere wider than the speed times its length; four times that covers speeds that rise and fall within the step.
_FAR = 4.0


class Journey(NamedTuple):
    """Room for the moments that a march goes through, whatever drives it, and what it is held to.

    Attributes
    ----------
    start, now, other : Moment
    limits : (3,)
        Error of a step in m per second of its length, the rounding that is always allowed, m, and the rate, rad/s,
        that the step was made for: while rods turn or pass each other faster, it is halved as often as that takes.
    """

    start: Moment
    now: Moment
    other: Moment
    limits: np.ndarray


@bare
def probe(scene, t, h, start, now, other):
    """Distance in m of one step, left in `now`, and two half steps, left in `other`, from what is kept in `start`."""
    copy_moment(now, start)
    copy_moment(now, other)
    leap(scene, t, h, now)
    leap(scene, t, 0.5 * h, other)
    leap(scene, t + 0.5 * h, 0.5 * h, other)
    error = 0.0
    for i in range(now.q.size):
        error = max(error, abs(now.q[i] - other.q[i]))
    return error if error == error else np.inf


@bare
def pace(rows, v):
    """How fast the fastest rod turns or passes the others in its own lengths, rad/s, and the fastest node, m/s."""
    n, count, x, y, z = rows.row, rows.rods, 0.0, 0.0, 0.0
    for r in range(count):
        x, y, z = x + v[r], y + v[n + r], z + v[2 * n + r]
    x, y, z = x / count, y / count, z / count
    worst, drifting, turning = 0.0, 0.0, 0.0
    for r in range(count):
        passing = 0.25 * ((v[r] - x) ** 2 + (v[n + r] - y) ** 2 + (v[2 * n + r] - z) ** 2)
        swing = v[3 * n + r] ** 2 + v[4 * n + r] ** 2 + v[5 * n + r] ** 2
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
def march(scene, journey, q, v, times, step, order, locate, stop, out_q, out_v):
    """Move q and v in place from times[0] to times[-1] and write the state at every later time.

    Without `stop`, a time within a step is reached by a step of its own from the same start, so recording does not
    change the motion, and what is recorded is as exact, as symplectic and as well conserved as the motion itself.

    Parameters
    ----------
    scene : Kept of Scene
    journey : Kept of Journey
    q, v : (nr, 6)
    times : (m,) s
    step : float, s
        Longest step; the last before an edge is shortened with all that follow it.
    order : int
    locate : bool
        Whether to land on switches.
    stop : bool
        Whether steps end at every time.
    out_q, out_v : (m, nr, 6)

    Returns
    -------
    status, time reached, step, evaluations, switches
    """
    start, now, other, limits = opened(journey)
    rows, drive, work, table = opened(scene)
    t, t_end, k = times[0], times[-1], 1
    stages = table.drifts.size
    fill(rows, q, now.q)
    fill(rows, v, now.v)
    refresh(scene, t, now)
    for j in range(work.on.size):
        work.on[j] = 1.0 if now.gap[j] > 0.0 or not locate else 0.0
    springs(rows, work.rest, work.on, work.spring)
    refresh(scene, t, now)
    evaluations, switches, since, stuck, rates_known = 2, 0, _PROBE, 0, False
    turning, speed = pace(rows, now.v)
    while t < t_end:
        goal = times[k] if stop else t_end
        shrink = halvings(turning, limits[2])
        count = max(1.0, np.ceil((goal - t) / step * shrink * (1 - 1e-12)))
        h = (goal - t) / count
        if since >= _PROBE and limits[0] < np.inf:
            error = probe(scene, t, h, start, now, other)
            evaluations += 3 * stages
            bound = max(limits[0] * h, limits[1])
            if error > bound:
                copy_moment(start, now)
                step = shrink * h * max(0.2, 0.9 * (bound / error) ** (1.0 / order))
                if not t + step > t:
                    return TOO_LONG, t, step, evaluations, switches
                continue
            since = 0
            if stop and t == times[0]:  # already there; at every probe, half steps would make energy wander
                copy_moment(other, now)
        else:
            copy_moment(now, start)
            leap(scene, t, h, now)
            evaluations += stages
        taken, tendon, before = h, -1, speed
        turning, speed = pace(rows, now.v)
        if locate:
            rated = rates_known
            rates_known = drive.ramped or not far(work.on, start.gap, now.gap, _FAR * h * max(before, speed))
            if rates_known:
                if not rated:
                    rates_at(scene, t, start)
                rates_at(scene, t + h, now)
                left, _, _ = first_to_leave(work.on, work.rest, start.gap, start.rate, now.gap, now.rate, h)
                if left >= 0:
                    taken, tendon, tried = settle(scene, t, h, start, now)
                    evaluations += stages * tried
                    turning, speed = pace(rows, now.v)
            stuck = stuck + 1 if taken < 1e-12 * step else 0
            if stuck > _LANDINGS:
                return STUCK, t, step, evaluations, switches
        since += 1
        reached = goal if count == 1.0 and taken == h else t + taken
        if np.isnan(now.q[0]):
            return LOST, t, step, evaluations, switches
        while k < times.size - 1 and times[k] < reached:
            copy_moment(start, other)
            leap(scene, t, times[k] - t, other)
            take(rows, other.q, out_q[k])
            take(rows, other.v, out_v[k])
            evaluations, k = evaluations + stages, k + 1
        if tendon >= 0:
            switches += change_over(scene, reached, tendon, now)
            evaluations += 1
        if stop and k < times.size - 1 and reached == goal:
            take(rows, now.q, out_q[k])
            take(rows, now.v, out_v[k])
            k += 1
        t = reached
    take(rows, now.q, out_q[k])
    take(rows, now.v, out_v[k])
    take(rows, now.q, q)
    take(rows, now.v, v)
    return DONE, t, step, evaluations, switches
