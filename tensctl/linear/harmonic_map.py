"""Arrays of the whole structure and of its harmonics, and back, by fast Fourier transform.

A quantity z_s of sector s, seen from axes that turn with the sectors, has the unitary transform

    z_k = n^-1/2 sum_s exp(-2 pi i k s/n) z_s,   z_s = n^-1/2 sum_k exp(2 pi i k s/n) z_k

so lengths are kept: sum_s |z_s|^2 = sum_k |z_k|^2. Of real quantities z_{n-k} is the conjugate of z_k, and
k = 0 ... n/2 are stored; z_0, and z_{n/2} of an even n, are real.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Inexact, Int

from tensctl.statics import Equilibrium
from tensctl.statics.sector import SectorPoint


@dataclass(frozen=True, eq=False)
class HarmonicMap:
    """The transform of tangent coordinates and inputs of one structure.

    Attributes
    ----------
    equilibrium : Equilibrium
    point : SectorPoint
        The sector in row 0 of the symmetry's members.
    inputs : (n, p) int
        Position in u of the acting tendons, by sector.
    """

    equilibrium: Equilibrium
    point: SectorPoint
    inputs: Int[np.ndarray, "n p"]

    @property
    def order(self) -> int:
        """The number n of sectors."""
        return self.point.sector.symmetry.order

    def forward(self, values: Float[np.ndarray, "n *rest"]) -> list[Inexact[np.ndarray, "*rest"]]:
        """z_k for k = 0 ... n/2 of what the sectors have; real where it is."""
        waves = np.fft.rfft(values, axis=0, norm="ortho")
        return [wave.real if is_real(k, self.order) else wave for k, wave in enumerate(waves)]

    def backward(self, waves: list[Inexact[np.ndarray, "*rest"]]) -> Float[np.ndarray, "n *rest"]:
        """What the sectors have, from z_k for k = 0 ... n/2."""
        return np.fft.irfft(np.stack([wave.astype(complex) for wave in waves]), n=self.order, axis=0, norm="ortho")

    def motion(self, xi: Float[np.ndarray, "size columns"]) -> list[Inexact[np.ndarray, "sector_size columns"]]:
        """Tangent coordinates of the whole structure as harmonics of the sector's own."""
        symmetry, columns = self.point.sector.symmetry, xi.shape[1]
        moved = (self.equilibrium.point.tangent @ xi).reshape(-1, 3, columns)[symmetry.nodes]
        turned = np.einsum("sji,sajc->aisc", symmetry.turns, moved)
        own = self.point.sector.manifold.coordinates_of(self.point.nodes, turned.reshape(turned.shape[0] * 3, -1))
        return self.forward(own.reshape(len(own), self.order, columns).transpose(1, 0, 2))

    def shortening(self, waves: list[Inexact[np.ndarray, "p *columns"]]) -> Float[np.ndarray, "nu *columns"]:
        """Inputs u of the whole structure from their harmonics."""
        by_sector = self.backward(waves)
        u = np.empty((self.inputs.size, *by_sector.shape[2:]))
        u[self.inputs] = by_sector
        return u

    def waves(self, u: Float[np.ndarray, "nu *columns"]) -> list[Inexact[np.ndarray, "p *columns"]]:
        """Harmonics of inputs u of the whole structure."""
        return self.forward(u[self.inputs])


def is_real(k: int, order: int) -> bool:
    """Whether harmonic k of real quantities is real: it is its own conjugate."""
    return 2 * k % order == 0
