"""Tendons that go slack or taut: found, located and stepped on, so that each step sees a smooth force.

    s = gap for a slack tendon, -gap for a taut one: a tendon is on its side while s <= band

After a step with frozen springs the tendons with s > band have left their side. The one that left first is followed by
safeguarded Newton steps on the step length, each a whole step from the same start, until s = 0; others that left
before it are taken in its place. Then it changes over, and with it every tendon within its band that moves outward, so
that a symmetric motion changes over as one. The band is 1e-9 of the rest length: a tendon that stays on the wrong side
of it costs an impulse of k band^2 / speed only, and rounding cannot make a tendon change over and back for ever.
"""

from __future__ import annotations

from tensctl.jit import bare, inlined
from tensctl.model.kernel import springs
from tensctl.simulation.integrators.kept import opened
from tensctl.simulation.integrators.leap import copy_moment, leap, rates_at, refresh

# Part of the rest length within which a tendon counts as on its boundary.
BAND = 1e-9
# Trials of one root: Newton takes two or three, pure bisection down to rounding 52.
_TRIALS = 60
# Times that an earlier switch is looked for within a step; each one is earlier than the last.
_EARLIER = 50


@bare
def cubic(y0, d0, y1, d1, x):
    """Value of the cubic with values y and slopes d at 0 and 1."""
    e = y1 - y0
    return y0 + x * (d0 + x * ((3.0 * e - 2.0 * d0 - d1) + x * (d0 + d1 - 2.0 * e)))


@bare
def crossing(y0, d0, y1, d1, level):
    """Where the cubic first reaches a level that it is below of at 0 and not below of at 1, by bisection to 1/1000."""
    low, high = 0.0, 1.0
    for _ in range(10):
        x = 0.5 * (low + high)
        if cubic(y0, d0, y1, d1, x) < level:
            low = x
        else:
            high = x
    return 0.5 * (low + high)


@bare
def peak(y0, d0, y1, d1):
    """Where the cubic has its maximum when it rises at 0 and falls at 1."""
    low, high = 0.0, 1.0
    for _ in range(10):
        x = 0.5 * (low + high)
        if cubic(y0, d0, y1, d1, x + 1e-3) > cubic(y0, d0, y1, d1, x - 1e-3):
            low = x
        else:
            high = x
    return 0.5 * (low + high)


@bare
def level_of(s, band):
    """The s at which a tendon changes over that stands at s now: its boundary, or a place further out in its band."""
    return 0.0 if s < 0.0 else 0.5 * (s + band)


@bare
def first_to_leave(on, rest, gap0, rate0, gap1, rate1, h):
    """The tendon that leaves its side first in a step, about when, and whether it is back by the end; -1 for none."""
    first, when, hidden = -1, h, False
    for t in range(on.size):
        side = 1.0 - 2.0 * on[t]
        band = BAND * rest[t]
        s0, s1 = side * gap0[t], side * gap1[t]
        d0, d1 = h * side * rate0[t], h * side * rate1[t]
        if s1 > band:
            at = h * crossing(s0, d0, s1, d1, level_of(s0, band))
            if first < 0 or at < when:
                first, when, hidden = t, at, False
        elif d0 > 0.0 and d1 < 0.0 and s0 + d0 > band:
            top = peak(s0, d0, s1, d1)
            if cubic(s0, d0, s1, d1, top) > band and (first < 0 or h * top < when):
                first, when, hidden = t, h * top, True
    return first, when, hidden


@inlined
def again(scene, t, h, start, now):
    """Take the step from the same start with another length."""
    copy_moment(start, now)
    leap(scene, t, h, now)
    rates_at(scene, t + h, now)


@inlined
def land_on(scene, t, tendon, longest, guess, start, now):
    """The step length at which a tendon reaches its boundary, the structure left there; and how many trials it took."""
    work = opened(scene).work
    side, band = 1.0 - 2.0 * work.on[tendon], BAND * work.rest[tendon]
    level = level_of(side * start.gap[tendon], band)
    low, high, h = 0.0, longest, guess
    trials = 0
    while trials < _TRIALS:
        again(scene, t, h, start, now)
        trials += 1
        miss, slope = side * now.gap[tendon] - level, side * now.rate[tendon]
        if abs(miss) <= 0.01 * band:
            break
        if miss < 0.0:
            low = h
        else:
            high = h
        h -= miss / slope if slope > 0.0 else 0.0
        if not low < h < high or trials % 8 == 0:
            h = 0.5 * (low + high)
        if not low < h < high:
            h = high
            again(scene, t, h, start, now)
            break
    return h, trials


@inlined
def change_over(scene, t, tendon, now):
    """Put a tendon, and all in their band that move outward, on their other side; how many there were."""
    rows, _, work, _ = opened(scene)
    count = 0
    for k in range(work.on.size):
        side, band = 1.0 - 2.0 * work.on[k], BAND * work.rest[k]
        s = side * now.gap[k]
        if k == tendon or s > band or (s >= -band and side * now.rate[k] > 0.0):
            work.on[k] = 1.0 - work.on[k]
            count += 1
    springs(rows, work.rest, work.on, work.spring)
    refresh(scene, t, now)
    return count


@inlined
def settle(scene, t, h, start, now):
    """Shorten a step that was just taken to its first switch; returns its length, the tendon or -1, and steps tried."""
    work = opened(scene).work
    tendon, tried = -1, 0
    for _ in range(_EARLIER):
        left, when, hidden = first_to_leave(work.on, work.rest, start.gap, start.rate, now.gap, now.rate, h)
        if left < 0:
            break
        if hidden:
            h, tendon = when, -1
            again(scene, t, h, start, now)
            tried += 1
        else:
            tendon = left
            h, trials = land_on(scene, t, tendon, h, when, start, now)
            tried += trials
    return h, tendon, tried
