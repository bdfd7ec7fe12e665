"""Arrays of the whole structure and of its harmonics, and back, by fast Fourier transform.

A quantity z_s of sector s, seen from axes that turn with the sectors, has the unitary transform

    z_k = n^-1/2 sum_s exp(-2 pi i k s/n) z_s,   z_s = n^-1/2 sum_k exp(2 pi i k s/n) z_k

so lengths are kept: sum_s |z_s|^2 = sum_k |z_k|^2. Of real quantities z_{n-k} is the conjugate of z_k, and
k = 0 ... n/2 are stored; z_0, and z_{n/2} of an even n, are real. A motor that pulls tendons of several sectors comes
back to itself after l < n turns: with its images it has l harmonics only, which stand in every (n/l)-th k.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
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
        Position in u of the acting tendons, or of the motors that each sector has its own of, by sector.
    shared : tuple of (l, p_l) int
        Those of motors that come back to themselves after l turns.
    """

    equilibrium: Equilibrium
    point: SectorPoint
    inputs: Int[np.ndarray, "n p"]
    shared: tuple[Int[np.ndarray, "_ _"], ...] = ()

    @property
    def order(self) -> int:
        """The number n of sectors."""
        return self.point.sector.symmetry.order

    @property
    def nu(self) -> int:
        """Number of inputs of the whole structure."""
        return self.inputs.size + sum(group.size for group in self.shared)

    def first(self, k: int) -> Int[np.ndarray, " p_k"]:
        """Position in u of one input for each of those of harmonic k; the others are its images."""
        return np.concatenate([group[0] for group in (self.inputs, *self._present(k))])

    def _present(self, k: int) -> list[np.ndarray]:
        return [group for group in self.shared if k * len(group) % self.order == 0]

    def alike(self, values: Float[np.ndarray, " nu"], tol: float = 1e-9) -> bool:
        """Whether what belongs to inputs is the same for all images of each."""
        groups = [values[group] for group in (self.inputs, *self.shared)]
        return all(np.ptp(own, axis=0).max(initial=0.0) <= tol * np.abs(values).max(initial=0.0) for own in groups)

    def forward(self, values: Float[np.ndarray, "n *rest"]) -> list[Inexact[np.ndarray, "*rest"]]:
        """z_k for k = 0 ... n/2 of what the sectors have; real where it is."""
        waves = np.fft.rfft(values, axis=0, norm="ortho")
        return [wave.real if is_real(k, self.order) else wave for k, wave in enumerate(waves)]

    def backward(self, waves: list[Inexact[np.ndarray, "*rest"]]) -> Float[np.ndarray, "n *rest"]:
        """What the sectors have, from z_k for k = 0 ... n/2."""
        return np.fft.irfft(np.stack([wave.astype(complex) for wave in waves]), n=self.order, axis=0, norm="ortho")

    def motion(self, xi: Float[np.ndarray, "size columns"]) -> list[Inexact[np.ndarray, "sector_size columns"]]:
        """Tangent coordinates of the whole structure as harmonics of the sector's own."""
        return self.forward((self._to_sectors @ xi).reshape(self.order, -1, xi.shape[1]))

    @cached_property
    def _to_sectors(self) -> sp.csr_array:
        """Tangent coordinates of the sectors one after the other, each in its own axes, from those of the whole."""
        symmetry, point = self.point.sector.symmetry, self.point
        count = 3 * point.nodes.shape[0]
        rows = np.arange(self.order * count).reshape(self.order, -1, 3)  # sector, node, axis
        picked = np.broadcast_to((3 * symmetry.nodes[..., None] + np.arange(3))[:, :, :, None], (*rows.shape, 3))
        rows = np.broadcast_to(rows[:, :, None, :], picked.shape)
        turns = np.broadcast_to(symmetry.turns[:, None], picked.shape)
        turned = sp.coo_array((turns.ravel(), (rows.ravel(), picked.ravel())), shape=(self.order * count,) * 2)
        own = sp.csr_array(point.sector.manifold.coordinates_of(point.nodes, np.eye(count)))
        return sp.csr_array(sp.kron(sp.eye_array(self.order), own) @ turned.tocsr() @ self.equilibrium.point.tangent)

    def shortening(self, waves: list[Inexact[np.ndarray, "_ *columns"]]) -> Float[np.ndarray, "nu *columns"]:
        """Inputs u of the whole structure from their harmonics."""
        own = self.inputs.shape[1]
        by_sector = self.backward([wave[:own] for wave in waves])
        u = np.empty((self.nu, *by_sector.shape[2:]))
        u[self.inputs] = by_sector
        rows = [own] * len(waves)
        for group in self.shared:
            (turns, count), parts = group.shape, []
            for k in range(0, self.order // 2 + 1, self.order // turns):
                parts.append(waves[k][rows[k] : rows[k] + count])
                rows[k] += count
            u[group] = np.fft.irfft(np.stack(parts), n=turns, axis=0, norm="ortho")
        return u

    def waves(self, u: Float[np.ndarray, "nu *columns"]) -> list[Inexact[np.ndarray, "_ *columns"]]:
        """Harmonics of inputs u of the whole structure."""
        waves = self.forward(u[self.inputs])
        for group in self.shared:
            for q, wave in enumerate(np.fft.rfft(u[group], axis=0, norm="ortho")):
                k = q * (self.order // len(group))
                waves[k] = np.concatenate([waves[k], wave.real if is_real(k, self.order) else wave])
        return waves


def is_real(k: int, order: int) -> bool:
    """Whether harmonic k of real quantities is real: it is its own conjugate."""
    return 2 * k % order == 0
