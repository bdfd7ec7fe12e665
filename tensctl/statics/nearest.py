"""The nearest shape that can be held, when no prestress holds the one that was asked for.

    minimise 1/2 |p - wanted|^2   over nodes p, force densities omega of tendons, lambda of rods
    subject to   |p_head - p_tail|^2 = L_rod^2,   sum omega d - sum lambda d + w = 0 at every free node component,
                 tension_min <= omega l <= what the rest-length floor allows

CasADi gives exact derivatives, IPOPT a local minimum; the answer is then settled on the rods' manifold by Newton, so
that its balance holds to rounding, and its optimality is computed again without IPOPT (`stationarity`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy.optimize
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.errors import EquilibriumError
from tensctl.statics.equilibrium import Equilibrium, settle
from tensctl.statics.prestress.admissible import PerTendon, per_tendon
from tensctl.statics.prestress.law import ceiling_of, rest_length_of
from tensctl.statics.prestress.matrix import equilibrium_matrix
from tensctl.statics.prestress.nearest_program import nearest_program
from tensctl.statics.prestress.self_stress import rod_motions
from tensctl.statics.prestress.stress_matrix import second_variation
from tensctl.structure.structure import lengths

# Settling moves a converged answer by rounding only. More than this part of the size: the shape is no stable rest.
_SETTLED = 1e-6
# Distances below this part of the size are not told apart by their direction: solvers stop 1e-9 of the size short.
_WORTH = 1e-2
# A tension within this part of its ceiling from a bound counts as on it: interior-point answers stop 1e-10 short.
_ACTIVE = 1e-7


@dataclass(frozen=True, eq=False)
class NearestShape:
    """The nearest shape that rest lengths can hold.

    Attributes
    ----------
    wanted : (N, 3) m
        Nodes that were asked for.
    tension_min, tension_max : (nt,) N
    equilibrium : Equilibrium
        The shape that is held, with its rest lengths.
    """

    wanted: Float[np.ndarray, "nodes 3"]
    tension_min: Float[np.ndarray, " tendons"]
    tension_max: Float[np.ndarray, " tendons"]
    equilibrium: Equilibrium

    @property
    def displacements(self) -> Float[np.ndarray, "nodes 3"]:
        """From the wanted nodes to the held ones, m."""
        return self.equilibrium.nodes - self.wanted

    @property
    def distance(self) -> float:
        """Root of the summed squares of the nodes' distances, m: what was minimised."""
        return float(np.linalg.norm(self.displacements))

    @property
    def largest(self) -> float:
        """Largest distance of one node, m."""
        return float(np.linalg.norm(self.displacements, axis=1).max(initial=0.0))

    @cached_property
    def stationarity(self) -> float:
        """How much of the pull towards the wanted nodes is left along shapes that can be held.

        Relative to the distance, or to a hundredth of the structure's size where the distance is smaller still.

        Zero at a local minimum: no first-order change of nodes and tensions that keeps balance, rods, floors and
        ceilings comes nearer. With B the motions that lengthen no rod, H the second variation at constant tension and
        S = -A_t'B the stretch, the multipliers solve B'(p - wanted) + H lambda = S'K y and S lambda = z - y, where
        z >= 0 belongs to floors of tension, y >= 0 to its ceilings and K is how the ceiling grows with length.
        """
        rest, structure = self.equilibrium, self.equilibrium.structure
        matrix = equilibrium_matrix(structure, rest.nodes)
        basis = rod_motions(structure, rest.nodes).left_null
        bend = second_variation(matrix, rest.tensions, rest.rod_forces, np.zeros(rest.tensions.size), basis)
        size = max(self.distance, _WORTH * float(np.ptp(rest.nodes, axis=0).max()))
        pull = basis.T @ self.displacements.ravel()[matrix.free] / size
        stretch = -(matrix.tendons.T @ basis)
        slope, shift = ceiling_of(rest.potential.members)
        ceiling = np.minimum(slope * rest.lengths - shift, self.tension_max)
        growth = np.where(ceiling < self.tension_max, slope, 0.0)
        low = np.flatnonzero(rest.tensions <= self.tension_min + _ACTIVE * ceiling)
        high = np.flatnonzero(rest.tensions >= ceiling * (1 - _ACTIVE))
        scale = float(np.abs(bend).max(initial=0.0)) or 1.0
        unit = np.eye(len(stretch))
        left = np.block(
            [
                [bend / scale, np.zeros((len(bend), low.size)), -(growth[high, None] * stretch[high]).T / scale],
                [stretch, -unit[:, low], unit[:, high]],
            ]
        )
        right = -np.concatenate([pull, np.zeros(len(stretch))])
        lowest = np.concatenate([np.full(len(bend), -np.inf), np.zeros(low.size + high.size)])
        return float(np.linalg.norm(_least_bounded(left, right, lowest)))

    def verify(self, tol: float = 1e-9, stationarity: float = 1e-5) -> None:
        """Check balance, rods, tension floors, rest-length floors and local optimality.

        Raises
        ------
        EquilibriumError
            With the first check that fails and its number.
        """
        rest = self.equilibrium
        rest.verify(tol)
        kept = ~rest.structure.grounded_tendons
        scale = float(rest.tensions.max(initial=0.0)) or 1.0
        low = ((self.tension_min - rest.tensions) / scale)[kept].max(initial=0.0)
        high = ((rest.tensions - self.tension_max) / scale)[kept].max(initial=0.0)
        short = ((rest.potential.members.floors - rest.rest_lengths) / rest.lengths)[kept].max(initial=0.0)
        for text, value, limit in (
            ("a tension is below tension_min", low, 1e-6),
            ("a tension is above tension_max", high, 1e-6),
            ("a rest length is below its floor", short, 1e-6),
            ("the shape is not the nearest", self.stationarity, stationarity),
        ):
            if not value <= limit:
                raise EquilibriumError(f"{text}: {value:.1e}, relative; at most {limit:.0e} is expected.")


