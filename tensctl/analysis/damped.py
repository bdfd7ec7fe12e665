"""How strongly the modes of a damped model are driven or seen, by the eigenvectors of the damped A.

    A v = lambda v,  |v| = 1:  gain sqrt(2) |C v|;  near eigenvalues together (`analysis.nearness`)

A may be complex, as a harmonic's is: give A* and B* for controllability then.

Every undamped mode is credited with the two eigenvectors that it takes the largest part in, and counts the weaker. An
overdamped mode has two real eigenvalues, an oscillating one a conjugate pair. At critical damping the pair has one
eigenvector, blurred by the square root of rounding, about 1e-8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from jaxtyping import Complex, Float, Inexact, Int
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import connected_components

from tensctl.analysis.nearness import APART, RESOLUTION, gains


@dataclass(frozen=True, eq=False)
class DampedModes:
    """Eigenvectors of a damped A, and the modes they belong to.

    Attributes
    ----------
    poles : (nx,) 1/s
    vectors : (nx, nx)
    chosen, owners : (2 modes,)
        Eigenvectors and the mode of each: two for each mode.
    """

    poles: Complex[np.ndarray, " nx"]
    vectors: Complex[np.ndarray, "nx nx"]
    chosen: Int[np.ndarray, " both"]
    owners: Int[np.ndarray, " both"]

    @classmethod
    def of(
        cls, A: Inexact[np.ndarray, "nx nx"], order: Int[np.ndarray, " nx"], count: int
    ) -> DampedModes:  # fmt: skip
        """Of A for observability, of A' for controllability.

        Parameters
        ----------
        order : (nx,) int
            Positions of (s eta, eta') in the state, as in `LinearModel`.
        count : int
            Number of modes.
        """
        poles, vectors = (part.astype(complex) for part in np.linalg.eig(A))
        chosen, owners = _owners(order, count, vectors)
        return cls(poles, vectors, chosen, owners)

    def gains(self, C: Inexact[np.ndarray, "ny nx"], blur: float = 1.0) -> Float[np.ndarray, " modes"]:
        """Gain of each mode; pass C for observability, B' for controllability.

        Parameters
        ----------
        blur : float
            Poles nearer than this many times rounding are equal.
        """
        return self.both(C, blur).min(axis=1, initial=np.inf)

    def both(self, C: Inexact[np.ndarray, "ny nx"], blur: float = 1.0) -> Float[np.ndarray, "modes 2"]:
        """Gain of each of the two eigenvectors of each mode, in the order of `eigenvalues`."""
        strengths = np.empty(self.poles.size)
        for group, places in _groups(self.poles, blur * _rounding(self.poles)):
            basis = self.vectors[:, group]
            strengths[group] = gains(basis, C @ basis, places)
        return np.sqrt(2) * strengths[self._of_modes]

    @property
    def eigenvalues(self) -> Complex[np.ndarray, "modes 2"]:
        """The two eigenvalues of each mode, 1/s."""
        return self.poles[self._of_modes]

    @property
    def _of_modes(self) -> np.ndarray:
        """The two eigenvectors of each mode."""
        return self.chosen[np.argsort(self.owners, kind="stable")].reshape(-1, 2)


def _rounding(poles: np.ndarray) -> float:
    """Distance between equal poles that rounding alone makes, 1/s."""
    return 10 * np.finfo(float).eps * poles.size * float(np.abs(poles).max(initial=0.0))


def _groups(poles: np.ndarray, rounding: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Chains of poles near each other, and their places: distances along the chain, less rounding."""
    sizes = np.abs(poles)
    units = RESOLUTION * np.maximum(np.maximum(sizes[:, None], sizes), rounding / RESOLUTION)
    steps = np.maximum(np.abs(poles[:, None] - poles) - rounding, 0.0) / units
    count, label = connected_components(sp.csr_array((steps <= APART).astype(float)), directed=False)
    found = []
    for k in range(count):
        group = np.flatnonzero(label == k)
        group = group[np.lexsort((np.real(poles[group]), np.imag(poles[group])))]
        found.append((group, np.concatenate([[0.0], np.cumsum(steps[group[1:], group[:-1]])])))
    return found


def _owners(order: np.ndarray, half: int, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvectors and the mode of each: two for each mode, so that the parts they take add up to the most.

    Rates of drifting rigid-body motions have eigenvectors of their own, which go to no mode.
    """
    sorted_back = np.empty_like(vectors)
    sorted_back[order] = vectors
    part = np.abs(sorted_back[:half]) ** 2 + np.abs(sorted_back[half : 2 * half]) ** 2
    chosen, owners = linear_sum_assignment(np.vstack([part, part]).T, maximize=True)
    return chosen, owners % half
