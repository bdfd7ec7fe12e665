"""Is a linear model cyclically symmetric? Structure, rest, materials, dampers and actuators have to be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tensctl.errors import LinearizationError
from tensctl.linear.harmonic_inputs import input_orbits
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium
from tensctl.statics.symmetry import CyclicSymmetry, find_symmetry, not_split

_SMALLEST = 3


def linear_symmetry(dynamics: Dynamics, equilibrium: Equilibrium, tol: float) -> CyclicSymmetry:
    """The cyclic symmetry of largest order n >= 3 that a linear model has; its mismatch counts dampers too.

    Raises
    ------
    LinearizationError
        When there is none, with what breaks it, and for structures that are not split.
    """
    potential = equilibrium.potential
    unsplit = not_split(potential)
    if unsplit:
        raise LinearizationError(
            f"the scene has {unsplit}, which harmonics do not split, symmetric or not; use tc.linearize."
        )
    found = find_symmetry(potential, equilibrium.nodes, equilibrium.rest_lengths, tol=tol)
    if found is None:
        raise LinearizationError(
            "the scene has no cyclic symmetry: no turn by 2 pi/n, n >= 3, carries its nodes, rods, tendons, materials, "
            f"rest lengths, pins and loads onto themselves to {tol:.0e}; use tc.linearize."
        )
    orders = [n for n in range(found.order, _SMALLEST - 1, -1) if found.order % n == 0]
    candidates = [_damped_too(dynamics, _coarser(found, n)) for n in orders if _acts_alike(dynamics, found, n)]
    if not candidates:
        raise LinearizationError(
            f"the structure has {found.order} equal sectors, but its acting tendons differ from sector to sector, or "
            "its motors are not carried onto motors; give each sector the same actuators, or use tc.linearize."
        )
    kept = [symmetry for symmetry in candidates if symmetry.mismatch <= tol]
    if not kept:
        raise LinearizationError(
            f"the structure has {found.order} equal sectors, but their dampers differ by "
            f"{min(symmetry.mismatch for symmetry in candidates):.0e} of the largest; use tc.linearize."
        )
    return kept[0]


def _coarser(symmetry: CyclicSymmetry, order: int) -> CyclicSymmetry:
    """The same symmetry by turns of 2 pi/order, order a divisor of n: a sector is several old ones."""
    members = {name: getattr(symmetry, name).reshape(order, -1) for name in ("nodes", "rods", "tendons")}
    return replace(symmetry, order=order, **members)


def _acts_alike(dynamics: Dynamics, symmetry: CyclicSymmetry, order: int) -> bool:
    """Whether the images of acting tendons act, and those of motors are motors."""
    return input_orbits(dynamics, _coarser(symmetry, order)) is not None


def _damped_too(dynamics: Dynamics, symmetry: CyclicSymmetry) -> CyclicSymmetry:
    damping = dynamics.damping[symmetry.tendons]
    largest = damping.max(initial=0.0)
    mismatch = float(np.ptp(damping, axis=0).max(initial=0.0) / largest) if largest > 0 else 0.0
    return replace(symmetry, mismatch=max(symmetry.mismatch, mismatch))
