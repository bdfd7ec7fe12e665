"""Undamped motion: kicks by the forces between exact flights of the rods, composed to order 4.

    kick    v += b h a(q)          flight   q1 += h a v1,  q2 turns on its great circle

Blanes and Moan's Runge-Kutta-Nystrom splitting of 6 stages (J. Comput. Appl. Math. 142, 2002, SRKN6b): symplectic, one
force evaluation a stage, rod lengths and momenta to rounding. Rest lengths may ramp: time flies along with the rods.

A tendon that goes slack or taut bends the force, which cuts any fixed step to order 2. A step in which one does is
therefore taken again in halves, down to h / 2^depth, and lengthened again behind the switch.
"""

from __future__ import annotations

import numpy as np

from tensctl.jit import jit
from tensctl.model.kernel import elastic_forces, place_nodes, pushes, tidy

KICKS = np.array([0.0829844064174052, 0.396309801498368, -0.0390563049223486, 0.0])
DRIFTS = np.array([0.245298957184271, 0.604872665711080, 0.0])
KICKS[3] = 1 - 2 * KICKS[:3].sum()
DRIFTS[2] = 0.5 - DRIFTS[:2].sum()
KICKS = np.concatenate([KICKS, KICKS[2::-1]])
DRIFTS = np.concatenate([DRIFTS, DRIFTS[::-1]])


@jit
def _fly(data, q, v, h):
    """Exact motion of free rods: centres straight, directions on great circles."""
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == 3:
            continue
        x, y, z = q[r, 3], q[r, 4], q[r, 5]
        u, s, w = v[r, 3], v[r, 4], v[r, 5]
        length = data.lengths[r]
        spin = np.sqrt(u * u + s * s + w * w) / length
        angle = spin * h
        cosine = np.cos(angle)
        over = np.sin(angle) / spin if spin > 0.0 else h
        fall = -spin * np.sin(angle)
        q[r, 3], q[r, 4], q[r, 5] = cosine * x + over * u, cosine * y + over * s, cosine * z + over * w
        v[r, 3], v[r, 4], v[r, 5] = cosine * u + fall * x, cosine * s + fall * y, cosine * w + fall * z
        if hold == 0:
            for i in range(3):
                q[r, i] += h * v[r, i]
        else:
            sign = 1.0 if hold == 1 else -1.0
            held = data.rod_tail[r] if hold == 1 else data.rod_head[r]
            for i in range(3):
                q[r, i] = 2.0 * data.anchor[held, i] + sign * q[r, 3 + i]
                v[r, i] = sign * v[r, 3 + i]


@jit
def _kick(data, v, push, h):
    for r in range(data.mass.size):
        if data.hold[r] != 3:
            for i in range(6):
                v[r, i] += h * push[r, i]


@jit
def _forces_at(data, q, t, t0, rest, rest0, rate, ramped, external, nodes, forces, push, taut):
    """Push of every rod at time t; returns how many tendons changed between slack and taut."""
    if ramped:
        for k in range(rest.size):
            rest[k] = rest0[k] + (t - t0) * rate[k]
    place_nodes(data, q, nodes)
    flips = elastic_forces(data, nodes, rest, external, forces, taut)
    pushes(data, q, forces, push)
    return flips


@jit
def advance(data, q, v, t0, t1, steps, rest0, rate, external, kicks, drifts, depth):
    """Move q and v from t0 to t1 in `steps` equal steps; returns force evaluations and switches.

    Parameters
    ----------
    data : KernelData
    q, v : (nr, 6), changed in place
    rest0, rate : (nt,) m, m/s
        Rest lengths at t0 and how they ramp.
    external : (N, 3) N
    depth : int
        A step with a switch is halved down to h / 2^depth.
    """
    nodes, forces = data.anchor.copy(), np.zeros_like(external)
    push, rest = np.zeros_like(q), rest0.copy()
    taut = np.zeros(rest0.size, np.int64)
    ramped = np.any(rate != 0.0)
    _forces_at(data, q, t0, t0, rest, rest0, rate, ramped, external, nodes, forces, push, taut)
    q0, v0, push0, taut0 = q.copy(), v.copy(), push.copy(), taut.copy()
    whole, finest = (t1 - t0) / steps, 1 << depth
    evaluations, switches = 1, 0
    for step in range(steps):
        place, level = 0, 0
        while place < finest:
            q0[:], v0[:], push0[:], taut0[:] = q, v, push, taut
            h = whole / (1 << level)
            start = t0 + whole * (step + place / finest)
            t, flips = start, 0
            _kick(data, v, push, kicks[0] * h)
            for stage in range(drifts.size):
                _fly(data, q, v, drifts[stage] * h)
                t += drifts[stage] * h
                if stage == drifts.size - 1:
                    tidy(data, q, v)
                flips += _forces_at(data, q, t, t0, rest, rest0, rate, ramped, external, nodes, forces, push, taut)
                evaluations += 1
                if flips > 0 and level < depth:
                    break
                _kick(data, v, push, kicks[stage + 1] * h)
            if flips > 0 and level < depth:
                q[:], v[:], push[:], taut[:] = q0, v0, push0, taut0
                level += 1
                continue
            switches += flips
            place += finest >> level
            while level > 0 and place % (finest >> (level - 1)) == 0:
                level -= 1
    return evaluations, switches
