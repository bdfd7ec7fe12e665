"""Modes of vibration: mass-normalised shapes, named and grouped.

H phi = omega^2 M phi,   phi' M phi = 1
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.statics import Equilibrium, Spectrum

Kind = Literal["rigid-body", "flexible", "mechanism", "unstable"]

# Frequencies whose squares differ by less than this part of themselves, plus the eigenvalue solver's own rounding,
# are one repeated frequency: cyclic structures have many, and inside such a cluster single shapes mean nothing.
_SAME = 1e-9


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode of vibration.

    Attributes
    ----------
    index : int
        Position in the model, from 0.
    omega2 : float, rad^2/s^2
    frequency : float, Hz
        Natural frequency; 0 for rigid-body motions, mechanisms and unstable modes.
    kind : str
        "rigid-body", "flexible", "mechanism" (no stiffness to rounding) or "unstable".
    name : str
        "translation x" and the like for rigid-body motions, else empty.
    cluster, multiplicity : int
        Number of the group of equal frequencies, and its size.
    shape : (N, 3) 1/sqrt(kg)
        Nodal displacements of the mass-normalised mode.
    """

    index: int
    omega2: float
    frequency: float
    kind: Kind
    name: str
    cluster: int
    multiplicity: int
    shape: Float[np.ndarray, "nodes 3"]


def find_modes(equilibrium: Equilibrium) -> tuple[Mode, ...]:
    """All modes about an equilibrium: rigid-body motions first, the others ascending."""
    spectrum = equilibrium.spectrum
    clusters = _clusters(spectrum)
    sizes = np.bincount(clusters) if clusters.size else clusters
    shapes = (equilibrium.point.tangent @ spectrum.shapes).T.reshape(-1, len(equilibrium.nodes), 3)
    return tuple(
        Mode(
            index=k,
            omega2=float(value),
            frequency=float(np.sqrt(value) / (2 * np.pi)) if kind == "flexible" else 0.0,
            kind=kind,
            name=spectrum.rigid.names[k] if kind == "rigid-body" else "",
            cluster=int(clusters[k]),
            multiplicity=int(sizes[clusters[k]]),
            shape=shapes[k],
        )
        for k, (value, kind) in enumerate(zip(spectrum.omega2, _kinds(spectrum), strict=True))
    )


def _kinds(spectrum: Spectrum) -> list[Kind]:
    kinds: list[Kind] = ["rigid-body"] * spectrum.rigid_count
    for value in spectrum.omega2[spectrum.rigid_count :]:
        if value > spectrum.tolerance:
            kinds.append("flexible")
        else:
            kinds.append("unstable" if value < -spectrum.tolerance else "mechanism")
    return kinds


def _clusters(spectrum: Spectrum) -> np.ndarray:
    """Group number of each mode; rigid-body motions are one group."""
    flexible = spectrum.omega2[spectrum.rigid_count :]
    gap = np.diff(flexible) > _SAME * np.abs(flexible[1:]) + spectrum.tolerance
    first = int(spectrum.rigid_count > 0)
    tail = first + np.concatenate([[0], np.cumsum(gap)]) if flexible.size else np.zeros(0)
    return np.concatenate([np.zeros(spectrum.rigid_count), tail]).astype(int)
