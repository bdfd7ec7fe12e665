"""The largest gain of single-input, single-output responses over all frequencies, enclosed by their poles.

    f_i(s) = d + sum_k r_ik / (s - p_k),   s = jw, or exp(jw dt),   A V = V diag(p),   r_ik = (C V)_ik (V^-1 B)_ki
    f_i(s + h) = f_i(s) - h sum_k r_ik g_k^2 + rest,   |rest| <= |h|^2 sum_k |r_ik| |g_k|^2 / a_k

with g_k = 1/(s - p_k) and a_k the distance of p_k to the interval about s. The first two terms are largest at an end of
the interval, so each interval has an upper bound; those that may hold more than the largest gain found so far are
halved. The bound is off by the square of the width, so few are left at any time. What rounding of V leaves,
E = V^-1 A V - diag(p), is bounded on all frequencies at once and widens the enclosure; where poles nearly coincide
without being a cluster of equal ones it says too much, and `peaks` asks `hinf`, which needs no eigenvectors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float

from tensctl.synthesis.hinf import Peak, System, hinf

_TOL = 1e-6
# Entries of the largest array, 16 MB.
_ENTRIES = 2**20


@dataclass(frozen=True, eq=False)
class Expansion:
    """Responses from each input to the output of the same number, by their poles.

    Attributes
    ----------
    poles : (n,)
    residues : (m, n)
    direct : float
        The same d > 0 in all of them.
    dt : float or None, s
    error : float
        What rounding of the eigenvectors may change in any of them.
    """

    poles: Complex[np.ndarray, " n"]
    residues: Complex[np.ndarray, "m n"]
    direct: float
    dt: float | None
    error: float

    @classmethod
    def of(cls, A: np.ndarray, B: np.ndarray, C: np.ndarray, direct: float, dt: float | None) -> Expansion:
        """Expand responses; the error is infinite where a pole is not stable or the eigenvectors are no basis."""
        poles, V = np.linalg.eig(A)
        near = -np.real(poles) if dt is None else 1 - np.abs(poles)
        try:
            inverse = np.linalg.inv(V)
        except np.linalg.LinAlgError:
            inverse = None
        if inverse is None or not (near > 0).all():
            return cls(poles.astype(complex), np.zeros((len(C), len(A)), complex), direct, dt, np.inf)
        shown, driven = C @ V, (inverse @ B).T
        left = np.abs(inverse @ (A @ V) - np.diag(poles))
        error = (np.abs(shown / near) @ left * np.abs(driven / near)).sum(axis=1).max(initial=0.0)
        return cls(poles.astype(complex), shown * driven.astype(complex), direct, dt, float(error))

    def row(self, i: int) -> Expansion:
        """The response of one input alone."""
        return Expansion(self.poles, self.residues[[i]], self.direct, self.dt, self.error)

    def point(self, omega: np.ndarray) -> np.ndarray:
        """The points s or z of angular frequencies."""
        return 1j * omega if self.dt is None else np.exp(1j * omega * self.dt)

    def at(self, omega: Float[np.ndarray, " w"]) -> Complex[np.ndarray, "m w"]:
        """Responses at angular frequencies."""
        return self.direct + self.residues @ (1 / (self.point(omega) - self.poles[:, None]))

    def largest(self, tol: float = _TOL) -> tuple[Peak, int]:
        """Enclosure of the largest gain of all responses, half its relative width at most tol, and whose it is."""
        edges = self._pole_frequencies()
        low, omega, which = self._highest(edges, self.direct, np.inf, 0)
        edges = np.concatenate([edges, self._beyond(edges[-1], low * (1 + 2 * tol))])
        start, stop = edges[:-1], edges[1:]
        while start.size:
            middle = 0.5 * (start + stop)
            low, omega, which = self._highest(middle, low, omega, which)
            open_ = self._in_parts(self._bounds, start, middle, stop).max(axis=0) > low * (1 + 2 * tol)
            start, middle, stop = start[open_], middle[open_], stop[open_]
            start, stop = np.concatenate([start, middle]), np.concatenate([middle, stop])
        # The value d at infinity is exceeded somewhere on the boundary of stability, or it is all of them.
        return Peak(max(low - self.error, self.direct), low * (1 + 2 * tol) + self.error, omega), which

    def _in_parts(self, work: Callable[..., np.ndarray], *frequencies: np.ndarray) -> np.ndarray:
        """What a method gives of many frequencies, a part of them at a time."""
        parts = 1 + frequencies[0].size * len(self.poles) // _ENTRIES
        split = (np.array_split(one, parts) for one in frequencies)
        return np.concatenate([work(*part) for part in zip(*split, strict=True)], axis=1)

    def _pole_frequencies(self) -> np.ndarray:
        if self.dt is None:
            return np.unique(np.concatenate([[0.0], np.abs(np.imag(self.poles))]))
        return np.unique(np.concatenate([[0.0, np.pi / self.dt], np.abs(np.angle(self.poles)) / self.dt]))

    def _highest(self, at: np.ndarray, low: float, omega: float, which: int) -> tuple[float, float, int]:
        gains = np.abs(self._in_parts(self.at, at))
        i, k = np.unravel_index(gains.argmax(), gains.shape)
        return (float(gains[i, k]), float(at[k]), int(i)) if gains[i, k] > low else (low, omega, which)

    def _beyond(self, last: float, level: float) -> np.ndarray:
        """Ends of intervals from the last pole on, until all gains are below a level above the direct term."""
        if self.dt is not None:
            return np.empty(0)
        sizes, farthest = np.abs(self.residues).sum(axis=1).max(), np.abs(self.poles).max()
        ends = [2 * max(last, farthest)]
        while self.direct + sizes / (ends[-1] - farthest) > level:
            ends.append(2 * ends[-1])
        return np.array(ends)

    def _bounds(self, start: np.ndarray, middle: np.ndarray, stop: np.ndarray) -> Float[np.ndarray, "m w"]:
        """Upper bounds of all gains on intervals of frequency."""
        s, half = self.point(middle), 0.5 * (stop - start)
        away = s - self.poles[:, None]
        if self.dt is None:
            apart = np.maximum(np.abs(np.imag(self.poles)[:, None] - middle) - half, 0.0)
            near, reach, bulge = np.hypot(np.real(self.poles)[:, None], apart), half, np.zeros_like(half)
        else:
            reach, bulge = 2 * np.sin(0.5 * half * self.dt), 1 - np.cos(half * self.dt)
            near = np.maximum((1 - np.abs(self.poles))[:, None], np.abs(away) - reach)
        value, slope = self.direct + self.residues @ (1 / away), -self.residues @ (1 / away**2)
        rest = reach**2 * (np.abs(self.residues) @ (1 / (np.abs(away) ** 2 * near)))
        ends = [np.abs(value + slope * (self.point(end) - s)) for end in (start, stop)]
        return np.maximum(*ends) + np.abs(slope) * bulge + rest


def peaks(A: np.ndarray, B: np.ndarray, C: np.ndarray, direct: float, dt: float | None) -> tuple[Peak, ...]:
    """Enclosures of the largest gain of d + c_i (sI - A)^-1 b_i, or with z = exp(s dt) for s, for each i.

    Gains are infinite when A is not stable.
    """
    found = Expansion.of(A, B, C, direct, dt)
    if found.error <= _TOL * direct:
        return tuple(found.row(i).largest()[0] for i in range(len(C)))
    d = np.array([[direct]])
    return tuple(hinf(System(A, B[:, [i]], C[[i]], d, dt)) for i in range(len(C)))


def highest_peak(A: np.ndarray, B: np.ndarray, C: np.ndarray, direct: float, dt: float | None) -> tuple[Peak, int]:
    """Enclosure of the largest of these gains, and the number i that has it."""
    found = Expansion.of(A, B, C, direct, dt)
    if found.error <= _TOL * direct:
        return found.largest()
    each = peaks(A, B, C, direct, dt)
    which = int(np.argmax([peak.low for peak in each]))
    return Peak(each[which].low, max(peak.high for peak in each), each[which].omega), which
