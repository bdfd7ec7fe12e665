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
    acting = np.flatnonzero(program.tie.T @ program.matrix.acting_tendons.astype(float) > 0)
    rising, falling = np.maximum(pull[acting], 0.0), np.maximum(-pull[acting], 0.0)
    # Rounding of a zero must not meet an infinite bound.
    falling[falling <= 1e-12 * np.abs(pull).max(initial=0.0)] = 0.0
    total = float(rising.sum())
    if not total > 0 or (falling[~np.isfinite(high[acting])] > 0).any():
        return cap
    held = float(falling @ np.where(falling > 0, high[acting], 0.0)) - float(y @ program.load)
    return min(cap, held / total)


def across_rods(program: Program, y: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
    """The part of a nodal motion that lengthens no rod."""
    R = program.matrix.rods[:, np.flatnonzero(program.matrix.acting_rods)]
    if not R.shape[1]:
        return y
    gram = sp.csc_matrix(R.T @ R + 1e-10 * sp.eye_array(R.shape[1]))
    factor = spla.splu(gram)
    for _ in range(4):
        y = y - R @ factor.solve(R.T @ y)
    return y
