"""The curve of rests g(xi, lambda) = 0 under loads w0 + lambda w and rest lengths L0 - lambda u, and one step along it.

    H t_xi + g_lambda t_lambda = 0,   |t_xi|^2/(N a^2) + t_lambda^2 = 1      (a mean rod length, N degrees of freedom)

A step goes ds along the unit tangent and comes back to the curve by Newton on (g, t . (step) - ds). The matrix
[[H, g_lambda], [t_xi', t_lambda]] stays regular where the curve folds (H singular, t_lambda = 0) and is singular where
two curves cross. A tendon that goes slack or taut kinks the curve; Newton is semismooth there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from jaxtyping import Float

from tensctl.elements import Potential, PotentialPoint
from tensctl.errors import EquilibriumError
from tensctl.statics.balance import attainable, residual
from tensctl.statics.newton import orthonormal
from tensctl.statics.rigid import unseen_motions
from tensctl.statics.trust_region import grounded

# Newton steps back to the curve before it is given up.
_CORRECTIONS = 12
_ROUNDINGS = 10.0


@dataclass(frozen=True, eq=False)
class Curve:
    """Loads and rest lengths as functions of lambda.

    Attributes
    ----------
    potential : Potential
    base, loads : (N, 3) N
        w0 and w.
    shortening : (nt,) m
        u of every tendon.
    tol : float
        Residual at which a rest is met.
    """

    potential: Potential
    base: Float[np.ndarray, "nodes 3"]
    loads: Float[np.ndarray, "nodes 3"]
    shortening: Float[np.ndarray, " tendons"]
    tol: float

    def potential_at(self, parameter: float) -> Potential:
        """Structure, loads and materials at lambda."""
        forces = self.base + parameter * self.loads
        rest = self.potential.members.rest_lengths - parameter * self.shortening
        return replace(self.potential, members=replace(self.potential.members, forces=forces, rest_lengths=rest))

    def at(self, nodes: np.ndarray, parameter: float) -> PotentialPoint:
        """The potential at nodes and lambda."""
        return self.potential_at(parameter).at(nodes)

    def slope(self, point: PotentialPoint) -> Float[np.ndarray, " size"]:
        """dg/dlambda, N."""
        return -(point.tangent.T @ self.loads.ravel()) - point.input_map @ self.shortening

    @cached_property
    def unit(self) -> float:
        """Norm of the displacement that counts as much as lambda = 1: the mean rod length in every coordinate, m."""
        manifold = self.potential.manifold
        return float(manifold.lengths.mean() * np.sqrt(max(manifold.size, 1)))

    def row(self, point: PotentialPoint, moved: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, " size"]:
        """Arclength along a nodal displacement, per coordinate at the point."""
        return self.potential.manifold.coordinates_of(point.nodes, moved.reshape(-1, 1))[:, 0] / self.unit**2


@dataclass(frozen=True, eq=False)
class Place:
    """A rest on the curve, with the unit tangent there as nodal displacements (m) and change of lambda."""

    point: PotentialPoint
    parameter: float
    moved: Float[np.ndarray, "nodes 3"]
    change: float


def placed(curve: Curve, point: PotentialPoint, parameter: float, moved: np.ndarray, change: float) -> Place:
    """A rest with its unit tangent, on the side of a nodal displacement and a change of lambda.

    Raises
    ------
    EquilibriumError
        Where the curve crosses another one.
    """
    solve = _bordered(curve, point, curve.row(point, moved), change)
    if solve is None:
        raise EquilibriumError(f"the rests cannot be followed beyond lambda = {parameter:.6g}: two curves cross there.")
    tangent = solve(np.append(np.zeros(curve.potential.manifold.size), 1.0))
    tangent /= np.sqrt((tangent[:-1] @ tangent[:-1]) / curve.unit**2 + tangent[-1] ** 2)
    return Place(point, parameter, (point.tangent @ tangent[:-1]).reshape(-1, 3), float(tangent[-1]))


def advanced(curve: Curve, place: Place, length: float) -> tuple[Place, int] | None:
    """The rest at an arclength further on and the Newton steps it took; nothing when it is not met."""
    manifold, origin = curve.potential.manifold, place.point.nodes
    before = curve.row(place.point, place.moved)
    guess = manifold.retract(origin, length * curve.unit**2 * before)

    def travelled(nodes: np.ndarray, parameter: float) -> float:
        chord = manifold.coordinates_of(origin, (nodes - origin).reshape(-1, 1))[:, 0]
        return float(before @ chord) + place.change * (parameter - place.parameter) - length

    return _closed(curve, guess, place.parameter + length * place.change, place, travelled)


def landed(curve: Curve, place: Place, parameter: float) -> Place | None:
    """The rest at a given lambda nearby, on the same branch even where that is unstable."""
    still = Place(place.point, place.parameter, np.zeros_like(place.moved), 1.0)
    found = _closed(curve, place.point.nodes, parameter, still, lambda _, at: at - parameter)
    return None if found is None else placed(curve, found[0].point, parameter, place.moved, place.change)


def _closed(
    curve: Curve, nodes: np.ndarray, parameter: float, place: Place, miss: Callable[[np.ndarray, float], float]
) -> tuple[Place, int] | None:
    """Newton on (g, miss), the row of the second equation being the tangent of `place`."""
    manifold, lefts = curve.potential.manifold, []
    for k in range(_CORRECTIONS):
        point = curve.at(nodes, parameter)
        lefts.append(residual(point))
        if lefts[-1] <= max(curve.tol, _ROUNDINGS * attainable(point)):
            return placed(curve, point, parameter, place.moved, place.change), k
        if not np.isfinite(lefts[-1]) or (k > 3 and lefts[-1] > 0.9 * lefts[-2]):
            return None
        solve = _bordered(curve, point, curve.row(point, place.moved), place.change)
        if solve is None:
            return None
        step = solve(-np.append(point.gradient, miss(nodes, parameter)))
        if not np.linalg.norm(step[:-1]) < curve.unit:  # further than a rod length: this is another rest, or none
            return None
        nodes, parameter = manifold.retract(nodes, step[:-1]), parameter + float(step[-1])
    return None


def _bordered(
    curve: Curve, point: PotentialPoint, row: np.ndarray, corner: float
) -> Callable[[np.ndarray], np.ndarray] | None:
    """Solver of [[H, g_lambda], [row, corner]], the rigid-body motions held; nothing where it is singular."""
    held = orthonormal(unseen_motions(point.potential, point.nodes).basis)
    blocks = [[grounded(point.hessian, held), curve.slope(point)[:, None]], [row[None], np.array([[corner]])]]
    try:
        return spla.splu(sp.block_array(blocks, format="csc")).solve
    except RuntimeError:  # exactly singular; SciPy has no narrower class for it
        return None
