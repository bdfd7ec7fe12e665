"""Modes of vibration: mass-normalised shapes, named and grouped.

H phi = omega^2 M phi,   phi' M phi = 1

Flexible modes in ascending order belong to one repeated frequency as long as each gap to the next is at most

    omega2_(k+1) - omega2_k  <=  repeated * omega2_(k+1) + tolerance

with `repeated` chosen by the user and `tolerance` the eigenvalues' own rounding. Inside a group single shapes mean
nothing, the space that they span does. A symmetry broken by delta opens a gap of order delta * omega2, so groups part
at delta of about `repeated`; what is said of a group as a whole changes by delta only.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, SupportsIndex, overload

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import LinearizationError
from tensctl.statics import Equilibrium, Spectrum
from tensctl.statics.stability import ALL_MODES

Kind = Literal["rigid-body", "flexible", "mechanism", "unstable"]

REPEATED = 1e-9
"""Default gap below which squared frequencies are one: far above rounding, far below what parts a real structure."""


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


class Modes(Sequence):
    """All modes about an equilibrium, found when first looked at: rigid-body motions first, the others ascending.

    Parameters
    ----------
    repeated : float
        Gap, as a part of omega^2, up to which frequencies count as one (see the module's rule).
    """

    def __init__(self, equilibrium: Equilibrium, repeated: float = REPEATED) -> None:
        self._equilibrium, self._repeated = equilibrium, repeated

    @cached_property
    def _all(self) -> tuple[Mode, ...]:
        size = self._equilibrium.potential.manifold.size
        if size > ALL_MODES:
            raise LinearizationError(
                f"the structure has {size} degrees of freedom, and all modes are found up to {ALL_MODES}; take "
                "linear.sparse, which needs none, the lowest frequencies of equilibrium.omega2, or the harmonic model "
                "of a cyclically symmetric structure."
            )
        return find_modes(self._equilibrium, self._repeated)

    @overload
    def __getitem__(self, index: SupportsIndex) -> Mode: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Mode, ...]: ...
    def __getitem__(self, index: SupportsIndex | slice) -> Mode | tuple[Mode, ...]:
        """One mode, or several."""
        return self._all[index]

    def __len__(self) -> int:
        """Degrees of freedom."""
        return len(self._all)

    def __iter__(self) -> Iterator[Mode]:
        """Mode by mode."""
        return iter(self._all)


def find_modes(equilibrium: Equilibrium, repeated: float = REPEATED) -> tuple[Mode, ...]:
    """All modes about an equilibrium: rigid-body motions first, the others ascending."""
    spectrum = equilibrium.spectrum
    clusters = group_modes(spectrum, repeated)
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


def group_modes(spectrum: Spectrum, repeated: float = REPEATED) -> Int[np.ndarray, " modes"]:
    """Group number of each mode by the gap rule; rigid-body motions are one group.

    Parameters
    ----------
    repeated : float, >= 0
        Gap, as a part of omega^2, up to which two neighbours are one frequency.
    """
    flexible = spectrum.omega2[spectrum.rigid_count :]
    gap = np.diff(flexible) > repeated * np.abs(flexible[1:]) + spectrum.tolerance
    first = int(spectrum.rigid_count > 0)
    tail = first + np.concatenate([[0], np.cumsum(gap)]) if flexible.size else np.zeros(0)
    return np.concatenate([np.zeros(spectrum.rigid_count), tail]).astype(int)
