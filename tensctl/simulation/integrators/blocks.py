"""The exact Jacobian of the rods' motion, tendon by tendon, in coordinates without redundancy.

For q'' = g(q, v) and a step with s = 1/(h gamma), RODAS5P solves (s^2 - s g_v - g_q) k = r. Multiplied by the rods'
masses this is

    A = s^2 M + sum over tendons N' (s C + K) N + rods' own terms,   C = c n n',  K = dF/dd,  N = (I, -+B)/2

with n along the tendon, d = p_head - p_tail, F = T n. A rod's direction has the basis (e, b1, b2), e along the rod.
Row e of A couples no two rods: q2.q2'' = -|v2|^2 whatever the forces. It is solved first,

    k_e = kappa - w.k_b,   w = (6/m b.(f2 - f1)/|q2| + 2 s b.v2/|q2|) / (s^2 - |v2|^2/|q2|^2)

and leaves 5 unknowns a free rod, 2 a rod held at one end (3/m and the force on its free end then), none a rod held at
both. A is symmetric and positive definite but for velocities and compression, so its diagonal is large.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import reverse_cuthill_mckee

from tensctl.jit import jit, part
from tensctl.model import Dynamics
from tensctl.model.kernel import place_nodes
from tensctl.simulation.integrators.factor import Envelope

_FREE, _TAIL, _FIXED = 0, 1, 3


class Places(NamedTuple):
    """Which equations belong to what.

    Attributes
    ----------
    first : (nr,) int
        First equation of each rod: three of its centre when free, then two of its direction.
    rod, sign : (N,) int, float
        Rod that each node moves with, -1 for none; +1 at a head, -1 at a tail.
    """

    first: np.ndarray
    rod: np.ndarray
    sign: np.ndarray


class Slopes(NamedTuple):
    """The linearised motion at the start of a step.

    Attributes
    ----------
    axis : (nr, 3, 3)
        Rows e, b1, b2.
    tilt : (nr, 2, 3)
        b - w e, the directions that remain when k_e is solved for.
    lean, across, turn : (nr, 2)
        w, b.force/(mass |q2|) and b.v2/|q2|.
    spin, press : (nr,)
        |v2|^2/|q2|^2, and the rod's own term on the diagonal of its direction.
    unit : (nt, 3)
        n, zero where the tendon carries nothing.
    damper, ease : (nt,)
        c and -dT/dL where it carries, else zero.
    slope : (nt, 3, 3) N/m
        K.
    """

    axis: np.ndarray
    tilt: np.ndarray
    lean: np.ndarray
    across: np.ndarray
    turn: np.ndarray
    spin: np.ndarray
    press: np.ndarray
    unit: np.ndarray
    damper: np.ndarray
    ease: np.ndarray
    slope: np.ndarray


def places(dynamics: Dynamics) -> tuple[Places, Envelope]:
    """Equations in the order of Cuthill and McKee reversed, rods that share a tendon being neighbours."""
    structure, hold = dynamics.structure, dynamics.potential.manifold.hold
    rod, sign = np.full(len(structure.nodes), -1), np.zeros(len(structure.nodes))
    for side, held in ((0, 1), (1, 2)):
        moving = (hold == _FREE) | (hold == 3 - held)
        rod[structure.rods[moving, side]] = np.flatnonzero(moving)
        sign[structure.rods[moving, side]] = 2.0 * side - 1.0
    count = len(hold)
    a, b = rod[structure.tendons].T
    both = (a >= 0) & (b >= 0)
    graph = sp.csr_array((np.ones(both.sum()), (a[both], b[both])), shape=(count, count))
    graph = sp.csr_array(graph + graph.T + sp.eye_array(count))
    order = reverse_cuthill_mckee(sp.csr_matrix(graph), symmetric_mode=True)
    sizes = np.select([hold == _FREE, hold == _FIXED], [5, 0], 2)
    first = np.empty(count, int)
    first[order] = np.concatenate([[0], np.cumsum(sizes[order])[:-1]])
    left, right = np.empty(sizes.sum(), int), np.empty(sizes.sum(), int)
    for r in range(count):
        near = graph.indices[graph.indptr[r] : graph.indptr[r + 1]]
        rows = slice(first[r], first[r] + sizes[r])
        left[rows], right[rows] = first[near].min(), (first[near] + sizes[near]).max()
    low = np.maximum.accumulate(right)  # the pattern is symmetric, so columns reach as far down as rows to the right
    return Places(first, rod, sign), Envelope(left, right, low)


def slopes(rods: int, tendons: int) -> Slopes:
    """Room for a linearised motion."""
    return Slopes(
        axis=np.zeros((rods, 3, 3)), tilt=np.zeros((rods, 2, 3)), lean=np.zeros((rods, 2)),
        across=np.zeros((rods, 2)), turn=np.zeros((rods, 2)), spin=np.zeros(rods), press=np.zeros(rods),
        unit=np.zeros((tendons, 3)), damper=np.zeros(tendons), ease=np.zeros(tendons),
        slope=np.zeros((tendons, 3, 3)),
    )  # fmt: skip


@jit
def linearise(data, q, v, rest, load, place, speed, force, found):
    """Fill the slopes at a state; place, speed and force are room, (3N,)."""
    anchor = data.anchor.reshape(place.size)
    for i in range(place.size):
        place[i], speed[i] = anchor[i], 0.0
    place_nodes(data, q, place)
    place_nodes(data, v, speed)
    for i in range(force.size):
        force[i] = load[i] - data.drag * speed[i]
    d, w, n = np.empty(3), np.empty(3), np.empty(3)
    for t in range(rest.size):
        a, b = np.int64(data.tail_at[t]), np.int64(data.head_at[t])
        square, closing = 0.0, 0.0
        for i in range(3):
            d[i], w[i] = place[b + i] - place[a + i], speed[b + i] - speed[a + i]
            square += d[i] * d[i]
            closing += d[i] * w[i]
        length, c = np.sqrt(square), data.damping[t]
        k = data.stiffness[t] / rest[t] if data.by_strain else data.stiffness[t]
        tension = 0.0
        if length > rest[t]:
            closing /= length
            tension = k * (length - rest[t]) + c * closing
        if length > rest[t] and (tension > 0.0 or not data.clamped):
            for i in range(3):
                n[i] = d[i] / length
            for i in range(3):
                found.unit[t, i] = n[i]
                force[a + i] += tension * n[i]
                force[b + i] -= tension * n[i]
                for j in range(3):
                    along = k * n[j] + c * (w[j] - closing * n[j]) / length
                    found.slope[t, i, j] = n[i] * along - tension / length * n[i] * n[j]
                found.slope[t, i, i] += tension / length
            found.damper[t] = c
            found.ease[t] = k * length / rest[t] if data.by_strain else k
        else:
            found.damper[t], found.ease[t] = 0.0, 0.0
            for i in range(3):
                found.unit[t, i] = 0.0
                for j in range(3):
                    found.slope[t, i, j] = 0.0
    frames(data, q, v, force, found)


@part
def frames(data, q, v, force, found):
    """Each rod's basis, and its own terms under the forces on its ends."""
    f = np.empty(3)
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        a, b, m = 3 * data.rod_tail[r], 3 * data.rod_head[r], data.mass[r]
        square, spin, least = 0.0, 0.0, 0
        for i in range(3):
            if hold == _FREE:
                f[i] = force[b + i] - force[a + i]
            else:
                f[i] = force[b + i] if hold == _TAIL else -force[a + i]
            square += q[r, 3 + i] ** 2
            spin += v[r, 3 + i] ** 2
            if abs(q[r, 3 + i]) < abs(q[r, 3 + least]):
                least = i
        length = np.sqrt(square)
        spin /= square
        axis = found.axis[r]
        for i in range(3):
            axis[0, i] = q[r, 3 + i] / length
        across = np.sqrt(1.0 - axis[0, least] ** 2)
        for i in range(3):
            axis[1, i] = ((1.0 if i == least else 0.0) - axis[0, least] * axis[0, i]) / across
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            axis[2, i] = axis[0, j] * axis[1, k] - axis[0, k] * axis[1, j]
        inertia, share = (m / 12.0, 0.5) if hold == _FREE else (m / 3.0, 1.0)
        pull = (f[0] * axis[0, 0] + f[1] * axis[0, 1] + f[2] * axis[0, 2]) / length
        found.spin[r] = spin
        found.press[r] = share * pull + inertia * spin
        for k in range(2):
            bend, turn = 0.0, 0.0
            for i in range(3):
                bend += axis[1 + k, i] * f[i]
                turn += axis[1 + k, i] * v[r, 3 + i]
            found.across[r, k], found.turn[r, k] = share / inertia * bend / length, turn / length


