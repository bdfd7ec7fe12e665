"""Natural units of inputs, in which numbers of different tendons and of different answers compare.

energy:  u^ = sqrt(dT/du) u, so that |u^|^2/2 is the elastic energy of the shortening
size:    c_t = | |J|'|g_t| / sqrt(m) |, the largest that the drive of tendon t on a mode can be before anything cancels
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float, Int

from tensctl.linear import HarmonicModel, LinearModel


def tension_slopes(linear: LinearModel | HarmonicModel) -> Float[np.ndarray, " nu"]:
    """Growth of tension with each input, dT/du, N/m; what the law gives, also when slack; of a gang sum g^2 dT/du."""
    rest, members = linear.equilibrium, linear.dynamics.members
    slopes = members.stiffness if members.law == "k" else members.stiffness * rest.lengths / rest.rest_lengths**2
    return members.gearing.squares(slopes[members.inputs])


def input_stiffness(linear: LinearModel | HarmonicModel) -> Float[np.ndarray, " nu"]:
    """Stiffness dT/dl that each input works against, N/m: the natural unit of cost for changing a rest length.

    k, or EA/L: `tension_slopes` over l/L, which is the same for the law of constant stiffness.
    """
    members = linear.dynamics.members
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    return members.gearing.squares(stiffness[members.inputs])


def energy_inputs(linear: LinearModel) -> Float[np.ndarray, "nx nu"]:
    """B for inputs in the square root of their elastic energy, 1/s: the unit of A."""
    return linear.B / np.sqrt(tension_slopes(linear))


def input_sizes(
    linear: LinearModel | HarmonicModel, among: Int[np.ndarray, " chosen"] | None = None
) -> Float[np.ndarray, " chosen"]:
    """Bound on each column of B, for verdicts that no unit, stiffness or mass can move; 1 for slack tendons.

    Parameters
    ----------
    among : (chosen,) int, optional
        Inputs to look at; all by default.
    """
    point, members = linear.equilibrium.point, linear.dynamics.members
    root = np.sqrt(point.potential.manifold.mass(members.mass))
    gears = sp.csc_array(members.gearing.matrix)
    gears = gears if among is None else gears[:, among]
    force = abs(point.tangent).T @ abs(point.terms.input_map[:, members.inputs] @ gears)
    sizes = np.sqrt((sp.csc_array(sp.diags_array(1 / root) @ force) ** 2).sum(axis=0))
    return np.where(sizes > 0, sizes, 1.0)
