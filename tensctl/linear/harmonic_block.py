"""One harmonic of a cyclically symmetric linear model, of sector size.

With modes H_k phi = omega^2 M phi, phi* M phi = 1, and S_k the tendons' spans of the sector (see `statics.sector`),

    d/dt (s eta) = s eta',   eta'' = -(omega^2/s) (s eta) - phi* C_k phi eta' + phi* G_k u_k

the state of harmonic k is x_k = (s eta, eta'), as in `LinearModel`. Under drag the rates of a free structure's
rigid-body motions, which stand in k = 0 and k = 1, are its last states. Outputs are y_k = C x_k + D u_k: nodes in axes
that turn with the sectors, lengths and tensions.
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
    drift : (sector size, r)
        Mass-normalised rigid-body motions of which only the rates are states, under drag.
    gear : (tendons that act, p)
        Shortening of the sector's tendons per input: the identity unless motors pull several tendons.
    unscaled : float, rad/s
        Scale of modes without stiffness: the slowest flexible frequency of all harmonics.
    """

    dynamics: Dynamics
    point: SectorPoint
    k: int
    omega2: Float[np.ndarray, " m"]
    shapes: Inexact[np.ndarray, "size m"]
    tolerance: float
    drift: Inexact[np.ndarray, "size r"]
    gear: Inexact[np.ndarray, "acting p"]
    unscaled: float = 1.0

    @classmethod
    def of(cls, dynamics: Dynamics, point: SectorPoint, k: int, tolerance: float, gear: np.ndarray) -> Harmonic:
        """Harmonic k about a sector's point; one Hermitian eigenvalue problem of sector size."""
        root = np.sqrt(_mass(point))
        scaled, motion = point.harmonic(k).toarray() / np.outer(root, root), rigid_motion(point, k)
        held = np.linalg.qr(root[:, None] * motion)[0] if motion.shape[1] else motion
        if is_real(k, point.sector.symmetry.order):
            scaled, held = np.real(scaled), np.real(held)
        omega2, vectors = across(scaled, held)
        drift = held / root[:, None] if dynamics.drag > 0 else held[:, :0]
        return cls(dynamics, point, k, omega2, vectors / root[:, None], tolerance, drift, gear)

    @property
    def motion(self) -> int:
        """Number of states of the motion."""
        return 2 * self.omega2.size + self.drift.shape[1]

    @property
    def nx(self) -> int:
        """Number of states, complex unless the harmonic is real."""
        return self.motion

    @property
    def lag(self) -> float:
        """Lag of the actuators that the states carry, s: none here."""
        return 0.0

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
    def damping(self) -> Inexact[np.ndarray, "rates rates"]:
        """Modal damping of all rates, 1/s; no tendon feels a rigid-body motion."""
        count, rates = self.omega2.size, self.omega2.size + self.drift.shape[1]
        result = np.zeros((rates, rates), self.shapes.dtype)
        if self.dampers.any():
            stretch = self.stretch
            result[:count, :count] += stretch.conj().T @ (self.dampers[:, None] * stretch)
        if self.dynamics.drag > 0:
            moved = self.point.tangent @ np.hstack([self.shapes, self.drift])
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
    def free(self) -> Bool[np.ndarray, " components"]:
        """Which node components of the sector can move."""
        return self.point.sector.potential.structure.free[self.point.sector.symmetry.nodes[0]].ravel()

    @property
    def drive(self) -> Inexact[np.ndarray, "m p"]:
        """Modal force of each input, per metre of shortening."""
        acting = self.acting
        force = -np.einsum("tim,ti->mt", self._spans.conj()[acting], self.point.terms.shortening[acting])
        return force @ self.gear

    @property
    def A(self) -> Inexact[np.ndarray, "nx nx"]:
        """State matrix, 1/s."""
        s, count, k = self.scales, self.omega2.size, np.arange(self.omega2.size)
        full = np.zeros((self.motion, self.motion), self.shapes.dtype if self.dynamics.damped else float)
        full[k, count + k], full[count + k, k] = s, -self.omega2 / s
        if self.dynamics.damped:
            full[count:, count:] = -self.damping
        return full

    @property
    def B(self) -> Inexact[np.ndarray, "nx p"]:
        """Input matrix: rest-length shortening of the sector's acting tendons, m."""
        drive = self.drive
        return np.vstack([np.zeros_like(drive), drive, np.zeros((self.drift.shape[1], drive.shape[1]))])

    @property
    def E(self) -> Inexact[np.ndarray, "nx components"]:
        """Disturbance matrix: forces on the sector's free node components, N, in axes that turn with the sectors."""
        rates = (self.point.tangent @ np.hstack([self.shapes, self.drift]))[self.free].conj().T
        return np.vstack([np.zeros((self.omega2.size, rates.shape[1])), rates])

    def C(self, kind: Shown) -> Inexact[np.ndarray, "y nx"]:
        """Output matrix of the sector's free node components, tendon lengths or tensions."""
        if kind == "nodes":
            position = (self.point.tangent @ self.shapes)[self.free]
            return self._at(position / self.scales, 0 * position)
        stretch = self.stretch
        if kind == "lengths":
            return self._at(stretch / self.scales, 0 * stretch)
        slope = self._slopes[0]
        return self._at(slope[:, None] * stretch / self.scales, self.dampers[:, None] * stretch)

    def _at(self, position: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Rows that see positions and rates of modes, and nothing of a drift."""
        return np.hstack([position, rate, np.zeros((len(rate), self.drift.shape[1]))])

    def D(self, kind: Shown) -> Inexact[np.ndarray, "y p"]:
        """Feedthrough: tensions answer to their own rest length at once."""
        acting = self.acting
        if kind == "tensions":
            return np.diag(self._slopes[1])[:, acting] @ self.gear
        rows = int(np.count_nonzero(self.free))
        return np.zeros((rows if kind == "nodes" else acting.size, self.gear.shape[1]))

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