def nearest_shape(
    potential: Potential,
    wanted: Float[np.ndarray, "nodes 3"] | None = None,
    *,
    tension_min: PerTendon,
    tension_max: PerTendon = np.inf,
    start: Equilibrium | None = None,
    max_iterations: int = 500,
) -> NearestShape:
    """Find the nodes nearest to the wanted ones that some rest lengths hold with every tension above a floor.

    Parameters
    ----------
    wanted : (N, 3) m, optional
        Any nodes, rods need not fit; the structure's own by default.
    tension_min, tension_max : number, table by label pattern, or (nt,), N
        Without a ceiling the nearest shape often asks for very uneven tensions, up to rest lengths at their floors.
    start : Equilibrium, optional
        Where the search begins; without one it begins at the wanted nodes, which finds a local minimum nearby.

    Returns
    -------
    NearestShape
        A local minimum: other starts may find nearer ones. `.equilibrium.stable` says whether it holds by itself.

    Raises
    ------
    EquilibriumError
        When no shape near the wanted one can be held.
    """
    structure, members = potential.structure, potential.members
    wanted = structure.nodes if wanted is None else np.asarray(wanted, float)
    floor = per_tendon(tension_min, structure.tendon_labels, "tension_min")
    highest = per_tendon(tension_max, structure.tendon_labels, "tension_max")
    equilibrium_matrix(structure, wanted)  # refuses nodes of the wrong shape and members without direction
    problem, bounds, guess = nearest_program(potential, wanted, (floor, highest), start)
    options: dict[str, Any] = {
        "print_time": False,
        "ipopt": {
            "print_level": 0, "sb": "yes", "tol": 1e-11, "max_iter": max_iterations, "bound_relax_factor": 0.0,
            "fixed_variable_treatment": "make_constraint",
        },
    }  # fmt: skip
    solver = ca.nlpsol("nearest", "ipopt", problem, options)
    x = np.asarray(solver(x0=guess, **bounds)["x"]).ravel()
    count = int((~structure.pinned).sum())
    nodes = wanted.copy()
    nodes[structure.pinned] = structure.nodes[structure.pinned]
    nodes[~structure.pinned] = x[: 3 * count].reshape(-1, 3)
    nodes = potential.manifold.retract(nodes, np.zeros(potential.manifold.size))
    length = lengths(nodes, structure.tendons)
    rest = rest_length_of(members, length, x[3 * count : 3 * count + length.size] * length)
    rest = np.where(structure.grounded_tendons, members.rest_lengths, rest)
    return NearestShape(wanted, floor, highest, _settled(potential, nodes, rest, floor))


def _settled(potential: Potential, nodes: np.ndarray, rest: np.ndarray, floor: np.ndarray) -> Equilibrium:
    """The solver's shape, taken to rounding by Newton where it is a stable rest, and judged by its own balance."""
    found = Equilibrium(potential, nodes, rest, 0)
    if found.residual > 1e-3 or (found.tensions < 0.5 * floor)[~potential.structure.grounded_tendons].any():
        raise EquilibriumError(
            f"no shape near the wanted one can be held with tensions >= {floor.max(initial=0.0):.4g} N: the search "
            f"ended with {found.residual:.1e} of the largest force out of balance; lower tension_min, give a start, or "
            "check that loads are held by pins."
        )
    try:
        there = replace(potential, members=replace(potential.members, rest_lengths=rest))
        rests = settle(there, start=nodes)
    except EquilibriumError:
        return found
    near = np.abs(rests.nodes - nodes).max(initial=0.0) <= _SETTLED * np.ptp(nodes, axis=0).max(initial=0.0)
    if not near or rests.residual > found.residual:
        return found
    return Equilibrium(potential, rests.nodes, rest, rests.iterations)


def _least_bounded(left: np.ndarray, right: np.ndarray, low: np.ndarray) -> np.ndarray:
    """What is left over of left x = right with x >= low, in least squares."""
    x = scipy.optimize.lsq_linear(left, right, (low, np.inf), method="bvls", tol=1e-14, max_iter=1000).x
    return left @ x - right
