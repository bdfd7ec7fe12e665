"""How far from the optimum: bounds by duality, from the multipliers alone.

For any y with A_r'y = 0 the dual function of `program` bounds the optimum, so the distance between a tension field and
that bound is proven, whatever made either. Multipliers are first made square to the rods, as the bound needs it.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from jaxtyping import Float

from tensctl.statics.prestress.program import Program

# Work of a tension that has no bound, relative to the largest: below this the multipliers mean zero and are made so.
_LITTLE_WORK = 1e-6
# What a projection leaves of a zero: 1e-16 times the entries that were added up.
_ROUNDING = 1e-12


def least_squares_gap(
    program: Program,
    weights: Float[np.ndarray, " tendons"],
    target: Float[np.ndarray, " tendons"],
    tensions: Float[np.ndarray, " tendons"],
    multipliers: Float[np.ndarray, " free"],
) -> float:
    """1/2 sum a (T - g)^2 less its dual bound, over the larger of it and 1/2 sum a T^2."""
    y = across_rods(program, multipliers)
    weight, wanted = program.quadratic(weights, target)
    pull = program.tied.T @ y
    best = np.clip(wanted - pull / weight, *program.bounds)
    each = program.tie @ best
    value = 0.5 * float(weights @ (tensions - target) ** 2)
    bound = 0.5 * float(weights @ (each - target) ** 2) + float(pull @ best) + float(y @ program.load)
    return (value - bound) / (max(value, 0.5 * float(weights @ tensions**2)) or 1.0)


def largest_minimum_bound(program: Program, multipliers: Float[np.ndarray, " free"], cap: float = np.inf) -> float:
    """What the smallest tension cannot exceed, N; infinity when the multipliers prove nothing."""
    y = across_rods(program, multipliers)
    pull, high = program.tied.T @ y, program.bounds[1]
    acting = np.flatnonzero(program.acting)
    rising, falling = np.maximum(pull[acting], 0.0), np.maximum(-pull[acting], 0.0)
    # Rounding of a zero must not meet an infinite bound.
    falling[falling <= 1e-12 * np.abs(pull).max(initial=0.0)] = 0.0
    total = float(rising.sum())
    if not total > 0 or (falling[~np.isfinite(high[acting])] > 0).any():
        return cap
    held = float(falling @ np.where(falling > 0, high[acting], 0.0)) - float(y @ program.load)
    return min(cap, held / total)


def contradiction(program: Program, multipliers: Float[np.ndarray, " free"]) -> float:
    """How clearly multipliers prove that no tensions fit: above zero by more than rounding is a proof (Farkas).

    Balance asks for (B'y).tau + y.w = 0 with B = A_t G. When the largest value that the bounds allow is below zero, no
    tau is left; returned is how far below, over the sum of what was added up, for the better sign of y. Tensions
    that do next to no work are made to do none, as rods are; minus infinity where y is not square to the rods then, or
    does work with a tension that has no bound on the side that counts.
    """
    return max(_shortfall(program, multipliers), _shortfall(program, -multipliers))


def _shortfall(program: Program, y: np.ndarray) -> float:
    low, high = program.bounds
    y = across_rods(program, y)
    pull = program.tied.T @ y
    idle = np.abs(pull) <= _LITTLE_WORK * np.abs(pull).max(initial=0.0)
    y = across(sp.csr_array(sp.hstack([program.matrix.rods, program.tied[:, np.flatnonzero(idle)]])), y)
    pull = program.tied.T @ y
    rounding = _ROUNDING * np.abs(y).max(initial=0.0)
    pull = np.where(np.abs(pull) > rounding, pull, 0.0)
    bound = np.where(pull > 0, high, np.where(pull < 0, low, 0.0))
    stretch = np.abs(program.matrix.rods.T @ y).max(initial=0.0)
    if np.isinf(bound).any() or stretch > rounding:
        return -np.inf
    terms = np.concatenate([pull * bound, y * program.load])
    size = float(np.abs(terms).sum())
    return -float(terms.sum()) / size if size > 0 else 0.0


def load_left_over(program: Program) -> Float[np.ndarray, " free"]:
    """The part of the loads that no tensions and rod forces of either sign balance, N; a contradiction if not zero."""
    return across(sp.csr_array(sp.hstack([program.matrix.rods, program.tied])), program.load)


def across_rods(program: Program, y: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """The part of a nodal motion that lengthens no rod."""
    return across(program.matrix.rods[:, np.flatnonzero(program.matrix.acting_rods)], y)


def across(columns: sp.csr_array, y: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """The part of a nodal motion that does no work with any of the columns' forces."""
    if not columns.shape[1]:
        return y
    gram = sp.csc_matrix(columns.T @ columns + 1e-10 * sp.eye_array(columns.shape[1]))
    factor = spla.splu(gram)
    for _ in range(4):
        y = y - columns @ factor.solve(columns.T @ y)
    return y
