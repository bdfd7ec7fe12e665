"""Any motion that is not stiff: Dormand and Prince's explicit pair of order 5(4) with projection on the manifold.

After every accepted step q2 is put back to its rod's length, joints are closed and velocities along and across them
are taken away, so lengths and joints hold to rounding. Where a damped tendon becomes taut the force jumps; the
step-size control finds the place.

Explicit: the step is bounded by about 3 over the fastest decay rate, which makes very stiff dampers slow, not wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.errors import SimulationError
from tensctl.jit import bare, jit
from tensctl.model import Dynamics
from tensctl.model.joint_kernel import close, constrain
from tensctl.model.kernel import accelerations, copy, tidy
from tensctl.simulation.drive import Drive, drive_at
from tensctl.simulation.integrators.between import between

A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
ERROR = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
# Error allowed in one step over tol: slack-taut switches let errors add up a hundredfold in a second.
_STRICT = 0.01


@bare
def advance(q, v, kq, kv, weights, h):
    """Add h times weighted slopes to a state, as many slopes as there are weights."""
    for j in range(weights.size):
        share = h * weights[j]
        if share != 0.0:
            for r in range(q.shape[0]):
                for i in range(6):
                    q[r, i] += share * kq[j, r, i]
                    v[r, i] += share * kv[j, r, i]


@jit
def march(data, q, v, times, first, drive, table, error, nodes, q_scale, v_scale, out_q, out_v):
    """Move q and v through times; returns the time reached, the next step, right-hand sides, sum of errors.

    Parameters
    ----------
    first : float, s
        Step to try first.
    q_scale, v_scale : float, m, m/s
        Errors allowed in a step.
    """
    kq, kv, room = np.zeros((7, *q.shape)), np.zeros((7, *q.shape)), np.zeros((4, *q.shape))
    q1, v1, q2, v2 = room[0], room[1], room[2], room[3]
    rest, load = drive.rest.copy(), drive.force.copy()
    flat = load.reshape(load.size)
    tied, values, mu = data.first.size > 0, np.zeros(data.place[-1]), np.zeros(data.first.size)
    locked = False
    t, t_end, h, sides, total, k = times[0], times[-1], first, 0, 0.0, 1
    suggestion = first
    while t < t_end:
        h = min(h, t_end - t)
        if locked or not h > 1e-14 * max(abs(times[0]), abs(t_end)):
            return t, h, sides, total
        last = t + h >= t_end
        for s in range(7):
            copy(q, q1)
            copy(v, v1)
            advance(q1, v1, kq, kv, table[s, :s], h)
            drive_at(drive, t + nodes[s] * h, rest, flat)
            copy(v1, kq[s])
            accelerations(data, q1, v1, rest, load, kv[s])
            locked = tied and not constrain(data, q1, kv[s], values, mu)
            sides += 1
        worst = 0.0
        for r in range(q.shape[0]):
            for i in range(6):
                eq, ev = 0.0, 0.0
                for s in range(7):
                    eq += error[s] * kq[s, r, i]
                    ev += error[s] * kv[s, r, i]
                worst = max(worst, abs(h * eq) / q_scale, abs(h * ev) / v_scale)
        factor = 5.0 if worst == 0.0 else min(5.0, max(0.2, 0.9 * worst**-0.2))
        if worst <= 1.0:
            tidy(data, q1, v1)
            if tied:
                close(data, q1, v1, values, mu)
            reached = t_end if last else t + h
            while k < times.size and times[k] <= reached:
                between(data, q, v, kv[0], q1, v1, kv[6], h, (times[k] - t) / h, q2, v2)
                if tied:
                    close(data, q2, v2, values, mu)
                copy(q2, out_q[k])
                copy(v2, out_v[k])
                k += 1
            copy(q1, q)
            copy(v1, v)
            total += worst * q_scale
            t = reached
            if not last:
                suggestion = h * factor
        else:
            factor = min(factor, 0.9) if worst == worst else 0.2
        h *= factor
        if worst <= 1.0 and last:
            suggestion = max(suggestion, h)
    copy(q, out_q[-1])
    copy(v, out_v[-1])
    return t, suggestion, sides, total


@dataclass(eq=False)
class DormandPrince:
    """Adaptive Dormand-Prince 5(4) with projection.

    Attributes
    ----------
    dynamics : Dynamics
    tol : float
        A hundredth of it, over the size, is the error allowed in a step.
    rate : float, rad/s
        A bound on the frequencies: scales velocities, and gives the first step.
    """

    dynamics: Dynamics
    tol: float
    rate: float
    name: str = "dopri5"
    evaluations: int = 0
    switches: int = 0
    step: float = 0.0
    local_errors: float = 0.0

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the step falls to nothing.
        """
        size = float(self.dynamics.potential.manifold.lengths.max())
        first = self.step if self.step > 0 else 0.01 / self.rate
        scale = _STRICT * self.tol * size
        t, self.step, sides, total = march(
            self.dynamics.kernel, q, v, times, first, drive, A, ERROR, NODES, scale, scale * self.rate, out_q, out_v
        )
        self.evaluations += sides
        self.local_errors += total
        if t < times[-1]:
            raise SimulationError(
                f"the step size fell to nothing at {t:g} s; loosen tol, lower the damping, or use method = rosenbrock."
            )
