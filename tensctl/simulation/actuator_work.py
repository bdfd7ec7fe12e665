"""What motors pull with, and the work of their motion between recorded times.

    F_j = sum_t g_t T_t,   P_j = f_j dv_j/dt,   f_j = sum_t g_t dV_t/du_t,   W = sum over intervals of dv <f>

dV/du, what the tendon's energy gains per unit of shortening, is T for constant stiffness and T (1 + T/(2 EA)) for
constant EA, where reeled-in cable keeps its strain. Within an interval v counts as a straight line and <f> follows from
f and df/dt at both ends,

    <f> = (f_0 + f_1)/2 + h (f_0' - f_1')/12,   f' = drift + stiffness dv/dt

of order 4 while straight lines are what v is; a corner, lag, or a tendon going slack inside an interval leaves order 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.model import Dynamics
from tensctl.model.tensions import lengthening
from tensctl.simulation.run import Run
from tensctl.structure import Members


@dataclass(frozen=True, eq=False)
class Pull:
    """Generalised forces of motors at recorded times.

    Attributes
    ----------
    time : (t,) s
    inputs : (t, nu) m
        What the motors have taken in, v.
    force : (t, nu) N
        f, what a motor's energy per metre is.
    drift : (t, nu) N/s
        Growth of f while the motor stands; 0 where it is not known, and <f> is then the mean of both ends.
    stiffness : (t, nu) N/m
        Growth of f by the motor's own motion.
    """

    time: Float[np.ndarray, " t"]
    inputs: Float[np.ndarray, "t nu"]
    force: Float[np.ndarray, "t nu"]
    drift: Float[np.ndarray, "t nu"]
    stiffness: Float[np.ndarray, "t nu"]

    @property
    def speed(self) -> Float[np.ndarray, "t nu"]:
        """Mean speed of each motor over the interval that ends at each time, m/s; 0 at the first."""
        speed = np.zeros_like(self.inputs)
        speed[1:] = np.diff(self.inputs, axis=0) / np.diff(self.time)[:, None]
        return speed

    def works(self) -> Float[np.ndarray, "k nu"]:
        """Work of each motor in each interval, J."""
        h, speed = np.diff(self.time)[:, None], self.speed[1:]
        ends = -np.diff(self.drift, axis=0) - np.diff(self.stiffness, axis=0) * speed
        return np.diff(self.inputs, axis=0) * (0.5 * (self.force[:-1] + self.force[1:]) + h * ends / 12)

    @property
    def error(self) -> Float[np.ndarray, " nu"]:
        """By how much the net work of each motor differs with every second time left out, J."""
        last = len(self.time) - 1
        kept = np.unique(np.append(np.arange(0, last, 2), last))
        coarse = Pull(*(a[kept] for a in (self.time, self.inputs, self.force, self.drift, self.stiffness)))
        return np.abs(self.works().sum(axis=0) - coarse.works().sum(axis=0))


def pull_of_tensions(
    members: Members, time: np.ndarray, inputs: np.ndarray, tensions: Float[np.ndarray, "t tendons"]
) -> Pull:
    """Pull of motors from tensions alone."""
    none = np.zeros_like(inputs)
    return Pull(time, inputs, motor_forces(members, _conjugate(members, tensions)), none, none)


def pull_of_run(dynamics: Dynamics, run: Run) -> Pull:
    """Pull of motors in a run; dampers in tendons have no drift that a run tells."""
    members, length, rest = dynamics.members, run.lengths, run.rest_lengths
    plain = pull_of_tensions(members, run.time, run.inputs, run.tensions)
    if dynamics.damping.any():
        return plain
    taut, k = length > rest, members.stiffness
    by_length = np.where(taut, k if members.law == "k" else k * length / rest**2, 0.0)
    by_input = np.where(taut, k if members.law == "k" else k * length**2 / rest**3, 0.0)
    growing = lengthening(run.structure, run.nodes, run.velocities)
    drift = motor_forces(members, by_length * growing)
    stiffness = by_input[:, members.inputs] @ members.gearing.matrix.power(2)
    return Pull(run.time, run.inputs, plain.force, drift, stiffness)


def motor_forces(members: Members, forces: Float[np.ndarray, "t tendons"]) -> Float[np.ndarray, "t nu"]:
    """Forces of tendons as their motors feel them, N."""
    return forces[:, members.inputs] @ members.gearing.matrix


def _conjugate(members: Members, tensions: np.ndarray) -> np.ndarray:
    return tensions if members.law == "k" else tensions * (1 + tensions / (2 * members.stiffness))
