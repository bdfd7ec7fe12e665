"""Compiled kernels on pairs of straight members: their distance, and the moments at which they pass through each other.

Broad phase: members of the second kind are sorted along the axis on which the structure is longest, and distances are
computed only of pairs whose boxes overlap when grown by what is looked for: the least distance so far, what counts as
close, or what the members move until the next record. No array over pairs is made.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare, jit

# Pieces into which the interval between two records is cut when a passing is looked for.
_PIECES = 4
# Halvings of a piece: the moment of a passing to 1e-9 of the interval between records, finer than the cubic's error.
_HALVINGS = 30
# A triple product below this, over the product of lengths that it is made of, is rounding: members in one plane.
_ROUNDING = 1e-14
# Members meet when their distance at the moment of coplanarity is below this, over their lengths; it is 1e-9 or so
# where they do, and as large as the gap where their lines meet beyond an end.
_MET = 1e-6


class Pairs(NamedTuple):
    """Members of two kinds, or of one kind twice: nodes, radius (m) and what counts as close (m) of each member."""

    ends_a: np.ndarray
    radius_a: np.ndarray
    near_a: np.ndarray
    ends_b: np.ndarray
    radius_b: np.ndarray
    near_b: np.ndarray
    same: bool


class Found(NamedTuple):
    """Room for what is found: time index, pair and distance of what is close; pair and moment of what passes."""

    when: np.ndarray
    close: np.ndarray
    gap: np.ndarray
    passed: np.ndarray
    moment: np.ndarray


@bare
def _clip(x):
    return min(max(x, 0.0), 1.0)


@bare
def nearest(a, u, b, v):
    """Parameters s, t in [0, 1] of the nearest points of a + s u and b + t v, and their distance.

    The segments' distance is a convex function of (s, t): its minimum over the square is the inner stationary point or
    lies on one of the four edges, whose minima are projections. All are tried, so that nearly parallel members lose
    nothing to the division by |u x v|^2.
    """
    uu, uv, vv, uw, vw = 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        w = a[k] - b[k]
        uu += u[k] * u[k]
        uv += u[k] * v[k]
        vv += v[k] * v[k]
        uw += u[k] * w
        vw += v[k] * w
    best, best_s, best_t = np.inf, 0.0, 0.0
    determinant = uu * vv - uv * uv
    for trial in range(5):
        if trial == 0:
            if not determinant > 0:
                continue
            s = (uv * vw - vv * uw) / determinant
            if not 0 <= s <= 1:
                continue
            t = _clip((vw + s * uv) / vv)
        elif trial <= 2:
            s = trial - 1.0
            t = _clip((vw + s * uv) / vv) if vv > 0 else 0.0
        else:
            t = trial - 3.0
            s = _clip((t * uv - uw) / uu) if uu > 0 else 0.0
        square = 0.0
        for k in range(3):
            gap = a[k] - b[k] + s * u[k] - t * v[k]
            square += gap * gap
        if square < best:
            best, best_s, best_t = square, s, t
    return best_s, best_t, np.sqrt(best)


@bare
def _boxes(nodes, ends, radius, low, high):
    """Fill the corners of the box about each member, grown by its radius."""
    for m in range(ends.shape[0]):
        for k in range(3):
            x, y = nodes[ends[m, 0], k], nodes[ends[m, 1], k]
            low[m, k] = min(x, y) - radius[m]
            high[m, k] = max(x, y) + radius[m]


@bare
def _moves(motion, k, ends, moves):
    """Fill a bound of how far any point of each member gets from where it is within interval k, m."""
    time, nodes, velocities = motion
    for m in range(ends.shape[0]):
        moves[m] = 0.0
        for side in range(2 if k + 1 < time.size else 0):
            h, node, step, bulge = time[k + 1] - time[k], ends[m, side], 0.0, 0.0
            for i in range(3):
                change = nodes[k + 1, node, i] - nodes[k, node, i]
                step += change**2
                bulge += abs(h * velocities[k, node, i] - change) + abs(h * velocities[k + 1, node, i] - change)
            # 4/27 is the largest value of r^2 (1 - r): how far the cubic leaves its chord.
            moves[m] = max(moves[m], np.sqrt(step) + 4.0 / 27.0 * bulge)


@bare
def _longest_axis(nodes):
    axis, longest = 0, -1.0
    for k in range(3):
        low, high = nodes[0, k], nodes[0, k]
        for n in range(1, nodes.shape[0]):
            low, high = min(low, nodes[n, k]), max(high, nodes[n, k])
        if high - low > longest:
            axis, longest = k, high - low
    return axis


@bare
def _largest(x):
    """Largest of numbers of which none is below zero; zero of none."""
    largest = 0.0
    for i in range(x.size):
        largest = max(largest, x[i])
    return largest


@bare
def _length(x):
    return np.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@bare
def _apart(low_a, high_a, low_b, high_b, i, j, reach):
    """Whether two boxes are farther apart than reach on some axis."""
    far = False
    for k in range(3):
        far = far or low_b[j, k] - high_a[i, k] > reach or low_a[i, k] - high_b[j, k] > reach
    return far


@bare
def _joined(ends_a, ends_b, i, j):
    """Whether two members share a node."""
    c, d = ends_b[j, 0], ends_b[j, 1]
    return ends_a[i, 0] in (c, d) or ends_a[i, 1] in (c, d)


@bare
def _distance(nodes, ends_a, ends_b, i, j, work):
    """Distance of two members' centre lines, m."""
    for k in range(3):
        work[0, k], work[2, k] = nodes[ends_a[i, 0], k], nodes[ends_b[j, 0], k]
        work[1, k] = nodes[ends_a[i, 1], k] - work[0, k]
        work[3, k] = nodes[ends_b[j, 1], k] - work[2, k]
    return nearest(work[0], work[1], work[2], work[3])[2]


