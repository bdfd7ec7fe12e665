"""The largest gain of a stable system over all frequencies, enclosed from both sides.

    |G|_inf < g   iff   no eigenvalue of the Hamiltonian matrix H(g) (symplectic pencil when sampled) lies on the
    boundary of stability,       where g > |D| and G = C (sI - A)^-1 B + D, or with z for s

(Boyd, Balakrishnan and Kabamba 1989; Bruinsma and Steinbuch 1990.) Eigenvalues on the boundary are the frequencies at
which a gain of G is g; between two of them it is larger, so a peak that falls between points of a sweep is found. The
lower end is a gain that was computed at a frequency, the upper end a level at which eigenvalues keep clear of the
boundary by more than rounding moves them. Near a peak two of them meet, and rounding moves them by its part over
sqrt(tol); where that is not clear the level is raised, and the enclosure says how far.

Real or complex. Gains of a real system are the same at w and -w, those of a complex one are looked at on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as sla

# Half the width of the enclosure asked for; its eigenvalues are then clear of the boundary by 1e-3 of a peak's width.
_TOL = 1e-6
# Levels tried; each round either raises the lower end beyond a crossing, or widens the enclosure fourfold.
_ROUNDS = 40
# Eigenvalues nearer to the boundary than this part of the largest are looked at as crossings.
_NEAR = 1e-7
# Frequencies of poles that are tried first. More of them cost more than the spectrum that a missed peak costs: of LQR
# of an (8,4) shell, 592 states, all of them take 39 s and one spectrum 0.7 s.
_TRIED = 40


@dataclass(frozen=True)
class Peak:
    """Enclosure of an H-infinity norm.

    Attributes
    ----------
    low, high : float
        The norm lies between them; high is infinite where rounding hides every level.
    omega : float, rad/s
        Where the gain is low; infinite when it is that of D.
    """

    low: float
    high: float
    omega: float


@dataclass(frozen=True, eq=False)
class System:
    """C (sI - A)^-1 B + D, or with z = exp(s dt) for s."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    dt: float | None = None

    @cached_property
    def schur(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The triangular form, what drives it and what it shows."""
        form, turn = sla.schur(self.A, "complex")
        return form, turn.conj().T @ self.B, self.C @ turn

    def at(self, omega: float) -> np.ndarray:
        """Response at an angular frequency."""
        form, drive, show = self.schur
        point = 1j * omega if self.dt is None else np.exp(1j * omega * self.dt)
        return self.D + show @ sla.solve_triangular(point * np.eye(len(form)) - form, drive)

    @property
    def stable(self) -> bool:
        """Whether every pole is."""
        poles = np.diag(self.schur[0])
        return bool((np.real(poles) < 0).all() if self.dt is None else (np.abs(poles) < 1).all())

    def gain(self, omega: float) -> float:
        """Largest singular value there."""
        return float(np.linalg.norm(self.at(omega), 2))

    @cached_property
    def both_sides(self) -> bool:
        """Whether gains at w and -w differ."""
        return any(np.iscomplexobj(M) for M in (self.A, self.B, self.C, self.D))

    def pole_frequencies(self) -> np.ndarray:
        """Angular frequencies of the poles, sizes and imaginary parts."""
        poles = np.diag(self.schur[0])
        if self.dt is not None:
            poles = np.log(poles[np.abs(poles) > 1e-6]) / self.dt
        sizes = np.abs(poles) if self.dt is None else np.minimum(np.abs(poles), np.pi / self.dt)
        if self.both_sides:
            return np.unique(np.concatenate([np.imag(poles), sizes, -sizes]))
        return np.unique(np.concatenate([np.abs(np.imag(poles)), sizes]))

    @property
    def ends(self) -> np.ndarray:
        """Ends of the frequencies to look at, where a gain above a level need not have crossed it."""
        last = [] if self.dt is None else [np.pi / self.dt]
        return np.array([*(-w for w in last), *last] if self.both_sides else [0.0, *last])

    def spectrum(self, level: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Distances to the boundary and angular frequencies of the eigenvalues at a level, and the size of rounding."""
        A, B, C, D = self.A, self.B, self.C, self.D
        inner = np.linalg.inv(level**2 * np.eye(D.shape[1]) - D.conj().T @ D)
        moved, drive = A + B @ inner @ D.conj().T @ C, B @ inner @ B.conj().T
        seen = C.conj().T @ C + C.conj().T @ D @ inner @ D.conj().T @ C
        # Both off-diagonal blocks at one size.
        ratio = np.sqrt(max(np.linalg.norm(seen), 1e-300) / max(np.linalg.norm(drive), 1e-300))
        drive, seen = drive * ratio, seen / ratio
        if self.dt is None:
            H, _ = sla.matrix_balance(np.block([[moved, drive], [-seen, -moved.conj().T]]))
            values = np.linalg.eigvals(H)
            return np.abs(np.real(values)), self._sided(np.imag(values)), float(np.linalg.norm(H))
        n = len(A)
        left = np.block([[moved, np.zeros((n, n))], [-seen, np.eye(n)]])
        right = np.block([[np.eye(n), -drive], [np.zeros((n, n)), moved.conj().T]])
        over, under = sla.eigvals(left, right, homogeneous_eigvals=True)
        sizes = np.abs(over) - np.abs(under)
        scale = np.maximum(np.abs(under), np.abs(over))
        frequencies = self._sided(np.angle(over * under.conj())) / self.dt
        return np.abs(sizes) / scale, frequencies, float(np.linalg.norm(left))

    def _sided(self, frequencies: np.ndarray) -> np.ndarray:
        return frequencies if self.both_sides else np.abs(frequencies)


def hinf(system: System, *, start: float | None = None, tol: float = _TOL, least: float = 0.0) -> Peak:
    """Enclose the largest gain of a system; it is infinite when the system is not stable.

    Parameters
    ----------
    system : System
    start : float, rad/s, optional
        Where the peak is thought to be.
    tol : float
        Half the relative width of the enclosure, met unless rounding forbids it.
    least : float
        Of gains below this it is enough to know that they are; the upper end is then at it.
    """
    if not system.stable:
        return Peak(np.inf, np.inf, np.inf)
    tried = _some(system.pole_frequencies()) if start is None else np.array([start])
    low, omega = float(np.linalg.norm(system.D, 2)), np.inf
    low, omega = _highest(system, tried, low, omega)
    if not low > 0:
        return Peak(0.0, 0.0, omega)
    for _ in range(_ROUNDS):
        level = max(low, least) * (1 + 2 * tol)
        distances, frequencies, size = system.spectrum(level)
        near = np.unique(np.concatenate([system.ends, frequencies[distances <= _NEAR * size]]))
        before = low
        low, omega = _highest(system, np.concatenate([near, 0.5 * (near[1:] + near[:-1])]), low, omega)
        if low > level:
            continue
        low = max(low, before)
        if distances.min(initial=np.inf) > np.finfo(float).eps * size / np.sqrt(tol):
            return Peak(low, level, omega)
        tol *= 4
        if tol > 1:
            break
    return Peak(low, np.inf, omega)


def _some(frequencies: np.ndarray) -> np.ndarray:
    """Evenly many of all."""
    return frequencies[np.unique(np.linspace(0, frequencies.size - 1, _TRIED).astype(int))]


def _highest(system: System, frequencies: np.ndarray, low: float, omega: float) -> tuple[float, float]:
    """The largest gain among those known and those at the given frequencies."""
    for w in frequencies:
        gain = system.gain(float(w))
        if gain > low:
            low, omega = gain, float(w)
    return low, omega
