"""Energy and momentum of recorded motion: what an undamped, unpushed structure keeps.

E = sum m |q1'|^2/8 + m |q2'|^2/24 (free rods), m |q2'|^2/6 (rods turning about a pin), plus the potential
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold, rod_energy
from tensctl.model import Dynamics
from tensctl.simulation.run import Run


def total_energy(dynamics: Dynamics, run: Run) -> Float[np.ndarray, " t"]:
    """Kinetic and potential energy at each recorded time, J."""
    return np.array([energy_at(dynamics, run, k) for k in range(len(run.time))])


def energy_at(dynamics: Dynamics, run: Run, k: int) -> float:
    """Kinetic and potential energy at one recorded time, by its index, J."""
    return dynamics.potential.at(run.nodes[k], run.rest_lengths[k]).energy + _kinetic(dynamics, run.velocities[k])


def _kinetic(dynamics: Dynamics, velocities: np.ndarray) -> float:
    rates, hold = dynamics.rod_coordinates(velocities), dynamics.potential.manifold.hold
    energy = 0.0
    for rate, how, mass in zip(rates, hold, dynamics.members.mass, strict=True):
        if how == Hold.FREE:
            energy += float(rod_energy(Hold.FREE)(rate[:3], rate[3:], mass))
        elif how != Hold.FIXED:
            energy += float(rod_energy(Hold(how))(rate[3:], mass))
    return energy


def momenta(dynamics: Dynamics, run: Run) -> tuple[Float[np.ndarray, "t 3"], Float[np.ndarray, "t 3"]]:
    """Linear momentum, kg m/s, and angular momentum about the origin, kg m^2/s, at each recorded time."""
    rods, mass = dynamics.structure.rods, dynamics.members.mass
    tail, head = run.nodes[:, rods[:, 0]], run.nodes[:, rods[:, 1]]
    tail_rate, head_rate = run.velocities[:, rods[:, 0]], run.velocities[:, rods[:, 1]]
    centre, drift = 0.5 * (tail + head), 0.5 * (tail_rate + head_rate)
    linear = np.einsum("r,tri->ti", mass, drift)
    orbital = np.einsum("r,tri->ti", mass, np.cross(centre, drift))
    spin = np.einsum("r,tri->ti", mass / 12, np.cross(head - tail, head_rate - tail_rate))
    return linear, orbital + spin
