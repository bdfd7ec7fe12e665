"""Newton on the rods' manifold with a trust region and absolute curvatures.

Each step solves (|H| + mu I) s = -g: negative curvatures are taken by their size, so a saddle repels instead of
attracts, and mu >= 0 keeps the step within the trust region. Tendons that go slack or taut bend the gradient but never
break it, so the method is a semismooth Newton there. A refused step is taken again, shorter, from the same factor.

Rigid-body motions that no load sees are known in closed form and get no step, so rounding cannot send the structure on
its way along them. Energies near the end are rounding, and the residual decides instead; it goes down to about 1e-16
of stiffness times length over the largest tension, so a prestress of 1e-9 of k l ends near 1e-7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from jaxtyping import Float

from tensctl.elements import JointedManifold, Potential, PotentialPoint
from tensctl.statics.balance import residual
from tensctl.statics.rigid import unseen_motions
from tensctl.statics.trust_region import Model, dense_model, krylov_model

# A step that gains less than this part of what the model promised is refused.
_ACCEPT = 1e-4
# Below this relative change energies are rounding, and the gradient decides instead.
_ENERGY_NOISE = 1e-13
# First trust radius, root mean square over coordinates, in rod lengths. From the cylinder to (12,6), free and pinned,
# 0.05 needs at most 8 steps; 0.1 to 0.3 need up to 13, because the first step overshoots and many tendons go slack.
_FIRST_RADIUS = 0.05
# Up to this many degrees of freedom all eigenvectors cost no more than a sparse factor and its Krylov space.
_DENSE = 60
DENSE_SECTOR = 60


class Landscape(Protocol):
    """What the descent asks of an energy on a manifold: a whole structure, or one sector of it."""

    @property
    def scale(self) -> float:
        """Mean rod length, m."""
        ...

    @property
    def dense(self) -> bool:
        """Whether the Hessian is best taken as a full matrix."""
        ...

    def at(self, nodes: np.ndarray) -> Any:
        """The point with its energy, gradient and Hessian."""
        ...

    def retract(self, nodes: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Nodes after a step."""
        ...

    def residual(self, point: Any) -> float:
        """Largest unbalanced force over the largest tension or load."""
        ...

    def held(self, point: Any) -> np.ndarray:
        """Motions without step, orthonormal columns."""
        ...


@dataclass(frozen=True, eq=False)
class Whole:
    """All of a structure with given rest lengths."""

    potential: Potential
    rest_lengths: Float[np.ndarray, " tendons"]

    @property
    def scale(self) -> float:
        """Mean rod length, m."""
        return float(self.potential.manifold.lengths.mean())

    @property
    def dense(self) -> bool:
        """Whether the structure is small, or its joints fill the Hessian."""
        return self.potential.manifold.size <= _DENSE or isinstance(self.potential.manifold, JointedManifold)

    def at(self, nodes: np.ndarray) -> PotentialPoint:
        """The potential at the nodes."""
        return self.potential.at(nodes, self.rest_lengths)

    def retract(self, nodes: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Nodes after a step, exactly on the manifold."""
        return self.potential.manifold.retract(nodes, step)

    def residual(self, point: PotentialPoint) -> float:
        """Largest unbalanced force over the largest tension or load."""
        return residual(point)

    def held(self, point: PotentialPoint) -> np.ndarray:
        """Rigid-body motions that no load sees."""
        return orthonormal(unseen_motions(self.potential, point.nodes).basis)


def orthonormal(vectors: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the columns, which are independent."""
    return np.linalg.qr(vectors)[0] if vectors.shape[1] else vectors


@dataclass(frozen=True, eq=False)
class Newton:
    """Settings of the search for an equilibrium.

    Attributes
    ----------
    tol : float
        Stop when `residual` falls to this.
    max_iterations : int
        Steps tried.
    """

    tol: float = 1e-12
    max_iterations: int = 200

    def minimise(
        self, potential: Potential, nodes: Float[np.ndarray, "nodes 3"], rest_lengths: np.ndarray
    ) -> tuple[PotentialPoint, int]:
        """Go down from the given nodes; return the last point and the number of steps tried."""
        return self.descend(Whole(potential, rest_lengths), nodes)

    def descend(self, land: Landscape, nodes: np.ndarray) -> tuple[Any, int]:
        """`minimise` on any landscape."""
        point = land.at(nodes)
        best, radius = land.residual(point), _FIRST_RADIUS * land.scale
        model: Model | None = None
        tried = stalled = 0
        while best > self.tol and tried < self.max_iterations and stalled < 3:
            tried += 1
            model = _model(land, point) if model is None else model
            step, promised = model.step(radius)
            trial = land.at(land.retract(point.nodes, step))
            near_end = promised <= _ENERGY_NOISE * max(abs(point.energy), abs(trial.energy), promised)
            gain, left = point.energy - trial.energy, land.residual(trial)
            if gain > _ACCEPT * promised or (near_end and left < best):
                ratio = 1.0 if near_end else gain / promised
                radius = _next_radius(radius, _size(step), ratio)
                stalled = stalled + 1 if near_end and left > 0.5 * best else 0
                point, best, model = trial, left, None
            elif near_end:
                stalled = 3
            else:
                radius = 0.25 * _size(step)
                stalled = 3 if radius < 1e-15 * land.scale else 0
        return point, tried


def _model(land: Landscape, point: Any) -> Model:
    build = dense_model if land.dense else krylov_model
    return build(point.hessian, point.gradient, land.held(point))


def _size(step: np.ndarray) -> float:
    """Root mean square of the step, m: comparable between small and large structures."""
    return float(np.linalg.norm(step) / np.sqrt(max(step.size, 1)))


def _next_radius(radius: float, size: float, ratio: float) -> float:
    if ratio < 0.25:
        return 0.5 * size
    return max(radius, 2.0 * size) if ratio > 0.5 else radius
