"""Inputs of a cyclically symmetric structure: tendons and motors with their images, and what they pull by harmonic.

A motor of ratios G_s on the tendons of sector s, which comes back to itself after l turns, shortens in harmonic k

    gear_k = l^1/2 n^-1/2 sum_s exp(-2 pi i k s/n) G_s,   k l = 0 mod n

per unit of its own harmonic. A tendon with an actuator of its own has l = n and gear 1.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Inexact, Int

from tensctl.linear.harmonic_map import is_real
from tensctl.model import Dynamics
from tensctl.statics.symmetry import CyclicSymmetry

# Ratios of a motor and of its image that differ by less than this part are equal.
_EQUAL = 1e-12


def input_orbits(dynamics: Dynamics, symmetry: CyclicSymmetry) -> tuple[Int[np.ndarray, "_ _"], ...] | None:
    """Positions in u of the inputs in rows of images, those of one length l together, the longest first.

    None where the image of an acting tendon does not act, or that of a motor is no motor.
    """
    acts = np.isin(symmetry.tendons, dynamics.members.inputs)
    if not (acts == acts[0]).all():
        return None
    acting, gearing = _acting(dynamics, symmetry), dynamics.members.gearing
    motor, ratio = gearing.motor[acting], gearing.ratio[acting]
    onward = np.full(gearing.size, -1)
    onward[motor] = np.roll(motor, -1, axis=0)
    same = np.abs(np.roll(ratio, -1, axis=0) - ratio) <= _EQUAL * np.abs(ratio)
    if not same.all() or not (onward[motor] == np.roll(motor, -1, axis=0)).all():
        return None
    if np.unique(onward).size < onward.size:
        return None
    rows: dict[int, list[list[int]]] = {}
    seen: set[int] = set()
    for start in motor[0].tolist():
        if start not in seen:
            orbit = [start]
            while onward[orbit[-1]] != start:
                orbit.append(int(onward[orbit[-1]]))
            seen |= set(orbit)
            rows.setdefault(len(orbit), []).append(orbit)
    return tuple(np.array(rows[length], int).T for length in sorted(rows, reverse=True))


def harmonic_gears(
    dynamics: Dynamics, symmetry: CyclicSymmetry, orbits: tuple[Int[np.ndarray, "_ _"], ...]
) -> list[Inexact[np.ndarray, "acting _"]]:
    """Shortening of the sector's acting tendons per input, for k = 0 ... n/2."""
    order, acting = symmetry.order, _acting(dynamics, symmetry)
    gearing, parts = dynamics.members.gearing, [[] for _ in range(order // 2 + 1)]
    for group in orbits:
        ratios = np.where(gearing.motor[acting][..., None] == group[0], gearing.ratio[acting][..., None], 0.0)
        waves = np.sqrt(len(group)) * np.fft.rfft(ratios, axis=0, norm="ortho")
        for k in range(0, order // 2 + 1, order // len(group)):
            parts[k].append(waves[k].real if is_real(k, order) else waves[k])
    return [np.hstack([np.zeros((acting.shape[1], 0)), *part]) for part in parts]


def _acting(dynamics: Dynamics, symmetry: CyclicSymmetry) -> Int[np.ndarray, "n acting"]:
    """Positions among the acting tendons of those of each sector."""
    inputs = dynamics.members.inputs
    return np.searchsorted(inputs, symmetry.tendons[:, np.isin(symmetry.tendons[0], inputs)])
