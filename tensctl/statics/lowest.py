"""The lowest modes of a large structure: H phi = omega^2 M phi by Lanczos on the shifted inverse.

In mass-scaled coordinates A = M^-1/2 H M^-1/2, the shift is put below all eigenvalues (no pivot of A - shift is
negative), so the largest eigenvalues of P (A - shift)^-1 P, P across the rigid-body motions, are the lowest of A.
Accurate to about 1e-15 of the largest eigenvalue of A, like any method that only sees A.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from tensctl.statics.factor import Factor

# Below this size all eigenvalues at once are faster than Lanczos.
_SMALL = 100


def lowest_modes(scaled: sp.csr_array, held: np.ndarray, count: int, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """The lowest eigenvalues (ascending) and eigenvectors of A across the held motions.

    Parameters
    ----------
    scaled : (size, size) sparse, real symmetric or complex Hermitian
    held : (size, r), orthonormal columns, A held = 0
    count : int
    tolerance : float
        What is rounding beside the largest eigenvalue; the first shift lies a thousand times further down.
    """
    size = len(held)
    count = min(count, size - held.shape[1])
    if count <= 0:
        return np.zeros(0), np.zeros((size, 0))
    if size <= _SMALL or count > size // 3:
        return _all(scaled, held, count)
    shift, factor = _below_all(scaled, 1e3 * tolerance)

    def inverse(x: np.ndarray) -> np.ndarray:
        y = factor.solve((x - held @ (held.conj().T @ x)).ravel())
        return y - held @ (held.conj().T @ y)

    operator = spla.LinearOperator((size, size), matvec=inverse, dtype=scaled.dtype)
    start = inverse(np.random.default_rng(0).standard_normal(size).astype(scaled.dtype))
    values, vectors = spla.eigsh(operator, k=count, which="LA", v0=start, ncv=min(size, max(2 * count + 1, 40)))
    order = np.argsort(-values)
    return shift + 1.0 / values[order], vectors[:, order]


def _all(scaled: sp.csr_array, held: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    values, vectors = across(scaled.toarray(), held)
    return values[:count], vectors[:, :count]


def across(A: np.ndarray, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All eigenvalues and eigenvectors of a symmetric matrix across some orthonormal columns, ascending."""
    rest = A - held @ (held.conj().T @ A)
    rest -= (rest @ held) @ held.conj().T
    # On the held columns more than any eigenvalue, so they come last and are left out.
    rest += 2.0 * max(float(np.abs(A).sum(axis=1).max(initial=0.0)), 1e-300) * (held @ held.conj().T)
    values, vectors = sla.eigh(0.5 * (rest + rest.conj().T), overwrite_a=True, check_finite=False)
    kept = len(A) - held.shape[1]
    return values[:kept], vectors[:, :kept]


def _below_all(scaled: sp.csr_array, step: float) -> tuple[float, Factor]:
    """A shift below every eigenvalue and the factor there."""
    unit = sp.eye_array(scaled.shape[0])
    while True:
        factor = Factor.of(scaled + step * unit)
        if factor.negative == 0:
            return -step, factor
        step *= 10.0