@bare
def _between(motion, k, share, node, place):
    """Fill the place of a node within interval k: the cubic with both ends' positions and velocities."""
    time, nodes, velocities = motion
    h, r = time[k + 1] - time[k], 1.0 - share
    for i in range(3):
        p, q = nodes[k, node, i], nodes[k + 1, node, i]
        step = q - p
        bulge = share * r * (r * (h * velocities[k, node, i] - step) - share * (h * velocities[k + 1, node, i] - step))
        place[i] = p + share * step + bulge


@bare
def _triple(motion, k, pairs, i, j, share, work):
    """(u x v) . (b - a) within interval k, 0 where it is rounding; a, u, b, v are left in work."""
    for side in range(2):
        _between(motion, k, share, pairs.ends_a[i, side], work[side])
        _between(motion, k, share, pairs.ends_b[j, side], work[2 + side])
    uu, vv, ww = 0.0, 0.0, 0.0
    for m in range(3):
        work[1, m] -= work[0, m]
        work[3, m] -= work[2, m]
        uu += work[1, m] ** 2
        vv += work[3, m] ** 2
        ww += (work[2, m] - work[0, m]) ** 2
    value = 0.0
    for m in range(3):
        n, o = (m + 1) % 3, (m + 2) % 3
        value += (work[1, n] * work[3, o] - work[1, o] * work[3, n]) * (work[2, m] - work[0, m])
    noise = _ROUNDING * np.sqrt(uu * vv) * (np.sqrt(uu) + np.sqrt(vv) + np.sqrt(ww))
    return value if abs(value) > noise else 0.0


