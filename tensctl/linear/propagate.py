"""The linear model over a stretch of time in which the input is a straight line, exactly.

    x(t) = F x(0) + G0 u(0) + G1 u(t)

Undamped, every mode eta'' = -z eta + b u goes by itself, z = omega^2, with

    c0 = cos wt,   c1 = sin wt / w,   c2 = (1 - cos wt)/w^2,   c3 = (t - c1)/w^2,   w = sqrt z

    (s eta, eta')(t) = [c0, s c1; -z/s c1, c0] (s eta, eta')(0) + b (s c2, c1) u(0) + b/t (s c3, c2) (u(t) - u(0))

cosh and sinh where z < 0, t^k/k! where z = 0. Slow modes keep every digit however fast others are, and nothing
overflows; the phase of a mode is as exact as the product w t in double precision, eps w t. With dampers modes mix, and
with lag they follow rest lengths that are states: one matrix exponential of the whole then gives F, G0 and G1; its
errors are about eps times the norm of A t, in every mode alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.linear.model import LinearModel
from tensctl.linear.sampling import sample_ramped

# Below this phase c3 is summed as a series, whose twelve terms are exact there; above it nothing cancels.
_SMALL = 1.0
_TERMS = 12


@dataclass(frozen=True, eq=False)
class Stretch:
    """Effect of the state and of the input at both ends of a stretch of time.

    Attributes
    ----------
    F : (nx, nx)
    G0, G1 : (nx, nu)
    """

    F: Float[np.ndarray, "nx nx"]
    G0: Float[np.ndarray, "nx nu"]
    G1: Float[np.ndarray, "nx nu"]


def stretch(linear: LinearModel, t: float) -> Stretch:
    """The model over t seconds."""
    if t == 0.0:
        nx, nu = linear.B.shape
        return Stretch(np.eye(nx), np.zeros((nx, nu)), np.zeros((nx, nu)))
    if linear.dynamics.damped or linear.lag:
        sampled = sample_ramped(linear.A, linear.B, t)
        return Stretch(sampled.F, sampled.G0, sampled.G1)
    count, s = len(linear.modes), linear.scales
    z = np.array([0.0 if mode.kind == "rigid-body" else mode.omega2 for mode in linear.modes])
    c0, c1, c2, c3 = responses(z, t)
    F = np.block([[np.diag(c0), np.diag(s * c1)], [np.diag(-z / s * c1), np.diag(c0)]])
    drive = np.empty_like(linear.B)
    drive[linear.order] = linear.B
    b = drive[count:]
    held = np.vstack([(s * c2)[:, None] * b, c1[:, None] * b])
    ramp = np.vstack([(s * c3 / t)[:, None] * b, (c2 / t)[:, None] * b])
    order = linear.order
    return Stretch(F[np.ix_(order, order)], (held - ramp)[order], ramp[order])


def responses(z: Float[np.ndarray, " modes"], t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """c0, c1, c2 and c3 of each z, which may be negative or zero."""
    w = np.sqrt(np.abs(z))
    a, swings = w * t, z >= 0
    c0 = np.where(swings, np.cos(a), np.cosh(np.where(swings, 0.0, a)))
    c1 = t * _over(a, swings)
    c2 = 0.5 * t**2 * _over(0.5 * a, swings) ** 2
    series, term = np.zeros_like(a), np.full_like(a, t**3 / 6)
    for k in range(_TERMS):
        series += term
        term = -term * np.sign(z) * np.minimum(a, _SMALL) ** 2 / ((2 * k + 4) * (2 * k + 5))
    c3 = np.where(a < _SMALL, series, (t - c1) / np.where(a < _SMALL, 1.0, z))
    return c0, c1, c2, c3


def _over(a: np.ndarray, swings: np.ndarray) -> np.ndarray:
    """sin(a)/a, or sinh(a)/a where the mode does not swing."""
    grows = np.where(swings, 1.0, np.maximum(a, np.finfo(float).tiny))
    return np.where(swings, np.sinc(a / np.pi), np.sinh(grows) / grows)