@jit
def assemble(data, at, found, s, A):
    """Fill A, (n, n), for s = 1/(h gamma), and what depends on s in the slopes."""
    for i in range(A.shape[0]):
        row = A[i]
        for j in range(row.size):
            row[j] = 0.0
    for r in range(data.mass.size):
        hold, i, m = data.hold[r], at.first[r], data.mass[r]
        if hold == _FIXED:
            continue
        drag, inertia = (0.5 * s * data.drag, m / 12.0) if hold == _FREE else (s * data.drag, m / 3.0)
        if hold == _FREE:
            for _ in range(3):
                A[i, i] = s * s * m / 4.0 + drag
                i += 1
        for k in range(2):
            A[i + k, i + k] = s * s * inertia + drag + found.press[r]
            lean = (found.across[r, k] + 2.0 * s * found.turn[r, k]) / (s * s - found.spin[r])
            found.lean[r, k] = lean
            for j in range(3):
                found.tilt[r, k, j] = found.axis[r, 1 + k, j] - lean * found.axis[r, 0, j]
    G, X = np.empty((3, 3)), np.empty((3, 5))
    for t in range(data.tail_at.size):
        a, b = np.int64(data.tail_at[t]) // 3, np.int64(data.head_at[t]) // 3
        for i in range(3):
            for j in range(3):
                G[i, j] = s * found.damper[t] * found.unit[t, i] * found.unit[t, j] + found.slope[t, i, j]
        for side in range(2):
            node, other = (a, b) if side == 0 else (b, a)
            p = at.rod[node]
            if p < 0:
                continue
            # Columns: G times how the node moves with its rod.
            free = data.hold[p] == _FREE
            half, centre = (0.5, 3) if free else (1.0, 0)
            sign = half * at.sign[node]
            for i in range(3):
                for j in range(centre):
                    X[i, j] = 0.5 * G[i, j]
                for k in range(2):
                    total = 0.0
                    for j in range(3):
                        total += G[i, j] * found.tilt[p, k, j]
                    X[i, centre + k] = sign * total
            for end in range(2):
                # Rows: of the node's own rod, and with the other sign of the rod at the other end.
                here = node if end == 0 else other
                r = at.rod[here]
                if r < 0:
                    continue
                way = 1.0 if end == 0 else -1.0
                i = at.first[r]
                if data.hold[r] == _FREE:
                    way *= 0.5
                    for k in range(3):
                        row = A[i + k]
                        for j in range(centre + 2):
                            row[at.first[p] + j] += way * X[k, j]
                    i += 3
                way *= at.sign[here]
                for k in range(2):
                    row = A[i + k]
                    for j in range(centre + 2):
                        total = 0.0
                        for m in range(3):
                            total += found.axis[r, 1 + k, m] * X[m, j]
                        row[at.first[p] + j] += way * total


