"""Stiff damped motion: RODAS5P on the exact Jacobian, with projection on the rods' manifold.

    u_v = s u_q - R1,   (s^2 - s g_v - g_q) u_q = R2 + s R1 - g_v R1,   s = 1/(h gamma)

for each stage: systems of the size of q instead of (q, v), 5 unknowns a free rod (`blocks`), one factorisation a step.
L-stable: dampers and tendons of any stiffness bound no step, only how fast the motion itself changes does. Where a
tendon goes slack or taut the force bends or jumps; the step-size control finds the place.

Linear algebra is exact for the small and wide band of large structures: its time grows with rods times band squared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tensctl.errors import SimulationError
from tensctl.jit import jit
from tensctl.model import Dynamics
from tensctl.model.kernel import accelerations, pushes, tidy
from tensctl.simulation.drive import Drive, drive_at, drive_rate
from tensctl.simulation.integrators.blocks import Places, Slopes, assemble, expand, linearise, places, reduce, slopes
from tensctl.simulation.integrators.factor import Envelope, factor, solve
from tensctl.simulation.integrators.rodas import RODAS5P

# Error allowed in one step over tol: slack-taut switches let errors add up a hundredfold in a second.
_STRICT = 0.01
# A step may turn a rod by this, rad: at 1/gamma its own equation along the rod loses its solution.
_TURN = 2.0


class Room(NamedTuple):
    """Arrays to work in: matrix, its reach and right-hand side; nodal fields; stages."""

    A: np.ndarray
    left: np.ndarray
    right: np.ndarray
    order: np.ndarray
    b: np.ndarray
    x: np.ndarray
    place: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    along: np.ndarray
    uq: np.ndarray
    uv: np.ndarray
    sums: np.ndarray


@jit
def turn_by_time(data, drive, t, q, found, work, rest_rate, load_rate, rate):
    """Fill the derivative of accelerations by time, (nr, 6): rest lengths and loads change."""
    force = work.force
    drive_rate(drive, t, rest_rate, load_rate)
    for i in range(force.size):
        force[i] = load_rate[i]
    for k in range(rest_rate.size):
        if found.ease[k] != 0.0:
            a, b = np.int64(data.tail_at[k]), np.int64(data.head_at[k])
            for i in range(3):
                pull = found.ease[k] * rest_rate[k] * found.unit[k, i]
                force[a + i] -= pull
                force[b + i] += pull
    pushes(data, q, force, rate)


@jit
def stages(data, drive, table, at, found, t, h, q, v, by_time, rest, load, work):
    """All stages of a step from factors for it; the new state is left in sums[0] and sums[1], the error in the last."""
    s = 1.0 / (h * table.gamma)
    size = q.size
    rods = q.shape[0]
    q1, v1, first, second, move, rate = (
        work.sums[0], work.sums[1], work.sums[2], work.sums[3], work.sums[4], work.sums[5]
    )  # fmt: skip
    flat_q, flat_v, flat_1, flat_2 = q1.reshape(size), v1.reshape(size), first.reshape(size), second.reshape(size)
    q0, v0, flat_t = q.reshape(size), v.reshape(size), by_time.reshape(size)
    count = table.d.size
    for k in range(count + 1):
        for i in range(size):
            flat_q[i], flat_v[i] = q0[i], v0[i]
        for j in range(k):
            a = table.a[k, j] if k < count else (1.0 if j == k - 1 else table.a[count - 1, j])
            if a != 0.0:
                uq, uv = work.uq[j].reshape(size), work.uv[j].reshape(size)
                for i in range(size):
                    flat_q[i] += a * uq[i]
                    flat_v[i] += a * uv[i]
        if k == count:
            break
        drive_at(drive, t + table.times[k] * h, rest, load)
        accelerations(data, q1, v1, rest, load.reshape(load.size // 3, 3), second)
        for i in range(size):
            flat_1[i] = flat_v[i]
        if table.d[k] != 0.0 and (drive.ramped or drive.swept):
            for i in range(size):
                flat_2[i] += h * table.d[k] * flat_t[i]
        for j in range(k):
            c = table.C[k, j] / h
            uq, uv = work.uq[j].reshape(size), work.uv[j].reshape(size)
            for i in range(size):
                flat_1[i] += c * uq[i]
                flat_2[i] += c * uv[i]
        reduce(
            data, at, found, s, first, second, move, rate, work.place, work.speed, work.force, work.along, work.b
        )  # fmt: skip
        solve(work.A, work.left, work.right, work.order, work.b, work.x)
        expand(data, at, found, s, first, work.x, work.along, work.uq[k], work.uv[k])
    for r in range(rods):
        if data.hold[r] == 3:
            for i in range(6):
                q1[r, i], v1[r, i] = q[r, i], v[r, i]


@jit
def within(data, table, x, q, v, q1, v1, work, out_q, out_v):
    """Write the state a part x into the step that was just taken, rods put to their lengths."""
    count = table.d.size
    for r in range(q.shape[0]):
        for i in range(6):
            a, b = 0.0, 0.0
            for k in range(table.H.shape[0] - 1, -1, -1):
                hq, hv = 0.0, 0.0
                for j in range(count):
                    hq += table.H[k, j] * work.uq[j, r, i]
                    hv += table.H[k, j] * work.uv[j, r, i]
                a, b = hq + x * a, hv + x * b
            out_q[r, i] = (1.0 - x) * q[r, i] + x * (q1[r, i] + (1.0 - x) * a)
            out_v[r, i] = (1.0 - x) * v[r, i] + x * (v1[r, i] + (1.0 - x) * b)
    tidy(data, out_q, out_v)


@jit
def march(data, drive, table, at, envelope, found, work, q, v, times, step, fixed, q_scale, v_scale, out_q, out_v):
    """Move q and v through times; returns the time reached, the next step, right-hand sides, refused steps.

    Parameters
    ----------
    step : float, s
        Step to try first; the only one, whatever its error, when `fixed`.
    q_scale, v_scale : float, m, m/s
        Errors allowed in a step.
    """
    rest, load = drive.rest.copy(), drive.force.copy().reshape(drive.force.size)
    rest_rate, load_rate, by_time = np.zeros(rest.size), np.zeros(load.size), np.zeros(q.shape)
    count = table.d.size
    q1, v1 = work.sums[0], work.sums[1]
    t, t_end, h, sides, refused, k = times[0], times[-1], step, 0, 0, 1
    suggestion, before, worst_before, fresh = step, 0.0, 1e-2, False
    while t < t_end:
        if not fresh:
            drive_at(drive, t, rest, load)
            linearise(data, q, v, rest, load, work.place, work.speed, work.force, found)
            if drive.ramped or drive.swept:
                turn_by_time(data, drive, t, q, found, work, rest_rate, load_rate, by_time)
            fresh = True
            fastest = 0.0
            for r in range(found.spin.size):
                fastest = max(fastest, found.spin[r])
            if fastest > 0.0 and not fixed:
                h = min(h, _TURN / np.sqrt(fastest))
        last = t + h * (1 + 1e-10) >= t_end
        h = t_end - t if last else h
        if not t + h > t:
            return t, h, sides, refused
        assemble(data, at, found, 1.0 / (h * table.gamma), work.A)
        factor(work.A, envelope, work.left, work.right, work.order)
        stages(data, drive, table, at, found, t, h, q, v, by_time, rest, load, work)
        sides += count
        worst = 0.0
        for r in range(q.shape[0]):
            for i in range(6):
                worst = max(worst, abs(work.uq[count - 1, r, i]) / q_scale, abs(work.uv[count - 1, r, i]) / v_scale)
            if q1[r, 0] != q1[r, 0]:
                worst = np.nan
        if worst <= 1.0 or (fixed and worst == worst):
            tidy(data, q1, v1)
            reached = t_end if last else t + h
            while k < times.size and times[k] <= reached:
                if times[k] == reached:
                    break
                within(data, table, (times[k] - t) / h, q, v, q1, v1, work, out_q[k], out_v[k])
                k += 1
            for r in range(q.shape[0]):
                for i in range(6):
                    q[r, i], v[r, i] = q1[r, i], v1[r, i]
            if k < times.size and times[k] == reached:
                out_q[k], out_v[k] = q, v
                k += 1
            t, fresh = reached, False
            if fixed:
                continue
            worst = max(worst, 1e-10)
            factor_now = 0.9 * worst**-0.2
            if before > 0.0:
                factor_now = min(factor_now, 0.9 * h / before * (worst_before / (worst * worst)) ** 0.2)
            factor_now = min(6.0, max(0.2, factor_now))
            suggestion = h * factor_now if not last else max(suggestion, h * factor_now)
            before, worst_before = h, max(worst, 1e-2)
            h *= factor_now
        else:
            refused += 1
            h *= min(0.9, max(0.1, 0.9 * worst**-0.2)) if worst == worst else 0.1
    return t, suggestion, sides, refused


@dataclass(eq=False)
class Rosenbrock:
    """Adaptive RODAS5P with projection.

    Attributes
    ----------
    dynamics : Dynamics
    tol : float
        A hundredth of it, over the size, is the error allowed in a step.
    rate : float, rad/s
        A bound on the frequencies: scales velocities, and gives the first step.
    fixed : float, s
        When > 0, every step has this length.
    """

    dynamics: Dynamics
    tol: float
    rate: float
    fixed: float = 0.0
    name: str = "rosenbrock"
    evaluations: int = 0
    switches: int = 0
    step: float = 0.0

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the step falls to nothing.
        """
        at, envelope, found, work = self._room
        size = float(self.dynamics.potential.manifold.lengths.max())
        first = self.fixed or self.step or 0.01 / self.rate
        scale = _STRICT * self.tol * size
        t, self.step, sides, _ = march(
            self.dynamics.kernel, drive, RODAS5P, at, envelope, found, work, q, v, times, first, self.fixed > 0,
            scale, scale * self.rate, out_q, out_v,
        )  # fmt: skip
        self.evaluations += sides
        if t < times[-1]:
            raise SimulationError(f"the step size fell to nothing at {t:g} s; loosen tol.")

    @cached_property
    def _room(self) -> tuple[Places, Envelope, Slopes, Room]:
        rods, size = len(self.dynamics.structure.rods), self.dynamics.kernel.anchor.size
        at, envelope = places(self.dynamics)
        n, count = envelope.left.size, RODAS5P.d.size
        work = Room(
            A=np.zeros((n, n)), left=np.zeros(n, int), right=np.zeros(n, int), order=np.zeros(n, int), b=np.zeros(n),
            x=np.zeros(n), place=np.zeros(size), speed=np.zeros(size),
            force=np.zeros(size), along=np.zeros(rods), uq=np.zeros((count, rods, 6)), uv=np.zeros((count, rods, 6)),
            sums=np.zeros((6, rods, 6)),
        )  # fmt: skip
        return at, envelope, slopes(rods, len(self.dynamics.structure.tendons)), work
