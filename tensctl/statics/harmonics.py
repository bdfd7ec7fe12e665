"""Stability of a cyclically symmetric rest, harmonic by harmonic.

The Hessian splits exactly into the n blocks H_k of sector size (see `sector`), and H_{n-k} is the conjugate of H_k, so
k = 0 ... n/2 are looked at. Rigid-body motions are in two of them: along and about the axis in k = 0, and with the
complex directions e = e1 + i e2 across the axis, R(2 pi/n) e = exp(-2 pi i/n) e, in k = 1.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from tensctl.statics.definiteness import Definiteness, at_worst, blur_of, definiteness, together
from tensctl.statics.lowest import lowest_modes
from tensctl.statics.rigid import works_on
from tensctl.statics.sector import SectorPoint


def harmonic_definiteness(point: SectorPoint, force: float) -> Definiteness:
    """Counts of negative and undecided eigenvalues of the whole structure's Hessian, from its blocks.

    Parameters
    ----------
    point : SectorPoint
    force : float, N
        What tensions may be wrong by.
    """
    counts = _blocks(point, force)
    edge = (point.terms.tensions > 0) & (point.terms.tensions <= force)
    if not edge.any():
        return counts
    rest = point.sector.rest_lengths.copy()
    rest[point.sector.symmetry.tendons[:, edge]] = np.inf
    return at_worst(counts, _blocks(replace(point.sector, rest_lengths=rest).at(point.nodes), force))


def _blocks(point: SectorPoint, force: float) -> Definiteness:
    sector = point.sector
    bend = sector.manifold.bend(point.nodes, -point.nodal_forces).diagonal()
    ends = np.column_stack([sector.tails, sector.heads])
    blur = blur_of(point.tangent, ends, point.lengths, 0.5 * sector.manifold.lengths, force)
    harmonics = _harmonics(sector.symmetry.order)
    return together([definiteness(point.harmonic(k), bend, blur, rigid_motion(point, k), n) for k, n in harmonics])


def harmonic_smallest(point: SectorPoint, tolerance: float) -> tuple[float, int]:
    """Smallest eigenvalue of H against the mass that is no rigid-body motion, rad^2/s^2, and its harmonic."""
    sector = point.sector
    mass = sector.potential.members.mass[sector.symmetry.rods[0]]
    root = np.sqrt(sector.manifold.mass(mass))
    values = []
    for k, _ in _harmonics(sector.symmetry.order):
        scaled = sp.csr_array(sp.diags_array(1 / root) @ point.harmonic(k) @ sp.diags_array(1 / root))
        motion = rigid_motion(point, k)
        held = np.linalg.qr(root[:, None] * motion)[0] if motion.shape[1] else motion
        found, _ = lowest_modes(scaled, held, 1, tolerance)
        values.append(found[0] if found.size else np.inf)
    best = int(np.argmin(values))
    return float(values[best]), best


def _harmonics(order: int) -> list[tuple[int, int]]:
    """Harmonics to look at and how many of the n have the same eigenvalues."""
    return [(k, 1 if k in (0, order / 2) else 2) for k in range(order // 2 + 1)]


def rigid_fields(point: SectorPoint, k: int) -> np.ndarray:
    """Velocities v and turning rates omega of the rigid-body motions in one harmonic that no load sees, (6, r)."""
    if k > 1 or point.sector.pinned.any():
        return np.zeros((6, 0), complex)
    axis = point.sector.symmetry.axis
    if k == 1:
        first = np.linalg.svd(axis[None])[2][1]
        axis = first + 1j * np.cross(axis, first)
    fields = np.stack([np.concatenate([axis, 0 * axis]), np.concatenate([0 * axis, axis])], axis=1)
    # A complex motion is seen when its real or its imaginary part is; the loads of all sectors count.
    loads = np.einsum("sij,aj->sai", point.sector.symmetry.turns, point.sector.forces).reshape(-1, 3)
    return fields[:, ~(works_on(loads, np.real(fields)) | works_on(loads, np.imag(fields)))]


def rigid_motion(point: SectorPoint, k: int) -> np.ndarray:
    """The same motions in the sector's tangent coordinates, real for k = 0."""
    fields = rigid_fields(point, k)
    turning = np.cross(fields[3:].T[None], point.nodes[:, None, :]).transpose(0, 2, 1)
    motion = (fields[:3] + turning).reshape(point.nodes.size, fields.shape[1])
    return point.sector.manifold.coordinates_of(point.nodes, np.real(motion) if k == 0 else motion)
