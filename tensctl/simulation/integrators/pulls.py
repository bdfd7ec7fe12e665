"""Forces of all tendons in three sweeps: what each spans, what it pulls with, and what comes together at each rod end.

    s_t = p_head - p_tail,   f_t = k_t max(|s_t| - l0_t, least) s_t/|s_t|,   F_i = load_i + sum over t at i of -+ f_t

The second sweep has no index in it, so that square roots and divisions are taken four or eight at once; the third sums
at each rod end over the tendons that end there, instead of adding to two nodes a tendon, where each waits for the last.
Arrays that the second one writes are few: that none overlaps is looked at anew each time, which is felt at 24 tendons.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import part
from tensctl.model.kernel import NOTHING


@part
def tendon_forces(rows, place, rest, spring, least, load, span, force, gap):
    """External and spring forces on rod ends; gap = length - rest length, of which at least `least` counts.

    `least` is that of `cable_forces`. `span` is room for three numbers a tendon.
    """
    spans(rows, place, span)
    pulls(rest, spring, least, span, gap)
    sums(rows, load, span, force)


@part
def spans(rows, place, span):
    """From tail to head, x of all tendons, then y, then z."""
    n, one = np.uint64(rows.stiffness.size), np.uint64(rows.row)
    x, y, z, two = span, span[n:], span[n + n :], one + one
    for t in range(n):
        a, b = rows.tail_at[t], rows.head_at[t]
        x[t], y[t], z[t] = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]


@part
def pulls(rest, spring, least, span, gap):
    """Gaps, and instead of each span the force on the tendon's tail."""
    n = np.uint64(rest.size)
    x, y, z = span, span[n:], span[n + n :]
    for t in range(n):
        a, b, c = x[t], y[t], z[t]
        length = np.sqrt(a * a + b * b + c * c + NOTHING)
        over = length - rest[t]
        gap[t] = over
        pull = spring[t] * max(over, least) / length
        x[t], y[t], z[t] = pull * a, pull * b, pull * c


@part
def sums(rows, load, span, force):
    """What acts on each rod end: its load and the pulls of its tendons."""
    one, n = np.uint64(rows.row), np.uint64(rows.stiffness.size)
    two, k, step = one + one, np.uint64(0), np.uint64(1)
    x, y, z = span, span[n:], span[n + n :]
    for end in range(rows.ends.size):
        i, last = rows.ends[end], rows.last[end]
        a, b, c = load[i], load[i + one], load[i + two]
        while k < last:
            t, sign = rows.meeting[k], rows.side[k]
            a, b, c = a + sign * x[t], b + sign * y[t], c + sign * z[t]
            k += step
        force[i], force[i + one], force[i + two] = a, b, c
