"""The way of a splitting through time, compiled: steps, probes of their length, landings on switches, records.

    t_(k+1) = t_k + h,   h = (goal - t)/n <= step/shrink

`shrink` halves steps while rods are fast. A probe compares one step with two halves and shortens what is too long.
While every tendon stays clear of its boundary the table for long steps is taken where it needs fewer forces; a long
step in which one comes near is taken back, and short ones follow, in which switches are found and landed on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare, inlined, part
from tensctl.model.kernel import springs
from tensctl.simulation.drive import drive_bend
from tensctl.simulation.integrators.conserved import alone, give_back, momenta_of
from tensctl.simulation.integrators.kept import opened
from tensctl.simulation.integrators.leap import Moment, begin, copy_moment, leap, rates_at, refresh
from tensctl.simulation.integrators.rows import fill, take
from tensctl.simulation.integrators.switching import change_over, first_to_leave, settle

DONE, STUCK, TOO_LONG, LOST = 0, 1, 2, 3
"""How a march ended."""

# Steps between two probes, and between two looks at the momenta.
_PROBE = 64
# Landings in a row shorter than 1e-12 of the step: more than this and the motion cannot be followed.
_LANDINGS = 1000
# A tendon is near its boundary within so many times what a gap can fall unseen between two stages. Stages are off the
# motion themselves, so that minima of oscillations are missed by up to 1.5 times what would be missed between them.
_FAR = 4.0
# Short steps after the last one in which a tendon came near its boundary.
_WARY = 16


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


@inlined
def probe(scene, t, h, start, now, other):
    """Distance in m of a step, taken from `start` to `now`, and two half steps, left in `other`."""
    copy_moment(start, other)
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
def within(closest, reach):
    """How many tendons came as near as reach to their boundary, or past it, at the stages of a step."""
    count = 0
    for t in range(closest.size):
        count += not closest[t] > reach
    return count


@bare
def unseen(speed, rate, time):
    """Most that a gap can fall, m, below its values at two ends of a time, and come back.

    Nodes pass each other at twice the speed of the fastest at most, half of the time each way; what swings no faster
    than a rate turns around more softly.
    """
    return speed * time * min(1.0, 0.25 * rate * time)


@bare
def halvings(pace, rate):
    """Power of two by which a step made for a rate is shortened at a pace; in powers, so that it seldom changes."""
    shrink = 1.0
    while pace > shrink * rate and shrink < 1e9:
        shrink *= 2.0
    return shrink


@part
def steps_to(span, longest):
    """How many equal steps, none longer than `longest`, a span takes."""
    return max(1.0, np.ceil(span / longest * (1 - 1e-12)))


@part
def write(rows, moment, q, v):
    """Write a moment as rod coordinates (nr, 6) and their rates."""
    take(rows, moment.q, q)
    take(rows, moment.v, v)


@bare
def march(brief, wide, journey, q, v, times, step, stride, order, locate, stop, out_q, out_v):
    """Move q and v in place from times[0] to times[-1] and write the state at every later time.

    Without `stop`, a time within a step is reached by a step of its own from the same start, so recording does not
    change the motion, and what is recorded is as exact, as symplectic and as well conserved as the motion itself.

    Parameters
    ----------
    brief, wide : Kept of Scene
        The scene with the table for short steps, and with that for long ones.
    journey : Kept of Journey
    q, v : (nr, 6)
    times : (m,) s
    step, stride : float, s
        Longest step with each table; the last before an edge is shortened with all that follow it.
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
    rows, kept, work, table = opened(brief)
    drive = opened(kept)
    t, t_end, k = times[0], times[-1], 1
    stages, more = table.drifts.size, opened(wide).table.drifts.size
    begin(brief)
    fill(rows, q, now.q)
    fill(rows, v, now.v)
    refresh(brief, t, now)
    for j in range(work.on.size):
        work.on[j] = 1.0 if now.gap[j] > 0.0 or not locate else 0.0
    springs(rows, work.rest, work.on, work.spring)
    refresh(brief, t, now)
    evaluations, switches, since, stuck, wary, rates_known = 2, 0, _PROBE, 0, 0, False
    turning, speed = pace(rows, now.v)
    free, steps = alone(rows, work.load) and not drive.swept, 0
    momenta = momenta_of(rows, now.q, now.v) if free else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    while t < t_end:
        goal = times[k] if stop else t_end
        shrink = halvings(turning, limits[2])
        count, fewer = steps_to(goal - t, step / shrink), steps_to(goal - t, stride / shrink)
        long = wary == 0 and fewer * more < count * stages
        scene, count = (wide, fewer) if long else (brief, count)
        cost, h = more if long else stages, (goal - t) / count
        copy_moment(now, start)
        leap(scene, t, h, now)
        evaluations += cost
        before, apart = speed, h * opened(scene).table.widest
        turning, speed = pace(rows, now.v)
        hidden = unseen(max(before, speed), max(limits[2], turning), apart) + drive_bend(drive, t, apart)
        near = within(work.closest, _FAR * hidden) > 0
        if long and near:
            copy_moment(start, now)
            turning, speed = pace(rows, now.v)
            wary, since = _WARY, _PROBE
            continue
        if since >= _PROBE and limits[0] < np.inf:
            error = probe(scene, t, h, start, now, other)
            evaluations += 2 * cost
            bound = max(limits[0] * h, limits[1])
            if error > bound:
                shorter = shrink * h * max(0.2, 0.9 * (bound / error) ** (1.0 / order))
                if not t + shorter > t:
                    return TOO_LONG, t, shorter, evaluations, switches
                step, stride = (step, shorter) if long else (shorter, stride)
                copy_moment(start, now)
                turning, speed = pace(rows, now.v)
                continue
            since = 0
            if stop and t == times[0]:  # already there; at every probe, half steps would make energy wander
                copy_moment(other, now)
                turning, speed = pace(rows, now.v)
        taken, tendon = h, -1
        wary = _WARY if near else max(0, wary - 1)
        if locate:
            if near:
                if not rates_known:
                    rates_at(scene, t, start)
                rates_at(scene, t + h, now)
                left, _, _ = first_to_leave(work.on, work.rest, start.gap, start.rate, now.gap, now.rate, h)
                if left >= 0:
                    taken, tendon, tried = settle(scene, t, h, start, now)
                    evaluations += cost * tried
                    turning, speed = pace(rows, now.v)
            rates_known = near
            stuck = stuck + 1 if taken < 1e-12 * step else 0
            if stuck > _LANDINGS:
                return STUCK, t, step, evaluations, switches
        since += 1
        steps += 1
        if free and steps % _PROBE == 0:
            give_back(rows, now.q, now.v, momenta)
        reached = goal if count == 1.0 and taken == h else t + taken
        if np.isnan(now.q[0]):
            return LOST, t, h, evaluations, switches
        while k < times.size - 1 and times[k] < reached:
            copy_moment(start, other)
            leap(scene, t, times[k] - t, other)
            write(rows, other, out_q[k], out_v[k])
            evaluations, k = evaluations + cost, k + 1
        if tendon >= 0:
            switches += change_over(scene, reached, tendon, now)
            evaluations += 1
        if stop and k < times.size - 1 and reached == goal:
            write(rows, now, out_q[k], out_v[k])
            k += 1
        t = reached
    write(rows, now, out_q[k], out_v[k])
    write(rows, now, q, v)
    return DONE, t, step, evaluations, switches
