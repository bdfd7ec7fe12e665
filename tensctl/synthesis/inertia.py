"""What moving along a path asks of the rest lengths besides the equilibria's: the rods' inertia.

    J'G du = J'M a,   least |du|,   a = N'' k'^2 + N' k''

N(k) are the reference nodes over the place k on the path, M the rods' mass between their ends, m/6 (2 1; 1 2), J the
tangent map and G the pull of a shortening. At an unloaded equilibrium one direction of du pulls at nothing and one
motion is pulled by nothing: what inertia asks of that motion is left to feedback, and so are dampers and drag. Tensions
change by what du does to them with the nodes held.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.threads import one_blas_thread

if TYPE_CHECKING:
    from tensctl.elements import PotentialPoint
    from tensctl.synthesis.path import ShapePath

# Pulls below this part of the largest are none. On the pinned (3,1) and (3,2) the least above has 0.04 and the rest
# 4e-16. The (8,4) mast bends by pulls of 2e-3: with them its tip follows within 8 mm without feedback, without 0.3 m.
_PULLS = 1e-3
# Half the distance, in planned equilibria, over which reference nodes are differenced: 1e-7 of the acceleration.
_APART = 1e-3


@dataclass(frozen=True, eq=False)
class Inertial:
    """What motion adds at some times.

    Attributes
    ----------
    inputs : (times, nu) m
    tensions : (times, nt) N
    left : (times,) N
        Largest force, in tangent coordinates, that no rest length makes.
    """

    inputs: Float[np.ndarray, "times nu"]
    tensions: Float[np.ndarray, "times nt"]
    left: Float[np.ndarray, " times"]


@one_blas_thread()
def inertial(path: ShapePath, times: Float[np.ndarray, " times"]) -> Inertial:
    """What moving along a path adds to its rest lengths and tensions."""
    potential = path.target.potential
    structure, members = potential.structure, potential.members
    mass = _nodal_mass(structure.rods, members.mass, len(structure.nodes))
    inputs, tensions, left = [], [], []
    for t in times:
        place, speed, rate = path.motion(t)
        before, here, after = (path.nodes_of(place + apart) for apart in (-_APART, 0.0, _APART))
        slope, bend = (after - before) / (2 * _APART), (after - 2 * here + before) / _APART**2
        rest = members.rest_lengths.copy()
        rest[members.inputs] -= members.gearing.matrix @ path.balanced_inputs_at(t)
        point = potential.at(here, rest)
        du, missing = _least(point, point.tangent.T @ (mass @ (bend * speed**2 + slope * rate)).ravel())
        inputs.append(du)
        tensions.append(_tensions(point, du))
        left.append(np.abs(missing).max(initial=0.0))
    return Inertial(np.array(inputs), np.array(tensions), np.array(left))


def _nodal_mass(rods: np.ndarray, mass: np.ndarray, count: int) -> sp.csr_array:
    """Mass matrix of the rods' ends, (N, N) kg."""
    tail, head = rods.T
    rows, columns = np.concatenate([tail, head, tail, head]), np.concatenate([tail, head, head, tail])
    entries = np.concatenate([mass / 3, mass / 3, mass / 6, mass / 6])
    return sp.csr_array(sp.coo_array((entries, (rows, columns)), shape=(count, count)))


def _least(point: PotentialPoint, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least change of inputs that makes a force in tangent coordinates, and what it does not make."""
    members = point.potential.members
    pull = (point.input_map[:, members.inputs] @ members.gearing.matrix).toarray()
    du, *_ = np.linalg.lstsq(pull, force, rcond=_PULLS)
    return du, force - pull @ du


def _tensions(point: PotentialPoint, du: np.ndarray) -> np.ndarray:
    """Change of tensions with the nodes held, N."""
    members = point.potential.members
    slope = members.stiffness
    if members.law == "EA":
        slope = slope * point.potential.structure.lengths_at(point.nodes) / point.rest_lengths**2
    change = np.zeros(len(slope))
    change[members.inputs] = slope[members.inputs] * (members.gearing.matrix @ du)
    return change
