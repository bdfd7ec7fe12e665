"""Nodes over time and nothing else: the lean way through many short undisturbed motions.

    (p, p')(t0) -> (p, p')(t),   rest lengths and loads as they are

`simulate` also keeps lengths, tensions, rest lengths and statuses, and looks for loads, schedules and controllers; on
the (3,1) shell that takes several times as long as the motion. What never changes from call to call is made once here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.jit import bare
from tensctl.model import Dynamics
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators import Integrator, Method, choose_integrator
from tensctl.simulation.state import FITS, state_at
from tensctl.simulation.times import ascends


@dataclass(frozen=True, eq=False)
class Propagator:
    """Moves one structure from given nodes and velocities; it keeps room to work in, so one thread uses it at a time.

    Attributes
    ----------
    dynamics : Dynamics
    integrator : Integrator
    why : str
        Why it was taken.
    drive : Drive
        Constant rest lengths and loads.
    """

    dynamics: Dynamics
    integrator: Integrator
    why: str
    drive: Drive
    _rods: np.ndarray = field(repr=False)

    def __call__(
        self,
        nodes: Float[np.ndarray, "nodes 3"],
        velocities: Float[np.ndarray, "nodes 3"],
        times: Sequence[float] | Float[np.ndarray, " t"],
    ) -> tuple[Float[np.ndarray, "t nodes 3"], Float[np.ndarray, "t nodes 3"]]:
        """Nodes (t, N, 3) m and velocities (t, N, 3) m/s at given times, the first of which is that of the start.

        Raises
        ------
        SimulationError
            A start that the structure cannot have, times out of order, or a motion that cannot be followed.
        """
        times, structure = np.asarray(times, float), self.dynamics.structure
        if not ascends(times):
            raise SimulationError("times must be finite and in ascending order, in s; the first is that of the start.")
        nodes, velocities = np.ascontiguousarray(nodes, float), np.ascontiguousarray(velocities, float)
        fits = nodes.shape == velocities.shape == structure.nodes.shape
        q, v = (np.empty((times.size, len(structure.rods), 6)) for _ in range(2))
        kernel = self.dynamics.kernel
        if not fits or not enter(self._rods, kernel.lengths, structure.nodes, structure.held, nodes, velocities, q, v):
            q[0], v[0] = state_at(self.dynamics, nodes, velocities)
        if times.size > 1:
            self.integrator.march(q[0].copy(), v[0].copy(), times, self.drive, q, v)
        out, rates = (np.empty((times.size, *nodes.shape)) for _ in range(2))
        leave(self._rods, structure.nodes, structure.held, q, v, out, rates)
        return out, rates


def propagator(
    dynamics: Dynamics,
    *,
    rest_lengths: Float[np.ndarray, " tendons"] | None = None,
    method: Method = "auto",
    tol: float = 1e-6,
) -> Propagator:
    """Make ready to move a structure without inputs; call what it gives with nodes, velocities and times.

    Parameters
    ----------
    dynamics : Dynamics
    rest_lengths : (nt,) m, optional
        The structure's own by default; those of an equilibrium, to stay about it.
    method, tol
        As `simulate` has them. Splittings end their steps at the times asked for.

    Raises
    ------
    SimulationError
        Rest lengths that do not fit, or a method that cannot move the structure.
    """
    rest = dynamics.members.rest_lengths if rest_lengths is None else np.array(rest_lengths, float)
    if rest.shape != dynamics.members.rest_lengths.shape or not (rest > 0).all():
        raise SimulationError(
            f"rest_lengths have shape {rest.shape}; {dynamics.members.rest_lengths.shape} lengths > 0 m are expected."
        )
    if not 0 < tol < 1:
        raise SimulationError(f"tol is {tol}; a number between 0 and 1 is expected.")
    choice = choose_integrator(dynamics, method, tol, stop=True)
    force = dynamics.layout.spread(dynamics.members.forces)
    return Propagator(dynamics, choice.integrator, choice.why, Drive.constant(rest, force), dynamics.structure.rods)


@bare
def enter(rods, lengths, own, held, nodes, velocities, q, v):
    """Fill the rods' first state; whether it is one that the structure can have."""
    for k in range(rods.shape[0]):
        square, along, speed = 0.0, 0.0, 0.0
        for i in range(3):
            a, b, c, d = (
                nodes[rods[k, 0], i],
                nodes[rods[k, 1], i],
                velocities[rods[k, 0], i],
                velocities[rods[k, 1], i],
            )
            q[0, k, i], q[0, k, 3 + i], v[0, k, i], v[0, k, 3 + i] = b + a, b - a, d + c, d - c
            square += (b - a) ** 2
            along += (b - a) * (d - c)
            speed += (d - c) ** 2
        if not abs(np.sqrt(square) / lengths[k] - 1.0) <= FITS or not abs(along) <= FITS * lengths[k] * np.sqrt(speed):
            return False
    for a in range(own.shape[0]):
        for i in range(3):
            if held[a, i] and (nodes[a, i] != own[a, i] or velocities[a, i] != 0.0):
                return False
    return True


@bare
def leave(rods, own, held, q, v, nodes, velocities):
    """Fill nodes and velocities from the rods' states; what no rod moves stays where the structure has it."""
    for k in range(q.shape[0]):
        for a in range(own.shape[0]):
            for i in range(3):
                nodes[k, a, i], velocities[k, a, i] = own[a, i], 0.0
        for r in range(rods.shape[0]):
            for end in range(2):
                a, sign = rods[r, end], 2.0 * end - 1.0
                for i in range(3):
                    if not held[a, i]:
                        nodes[k, a, i] = 0.5 * (q[k, r, i] + sign * q[k, r, 3 + i])
                        velocities[k, a, i] = 0.5 * (v[k, r, i] + sign * v[k, r, 3 + i])
