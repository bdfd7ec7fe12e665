"""Forces of tendons whose springs and dampers are frozen on or off within a step.

    T = k (l - L) + c dl/dt while on, nothing while off

Frozen forces are smooth, so a step with them has its full order; `sides` tells when a tendon should have changed over.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import part
from tensctl.model.kernel import tug


@part
def sides(data, place, speed, rest, decay, span, side):
    """How far each tendon is on its pulling side, m: l - L, and for a clamped damper not more than T/k.

    Inside a step of length `span`, speeds are known too roughly for a damper that decays faster: its tendon is then on
    neither side while it is longer than at rest.
    """
    one, two = np.uint64(1), np.uint64(2)
    for t in range(rest.size):
        a, b = data.tail_at[t], data.head_at[t]
        x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        length = np.sqrt(x * x + y * y + z * z)
        gap, c = length - rest[t], data.damping[t]
        if data.clamped and c > 0.0 and length > 0.0:
            if span * decay[t] >= 1.0:
                side[t] = min(gap, 0.0)
                continue
            u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
            k = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t]
            tension = k * gap + c * (x * u + y * v + z * w) / length
            gap = min(gap, tension / k)
        side[t] = gap


@part
def freeze(side, margin, on):
    """Change over those tendons that are on the wrong side by more than a margin; how many."""
    changed = 0
    for t in range(side.size):
        if (-side[t] if on[t] else side[t]) > margin:
            on[t] = not on[t]
            changed += 1
    return changed


@part
def worst_side(side, on):
    """How far the worst tendon is on the side where it is not frozen, m; below zero while none is."""
    worst = -np.inf
    for t in range(side.size):
        worst = max(worst, -side[t] if on[t] else side[t])
    return worst


@part
def frozen_forces(data, place, speed, rest, on, load, force):
    """External, tendon, damper and drag forces on each node; True when a tendon should have changed over."""
    one, two = np.uint64(1), np.uint64(2)
    crossed = False
    for i in range(force.size):
        force[i] = load[i] - data.drag * speed[i]
    for t in range(rest.size):
        a, b = data.tail_at[t], data.head_at[t]
        x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        square = x * x + y * y + z * z
        if not on[t] and square <= rest[t] * rest[t]:
            continue
        u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
        k, c = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t], data.damping[t]
        spring = k * (1.0 - rest[t] / np.sqrt(square))
        pull = spring + c * (x * u + y * v + z * w) / square
        pulls = spring > 0.0 and (pull > 0.0 or c == 0.0 or not data.clamped)
        crossed = crossed or pulls != on[t]
        if on[t]:
            tug(data, force, a, b, pull * x, pull * y, pull * z)
    return crossed


@part
def force_rates(data, place, rest, rest_rate, on, load_rate, force):
    """Derivative of nodal forces by time alone: loads and rest lengths that change."""
    one, two = np.uint64(1), np.uint64(2)
    for i in range(force.size):
        force[i] = load_rate[i]
    for t in range(rest.size):
        if not on[t] or rest_rate[t] == 0.0:
            continue
        a, b = data.tail_at[t], data.head_at[t]
        x, y, z = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        length = np.sqrt(x * x + y * y + z * z)
        slope = -data.stiffness[t] / length
        if data.by_strain:
            slope *= length / (rest[t] * rest[t])
        pull = slope * rest_rate[t]
        tug(data, force, a, b, pull * x, pull * y, pull * z)
