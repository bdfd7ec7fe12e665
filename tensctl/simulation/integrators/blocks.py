"""The exact Jacobian of rods in their chart: blocks of 5 x 5 a pair of rods that share a tendon.

    A = s^2 M + s C + K,   M z'' = g(z, z'),   C = -dg/dz',   K = -dg/dz,   s = 1/(h gamma)

Tendon by tendon, with its ends' node maps P = (I, -+T)/2, direction e, tension T and relative velocity u of its ends:

    l_z = e'P,   C = c l_z' l_z,   K = l_z' (k l_z + (c/l) u'(I - e e')P + c e'P_t) + (T/l) (P'P - l_z' l_z)

P_t is the change of a node's velocity with z at fixed z': a rod that turns falls back along itself. K is not symmetric
where dampers act on ends that move.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import jit, part

_FREE, _TAIL, _HEAD, _FIXED = 0, 1, 2, 3


@part
def tendon_slopes(data, plan, frame, y, place, speed, rest, on, pull, turn, press):
    """Fill l_z (nt, 2, 5) by end, the row that K multiplies it with, and T/l (nt,), of tendons that are on."""
    one, two = np.uint64(1), np.uint64(2)
    half = y.size // 2
    for t in range(rest.size):
        if not on[t]:
            continue
        a, b = data.tail_at[t], data.head_at[t]
        ex, ey, ez = place[b] - place[a], place[b + one] - place[a + one], place[b + two] - place[a + two]
        u, v, w = speed[b] - speed[a], speed[b + one] - speed[a + one], speed[b + two] - speed[a + two]
        length = np.sqrt(ex * ex + ey * ey + ez * ez)
        ex, ey, ez = ex / length, ey / length, ez / length
        k, c = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t], data.damping[t]
        rate = ex * u + ey * v + ez * w
        over = (k * (length - rest[t]) + c * rate) / length
        press[t] = over
        lean = k - over - c * rate / length
        u, v, w = lean * ex + c * u / length, lean * ey + c * v / length, lean * ez + c * w / length
        for end in range(2):
            r = plan.rod[t, end]
            if r < 0:
                continue
            centre, lever, axes = plan.centre[t, end], plan.lever[t, end], frame[r]
            l_z, row = pull[t, end], turn[t, end]
            l_z[0], l_z[1], l_z[2] = centre * ex, centre * ey, centre * ez
            row[0], row[1], row[2] = centre * u, centre * v, centre * w
            back = c * (ex * axes[0, 0] + ey * axes[0, 1] + ez * axes[0, 2]) / data.lengths[r]
            for j in range(2):
                x, s, q = axes[1 + j, 0], axes[1 + j, 1], axes[1 + j, 2]
                l_z[3 + j] = lever * (ex * x + ey * s + ez * q)
                row[3 + j] = lever * (u * x + v * s + w * q - back * y[half + 5 * r + 3 + j])


@part
def rod_slopes(data, place, speed, force, own):
    """Fill what a rod has by itself in K on the diagonal of tau, (nr,): the force along it, and its spin."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        a, b = np.int64(data.rod_tail_at[r]), np.int64(data.rod_head_at[r])
        inertia = data.mass[r] / (12.0 if hold == _FREE else 3.0)
        total = 0.0
        for i in range(3):
            f = (force[b + i] if hold != _HEAD else 0.0) - (force[a + i] if hold != _TAIL else 0.0)
            f *= 0.5 if hold == _FREE else 1.0
            spin = speed[b + i] - speed[a + i]
            total += (place[b + i] - place[a + i]) * f + inertia * spin * spin
        own[r] = total / (data.lengths[r] * data.lengths[r])


@jit
def assemble(data, plan, frame, s, on, pull, turn, press, own, A):
    """Fill the blocks A (blocks, 5, 5) of s^2 M + s C + K."""
    flat = A.reshape(A.size)
    for k in range(flat.size):
        flat[k] = 0.0
    for r in range(data.mass.size):
        for i in range(5):
            A[r, i, i] = s * (s * plan.mass[5 * r + i] + plan.drag[5 * r + i])
        for i in range(3, 5):
            A[r, i, i] += own[r]
    row = np.empty(5)
    for t in range(on.size):
        if not on[t]:
            continue
        damper = s * data.damping[t]
        for to in range(2):
            for j in range(5):
                row[j] = turn[t, to, j] + damper * pull[t, to, j]
            for end in range(2):
                slot = plan.slots[t, end, to]
                if slot < 0:
                    continue
                block = A[slot]
                for i in range(5):
                    part_of = pull[t, end, i]
                    for j in range(5):
                        block[i, j] += part_of * row[j]
                here, there = frame[plan.rod[t, end]], frame[plan.rod[t, to]]
                middle, lever = press[t] * plan.centre[t, end], press[t] * plan.lever[t, end]
                middle_there, lever_there = plan.centre[t, to], plan.lever[t, to]
                for i in range(3):
                    block[i, i] += middle * middle_there
                    for j in range(2):
                        block[i, 3 + j] += middle * lever_there * there[1 + j, i]
                        block[3 + j, i] += lever * middle_there * here[1 + j, i]
                for i in range(2):
                    for j in range(2):
                        across = 0.0
                        for k in range(3):
                            across += here[1 + i, k] * there[1 + j, k]
                        block[3 + i, 3 + j] += lever * lever_there * across


@part
def add_damping(data, plan, on, pull, z, out):
    """Add C z to out, (5 nr,)."""
    for k in range(out.size):
        out[k] += plan.drag[k] * z[k]
    for t in range(on.size):
        if not on[t] or data.damping[t] == 0.0:
            continue
        rate = 0.0
        for end in range(2):
            r = 5 * plan.rod[t, end]
            if r >= 0:
                for j in range(5):
                    rate += pull[t, end, j] * z[r + j]
        rate *= data.damping[t]
        for end in range(2):
            r = 5 * plan.rod[t, end]
            if r >= 0:
                for j in range(5):
                    out[r + j] += rate * pull[t, end, j]
