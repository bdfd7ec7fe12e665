"""Natural units of inputs, in which numbers of different tendons and of different answers compare.

energy:  u^ = sqrt(dT/du) u, so that |u^|^2/2 is the elastic energy of the shortening
size:    c_t = | |J|'|g_t| / sqrt(m) |, the largest that the drive of tendon t on a mode can be before anything cancels
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.linear import LinearModel


def tension_slopes(linear: LinearModel) -> Float[np.ndarray, " nu"]:
    """Growth of tension with each input, dT/du, N/m; what the law gives, also when slack; of a gang sum g^2 dT/du."""
    rest, members = linear.equilibrium, linear.dynamics.members
    slopes = members.stiffness if members.law == "k" else members.stiffness * rest.lengths / rest.rest_lengths**2
    return members.gearing.squares(slopes[members.inputs])


def energy_inputs(linear: LinearModel) -> Float[np.ndarray, "nx nu"]:
    """B for inputs in the square root of their elastic energy, 1/s: the unit of A."""
    return linear.B / np.sqrt(tension_slopes(linear))


def input_sizes(linear: LinearModel) -> Float[np.ndarray, " nu"]:
    """Bound on each column of B, for verdicts that no unit, stiffness or mass can move; 1 for slack tendons."""
    point, members = linear.equilibrium.point, linear.dynamics.members
    mass = point.potential.manifold.mass(members.mass)
    force = abs(point.tangent).T @ abs(point.terms.input_map[:, members.inputs] @ members.gearing.matrix)
    sizes = np.linalg.norm(force.toarray() / np.sqrt(mass)[:, None], axis=0)
    return np.where(sizes > 0, sizes, 1.0)
