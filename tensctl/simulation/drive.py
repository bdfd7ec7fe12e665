"""What acts on a structure between two edges of time, as exact functions of time: rest lengths and nodal forces.

    rest(t)  = rest + rate s + lag (1 - exp(-s/tau)),   s = t - start
    force(t) = force + force_rate s + sum over waves of wave_force sin(wave_omega t + wave_phase) on wave_node

A controller's command c ramps within its period; an actuator with first-order lag, du/dt = (c - u)/tau, follows it on
that straight line plus exponential exactly, so no integrator has to carry u as a state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import bare


class Drive(NamedTuple):
    """Inputs on one interval.

    Attributes
    ----------
    start : float, s
    rest, rate, lag : (nt,) m, m/s, m
    tau : float, s
        Time constant of the actuators; any positive number where `lag` is zero.
    force, force_rate : (N, 3) N, N/s
    wave_node : (w,) int
    wave_force : (w, 3) N
    wave_omega, wave_phase : (w,) rad/s, rad
    ramped, swept : bool
        Whether rest lengths and whether forces change at all; where not, nothing is evaluated.
    """

    start: float
    rest: np.ndarray
    rate: np.ndarray
    lag: np.ndarray
    tau: float
    force: np.ndarray
    force_rate: np.ndarray
    wave_node: np.ndarray
    wave_force: np.ndarray
    wave_omega: np.ndarray
    wave_phase: np.ndarray
    ramped: bool
    swept: bool

    @classmethod
    def constant(cls, rest: np.ndarray, force: np.ndarray) -> Drive:
        """Constant rest lengths (nt,) m and nodal forces (N, 3) N."""
        still, none = np.zeros_like(rest), np.zeros(0)
        return cls(
            0.0, rest, still, still, 1.0, force, np.zeros_like(force),
            np.zeros(0, np.int64), np.zeros((0, 3)), none, none, False, False,
        )  # fmt: skip


@bare
def drive_at(drive, t, rest, load):
    """Fill rest (nt,) and the flat load (3N,) with their values at time t."""
    s = t - drive.start
    if drive.ramped:
        share = -np.expm1(-s / drive.tau)
        for k in range(rest.size):
            rest[k] = drive.rest[k] + s * drive.rate[k] + share * drive.lag[k]
    if drive.swept:
        for a in range(drive.force.shape[0]):
            for i in range(3):
                load[3 * a + i] = drive.force[a, i] + s * drive.force_rate[a, i]
        for w in range(drive.wave_node.size):
            swing = np.sin(drive.wave_omega[w] * t + drive.wave_phase[w])
            for i in range(3):
                load[3 * drive.wave_node[w] + i] += swing * drive.wave_force[w, i]


@bare
def drive_rate(drive, t, rest_rate, load_rate):
    """Fill the derivatives of rest lengths and forces by time at t."""
    if drive.ramped:
        share = np.exp(-(t - drive.start) / drive.tau) / drive.tau
        for k in range(rest_rate.size):
            rest_rate[k] = drive.rate[k] + share * drive.lag[k]
    if drive.swept:
        for a in range(drive.force.shape[0]):
            for i in range(3):
                load_rate[3 * a + i] = drive.force_rate[a, i]
        for w in range(drive.wave_node.size):
            omega = drive.wave_omega[w]
            swing = omega * np.cos(omega * t + drive.wave_phase[w])
            for i in range(3):
                load_rate[3 * drive.wave_node[w] + i] += swing * drive.wave_force[w, i]


@bare
def drive_bend(drive, t, time):
    """Most that a rest length can leave its values at both ends of a time from t on, within it, m: by its lag alone."""
    if not drive.ramped:
        return 0.0
    farthest = 0.0
    for k in range(drive.lag.size):
        farthest = max(farthest, abs(drive.lag[k]))
    return farthest * np.exp(-(t - drive.start) / drive.tau) * min(1.0, 0.125 * (time / drive.tau) ** 2)