@bare
def _meeting(motion, k, pairs, i, j, low, high, below, work):
    """Share of interval k at which two members pass, found by halving (low, high); negative where they miss."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if (_triple(motion, k, pairs, i, j, middle, work) < 0) == below:
            low = middle
        else:
            high = middle
    _triple(motion, k, pairs, i, j, high, work)
    # Where the lines meet beyond an end, or are parallel, the nearest points stay apart.
    size = _length(work[1]) + _length(work[3])
    return high if nearest(work[0], work[1], work[2], work[3])[2] <= _MET * size else -1.0


@bare
def _passings(motion, k, pairs, i, j, count, found, work):
    """List the moments within interval k at which two members pass; returns how many there are in all."""
    time = motion[0]
    low, before = 0.0, _triple(motion, k, pairs, i, j, 0.0, work)
    for piece in range(1, _PIECES + 1):
        high = piece / _PIECES
        after = _triple(motion, k, pairs, i, j, high, work)
        if after == 0:
            continue
        if before * after < 0:
            share = _meeting(motion, k, pairs, i, j, low, high, before < 0, work)
            if share >= 0:
                if count < found.moment.size:
                    found.passed[count, 0], found.passed[count, 1] = i, j
                    found.moment[count] = time[k] + share * (time[k + 1] - time[k])
                count += 1
        low, before = high, after
    return count


@jit
def watch(time, nodes, velocities, pairs, distance, pair, found):
    """Fill the least distance and its pair at each time; list every pair that is close and every passing.

    Returns how many of either there are; those beyond the room in `found` are counted only.
    """
    ends_a, ends_b, motion = pairs.ends_a, pairs.ends_b, (time, nodes, velocities)
    na, nb, close, passed = ends_a.shape[0], ends_b.shape[0], 0, 0
    low_a, high_a, moves_a = np.empty((na, 3)), np.empty((na, 3)), np.empty(na)
    low_b, high_b, moves_b = np.empty((nb, 3)), np.empty((nb, 3)), np.empty(nb)
    lower, extent = np.empty(nb), np.empty(nb)
    work = np.empty((4, 3))
    widest = max(_largest(pairs.near_a), _largest(pairs.near_b))
    best_i, best_j = -1, -1
    for k in range(time.size):
        axis = _longest_axis(nodes[k])
        _boxes(nodes[k], ends_a, pairs.radius_a, low_a, high_a)
        _boxes(nodes[k], ends_b, pairs.radius_b, low_b, high_b)
        _moves(motion, k, ends_a, moves_a)
        _moves(motion, k, ends_b, moves_b)
        fastest = _largest(moves_b)
        for j in range(nb):
            lower[j], extent[j] = low_b[j, axis], high_b[j, axis] - low_b[j, axis]
        order, size = np.argsort(lower), _largest(extent)
        for place in range(nb):
            lower[place] = low_b[order[place], axis]
        best = np.inf
        if best_i >= 0:  # the pair of the time before bounds the search from the start
            best = _distance(nodes[k], ends_a, ends_b, best_i, best_j, work)
            best -= pairs.radius_a[best_i] + pairs.radius_b[best_j]
        for i in range(na):
            reach = max(best, widest, moves_a[i] + fastest)
            place = np.searchsorted(lower, low_a[i, axis] - size - reach)
            while place < nb and lower[place] <= high_a[i, axis] + reach:
                j = order[place]
                place += 1
                if pairs.same and j <= i:
                    continue
                if _apart(low_a, high_a, low_b, high_b, i, j, reach) or _joined(ends_a, ends_b, i, j):
                    continue
                centre = _distance(nodes[k], ends_a, ends_b, i, j, work)
                surface = centre - pairs.radius_a[i] - pairs.radius_b[j]
                if surface < best:
                    best, best_i, best_j = surface, i, j
                    reach = max(best, widest, moves_a[i] + fastest)
                if surface <= max(pairs.near_a[i], pairs.near_b[j]):
                    if close < found.when.size:
                        found.when[close], found.gap[close] = k, surface
                        found.close[close, 0], found.close[close, 1] = i, j
                    close += 1
                if k + 1 < time.size and centre <= moves_a[i] + moves_b[j]:
                    passed = _passings(motion, k, pairs, i, j, passed, found, work)
        distance[k], pair[k, 0], pair[k, 1] = best, best_i, best_j
    return close, passed