@part
def linear_forces(data, found, place, speed, force):
    """Forces K d + C w and drag on each node of small displacements and velocities, (3N,)."""
    for i in range(force.size):
        force[i] = -data.drag * speed[i]
    for t in range(data.tail_at.size):
        if found.ease[t] == 0.0:
            continue
        a, b = np.int64(data.tail_at[t]), np.int64(data.head_at[t])
        x, y, z = place[b] - place[a], place[b + 1] - place[a + 1], place[b + 2] - place[a + 2]
        n, K = found.unit[t], found.slope[t]
        closing = n[0] * (speed[b] - speed[a]) + n[1] * (speed[b + 1] - speed[a + 1])
        closing = found.damper[t] * (closing + n[2] * (speed[b + 2] - speed[a + 2]))
        for i in range(3):
            pull = K[i, 0] * x + K[i, 1] * y + K[i, 2] * z + closing * n[i]
            force[a + i] += pull
            force[b + i] -= pull


@jit
def reduce(data, at, found, s, first, second, move, rate, place, speed, force, along, b):
    """Right-hand side b (n,) of A k = b from both halves of a stage's equations, and kappa (nr,) of each rod.

    first, second : (nr, 6)
        s u_q - u_v and s u_v - g_q u_q - g_v u_v.
    move, rate, place, speed, force
        Room.
    """
    for r in range(data.mass.size):
        hold = data.hold[r]
        if hold == _FIXED:
            continue
        axis, total = found.axis[r], 0.0
        for i in range(3):
            beside = 2.0 * (found.turn[r, 0] * axis[1, i] + found.turn[r, 1] * axis[2, i])
            total += axis[0, i] * (second[r, 3 + i] + s * first[r, 3 + i]) + beside * first[r, 3 + i]
        along[r] = total / (s * s - found.spin[r])
        sign = 0.0 if hold == _FREE else (1.0 if hold == _TAIL else -1.0)
        for i in range(3):
            move[r, 3 + i] = along[r] * axis[0, i]
            rate[r, 3 + i] = s * move[r, 3 + i] - first[r, 3 + i]
            move[r, i] = sign * move[r, 3 + i]
            rate[r, i] = -first[r, i] if hold == _FREE else sign * rate[r, 3 + i]
    for i in range(place.size):
        place[i], speed[i] = 0.0, 0.0
    place_nodes(data, move, place)
    place_nodes(data, rate, speed)
    linear_forces(data, found, place, speed, force)
    for r in range(data.mass.size):
        hold, k, m = data.hold[r], at.first[r], data.mass[r]
        if hold == _FIXED:
            continue
        head, tail = 3 * data.rod_head[r], 3 * data.rod_tail[r]
        inertia = m / 3.0
        if hold == _FREE:
            inertia = m / 12.0
            for i in range(3):
                b[k] = m / 4.0 * (second[r, i] + s * first[r, i]) + 0.5 * (force[head + i] + force[tail + i])
                k += 1
        b[k], b[k + 1] = 0.0, 0.0
        for i in range(3):
            if hold == _FREE:
                f = 0.5 * (force[head + i] - force[tail + i])
            else:
                f = force[head + i] if hold == _TAIL else -force[tail + i]
            f += inertia * (second[r, 3 + i] + s * first[r, 3 + i])
            b[k] += found.axis[r, 1, i] * f
            b[k + 1] += found.axis[r, 2, i] * f


@jit
def expand(data, at, found, s, first, k, along, move, rate):
    """Fill u_q and u_v, (nr, 6), from the solution k of A k = b."""
    for r in range(data.mass.size):
        hold, c = data.hold[r], at.first[r]
        if hold == _FIXED:
            continue
        if hold == _FREE:
            for i in range(3):
                move[r, i] = k[c + i]
            c += 3
        e = along[r] - found.lean[r, 0] * k[c] - found.lean[r, 1] * k[c + 1]
        axis, sign = found.axis[r], 1.0 if hold == _TAIL else -1.0
        for i in range(3):
            move[r, 3 + i] = e * axis[0, i] + k[c] * axis[1, i] + k[c + 1] * axis[2, i]
            if hold != _FREE:
                move[r, i] = sign * move[r, 3 + i]
        for i in range(6):
            rate[r, i] = s * move[r, i] - first[r, i]
