"""One harmonic of a cyclically symmetric linear model, of sector size.

With modes H_k phi = omega^2 M phi, phi* M phi = 1, and S_k the tendons' spans of the sector (see `statics.sector`),

    d/dt (s eta) = s eta',   eta'' = -(omega^2/s) (s eta) - phi* C_k phi eta' + phi* G_k u_k

the state of harmonic k is x_k = (s eta, eta'), as in `LinearModel`. Outputs are y_k = C x_k + D u_k: nodes in axes that
turn with the sectors, lengths and tensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Inexact

from tensctl.linear.harmonic_map import is_real
from tensctl.model import Dynamics
from tensctl.statics.harmonics import rigid_motion
from tensctl.statics.lowest import across
from tensctl.statics.sector import SectorPoint

Shown = Literal["nodes", "lengths", "tensions"]


@dataclass(frozen=True, eq=False)
class Harmonic:
    """The motions in which each sector repeats the one before it, turned by 2 pi/n and delayed by 2 pi k/n.

    Attributes
    ----------
    dynamics : Dynamics
    point : SectorPoint
    k : int
    omega2 : (m,) rad^2/s^2, ascending, without rigid-body motions
    shapes : (sector size, m)
        Mass-normalised modes in the sector's tangent coordinates, 1/sqrt(kg).
    tolerance : float, rad^2/s^2
        Eigenvalues up to this size are no stiffness: mechanisms or unstable modes.
    unscaled : float, rad/s
        Scale of modes without stiffness: the slowest flexible frequency of all harmonics.
    """

    dynamics: Dynamics
    point: SectorPoint
    k: int
    omega2: Float[np.ndarray, " m"]
    shapes: Inexact[np.ndarray, "size m"]
    tolerance: float
    unscaled: float = 1.0

    @classmethod
    def of(cls, dynamics: Dynamics, point: SectorPoint, k: int, tolerance: float) -> Harmonic:
        """Harmonic k about a sector's point; one Hermitian eigenvalue problem of sector size."""
        root = np.sqrt(_mass(point))
        scaled, motion = point.harmonic(k).toarray() / np.outer(root, root), rigid_motion(point, k)
        held = np.linalg.qr(root[:, None] * motion)[0] if motion.shape[1] else motion
        if is_real(k, point.sector.symmetry.order):
            scaled, held = np.real(scaled), np.real(held)
        omega2, vectors = across(scaled, held)
        return cls(dynamics, point, k, omega2, vectors / root[:, None], tolerance)

    @property
    def nx(self) -> int:
        """Number of states, complex unless the harmonic is real."""
        return 2 * self.omega2.size

    @property
    def copies(self) -> int:
        """2 when k and n - k are two harmonics, conjugates of each other, else 1."""
        return 1 if is_real(self.k, self.point.sector.symmetry.order) else 2

    @property
    def flexible(self) -> Bool[np.ndarray, " m"]:
        """Which modes have stiffness."""
        return self.omega2 > self.tolerance

    @cached_property
    def scales(self) -> Float[np.ndarray, " m"]:
        """Scaling s of each mode's position, rad/s."""
        return np.where(self.flexible, np.sqrt(np.where(self.flexible, self.omega2, 1.0)), self.unscaled)

    @property
    def stretch(self) -> Inexact[np.ndarray, "tendons m"]:
        """Growth of each of the sector's tendons per unit of each mode."""
        d = (self.point.sector.spans @ self.point.nodes.ravel()).reshape(-1, 3)
        unit = d / np.where(self.point.lengths > 0, self.point.lengths, np.inf)[:, None]
        return np.einsum("ti,tim->tm", unit, self._spans)

    @property
    def damping(self) -> Inexact[np.ndarray, "m m"]:
        """Modal damping, 1/s."""
        result = np.zeros((self.omega2.size,) * 2, self.shapes.dtype)
        if self.dampers.any():
            stretch = self.stretch
            result += stretch.conj().T @ (self.dampers[:, None] * stretch)
        if self.dynamics.drag > 0:
            moved = self.point.tangent @ self.shapes
            ends = np.bincount(self.point.sector.manifold.rods.ravel(), minlength=len(self.point.nodes))
            result += moved.conj().T @ (np.repeat(self.dynamics.drag * ends, 3)[:, None] * moved)
        return result

    @property
    def dampers(self) -> Float[np.ndarray, " tendons"]:
        """Damping coefficient of each of the sector's tendons, N s/m; a slack one has none."""
        coefficients = self.dynamics.damping[self.point.sector.symmetry.tendons[0]]
        return coefficients * (self.point.terms.tensions > 0)

    @property
    def acting(self) -> Bool[np.ndarray, " tendons"]:
        """Which of the sector's tendons are inputs."""
        return np.isin(self.point.sector.symmetry.tendons[0], self.dynamics.members.inputs)

    @property
    def drive(self) -> Inexact[np.ndarray, "m p"]:
        """Modal force of each acting tendon of the sector, per metre of shortening."""
        acting = self.acting
        return -np.einsum("tim,ti->mt", self._spans.conj()[acting], self.point.terms.shortening[acting])

    @property
    def A(self) -> Inexact[np.ndarray, "nx nx"]:
        """State matrix, 1/s."""
        s, zero = self.scales, np.zeros((self.omega2.size,) * 2)
        damping = self.damping if self.dynamics.damped else zero
        return np.block([[zero, np.diag(s)], [np.diag(-self.omega2 / s), -damping]])

    @property
    def B(self) -> Inexact[np.ndarray, "nx p"]:
        """Input matrix: rest-length shortening of the sector's acting tendons, m."""
        drive = self.drive
        return np.vstack([np.zeros_like(drive), drive])

    def C(self, kind: Shown) -> Inexact[np.ndarray, "y nx"]:
        """Output matrix of the sector's free node components, tendon lengths or tensions."""
        if kind == "nodes":
            free = self.point.sector.potential.structure.free[self.point.sector.symmetry.nodes[0]].ravel()
            position = (self.point.tangent @ self.shapes)[free]
            return np.hstack([position / self.scales, 0 * position])
        stretch = self.stretch
        if kind == "lengths":
            return np.hstack([stretch / self.scales, 0 * stretch])
        slope = self._slopes[0]
        return np.hstack([slope[:, None] * stretch / self.scales, self.dampers[:, None] * stretch])

    def D(self, kind: Shown) -> Float[np.ndarray, "y p"]:
        """Feedthrough: tensions answer to their own rest length at once."""
        acting = self.acting
        if kind == "tensions":
            return np.diag(self._slopes[1])[:, acting]
        rows = int(np.count_nonzero(self.point.sector.potential.structure.free[self.point.sector.symmetry.nodes[0]]))
        return np.zeros((rows if kind == "nodes" else acting.size, int(acting.sum())))

    def misfit(self) -> float:
        """How far the modes miss the block's mass matrix and Hessian, this over the largest omega^2."""
        modes, scale = self.shapes, np.abs(self.omega2).max(initial=0.0) or 1.0
        gram = modes.conj().T @ (_mass(self.point)[:, None] * modes) - np.eye(self.omega2.size)
        stiff = modes.conj().T @ (self.point.harmonic(self.k) @ modes) - np.diag(self.omega2)
        return float(max(np.abs(gram).max(initial=0.0), np.abs(stiff).max(initial=0.0) / scale))

    @cached_property
    def _spans(self) -> np.ndarray:
        """Growth of each tendon's span per unit of each mode, (tendons, 3, m).

        The sector's span map has every tail in the sector; the tendons of row 0 may begin some turns on.
        """
        sector = self.point.sector
        ahead = sector.symmetry.turns_to[sector.potential.structure.tendons[sector.symmetry.tendons[0], 0]]
        phase = np.exp(2j * np.pi * self.k * ahead / sector.symmetry.order)[:, None, None]
        spans = sector.span_map(self.k) @ (self.point.tangent @ self.shapes)
        spans = phase * spans.reshape(len(ahead), 3, -1)
        return spans if self.copies == 2 else np.real(spans)

    @property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Growth of each tension with its length and with the shortening of its rest length, N/m."""
        members, tendons = self.dynamics.members, self.point.sector.symmetry.tendons[0]
        stiffness, rest = members.stiffness[tendons], self.point.sector.rest_lengths[tendons]
        slope = np.where(self.point.terms.tensions > 0, stiffness if members.law == "k" else stiffness / rest, 0.0)
        return slope, slope if members.law == "k" else slope * self.point.lengths / rest


def _mass(point: SectorPoint) -> np.ndarray:
    sector = point.sector
    return sector.manifold.mass(sector.potential.members.mass[sector.symmetry.rods[0]])
