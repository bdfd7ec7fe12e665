"""Newton on the rods' manifold with a trust region and absolute curvatures.

Each step solves (|H| + mu I) s = -g in the eigenbasis of the Hessian: negative curvatures are taken by their size, so
a saddle repels instead of attracts, and mu >= 0 keeps the step within the trust region. Tendons that go slack or taut
bend the gradient but never break it, so the method is a semismooth Newton there.

Rigid-body motions, which the energy of an unloaded structure does not see, are known in closed form and get the largest
curvature, so rounding cannot send the structure on its way along them. Other curvatures below 1e-15 of the largest are
noise and get no step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
from jaxtyping import Float

from tensctl.elements import Potential, PotentialPoint
from tensctl.statics.balance import residual
from tensctl.statics.rigid import rigid_motions

# A step that gains less than this part of what the model promised is refused.
_ACCEPT = 1e-4
# Below this relative change energies are rounding, and the gradient decides instead.
_ENERGY_NOISE = 1e-13
_CURVATURE_NOISE = 1e-15
# First trust radius, root mean square over coordinates, in rod lengths. From the cylinder to (12,6), free and pinned,
# 0.05 needs at most 8 steps; 0.1 to 0.3 need up to 13, because the first step overshoots and many tendons go slack.
_FIRST_RADIUS = 0.05


@dataclass(frozen=True, eq=False)
class Newton:
    """Settings of the search for an equilibrium.

    Attributes
    ----------
    tol : float
        Stop when `residual` falls to this.
    max_iterations : int
        Factorisations allowed.
    """

    tol: float = 1e-12
    max_iterations: int = 200

    def minimise(
        self, potential: Potential, nodes: Float[np.ndarray, "nodes 3"], rest_lengths: np.ndarray
    ) -> tuple[PotentialPoint, int]:
        """Go down from the given nodes; return the last point and the number of steps tried."""
        point = potential.at(nodes, rest_lengths)
        best = residual(point)
        radius = _FIRST_RADIUS * float(potential.manifold.lengths.mean())
        tried = stalled = 0
        while best > self.tol and tried < self.max_iterations and stalled < 3:
            tried += 1
            step, promised = _trust_step(point, radius)
            trial = potential.at(potential.manifold.retract(point.nodes, step), rest_lengths)
            gain = point.energy - trial.energy
            noise = _ENERGY_NOISE * max(abs(point.energy), abs(trial.energy), promised)
            near_end = promised <= noise
            left = residual(trial)
            if gain > _ACCEPT * promised or (near_end and left < best):
                ratio = 1.0 if near_end else gain / promised
                radius = _next_radius(radius, _size(step), ratio)
                stalled = stalled + 1 if near_end and left > 0.5 * best else 0
                point, best = trial, left
            elif near_end:
                stalled = 3
            else:
                radius = 0.25 * _size(step)
                stalled = 3 if radius < 1e-15 * potential.manifold.lengths.mean() else 0
        return point, tried


def _size(step: np.ndarray) -> float:
    """Root mean square of the step, m: comparable between small and large structures."""
    return float(np.linalg.norm(step) / np.sqrt(max(step.size, 1)))


def _next_radius(radius: float, size: float, ratio: float) -> float:
    if ratio < 0.25:
        return 0.5 * size
    return max(radius, 2.0 * size) if ratio > 0.5 else radius


def _trust_step(point: PotentialPoint, radius: float) -> tuple[np.ndarray, float]:
    """Step within the trust region and the decrease of energy that the quadratic model promises."""
    curvature, basis = sla.eigh(_held(point), overwrite_a=True, check_finite=False)
    slope = basis.T @ point.gradient
    size = np.abs(curvature)
    live = size > _CURVATURE_NOISE * size.max(initial=0.0)
    slope, size = np.where(live, slope, 0.0), np.where(live, size, 1.0)
    step = -slope / (size + _shift(slope, size, radius * np.sqrt(slope.size)))
    promised = -(slope @ step) - 0.5 * (curvature * live) @ step**2
    return basis @ step, float(promised)


def _held(point: PotentialPoint) -> np.ndarray:
    """Hessian across the rigid-body motions, and on them as stiff as the stiffest mode, dense.

    Without loads the energy sees no rigid-body motion at all; with loads every motion counts as it is.
    """
    hessian = point.hessian.toarray()
    if point.potential.members.forces.any():
        return hessian
    motions, _ = np.linalg.qr(rigid_motions(point.potential, point.nodes).basis)
    across = hessian - motions @ (motions.T @ hessian)
    across -= (across @ motions) @ motions.T
    return across + np.abs(hessian).sum(axis=1).max(initial=0.0) * (motions @ motions.T)


def _shift(slope: np.ndarray, size: np.ndarray, limit: float) -> float:
    """Smallest mu >= 0 with |slope/(size + mu)| <= limit, by Newton on the secular equation."""
    mu = 0.0
    for _ in range(50):
        step = slope / (size + mu)
        length = np.linalg.norm(step)
        if length <= 1.001 * limit:
            break
        mu += float((length / limit - 1.0) * length**2 / (step**2 @ (1.0 / (size + mu))))
    return mu
