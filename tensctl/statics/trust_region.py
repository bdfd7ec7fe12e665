"""A quadratic model of the energy with absolute curvatures, and its best step within a trust radius.

In a basis Q that makes Q'HQ = diag(c), the step is -Q b / (|c| + mu) with b = Q'g and the smallest mu >= 0 that keeps
it inside: a negative curvature counts by its size, so a saddle repels, and every direction keeps its own scale. (A
common shift H + mu I has to exceed the worst negative curvature and then holds back all soft directions: from the
cylinder it needed 70 factorisations at (20,10) where this needs 8.)

Small models take all eigenvectors. Large ones take the space spanned by powers of H and of its inverse on g, at the
price of one sparse factor: it holds the full Newton step, and what it misses has small influence on |H|^-1 g. Counts
of steps are the same as with all eigenvectors up to (20,10). Curvatures below 1e-15 of the largest are noise and get
no step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.statics.factor import Factor

_CURVATURE_NOISE = 1e-15
# Powers of H and of its inverse where H has negative eigenvalues (6 to 20 give the same number of steps at (20,10)),
# and where it has none: there the Newton step itself is in the space, and only its way out of the radius matters.
_POWERS = 12
_POWERS_DEFINITE = 2


@dataclass(frozen=True, eq=False)
class Model:
    """The energy's quadratic model, diagonal in its basis.

    Attributes
    ----------
    basis : (size, k), orthonormal columns
    curvature : (k,) N/m
    slope : (k,) N
    """

    basis: Float[np.ndarray, "size k"]
    curvature: Float[np.ndarray, " k"]
    slope: Float[np.ndarray, " k"]

    def step(self, radius: float) -> tuple[Float[np.ndarray, " size"], float]:
        """Step of at most `radius` (m, root mean square), and the decrease of energy that the model promises, J."""
        size = np.abs(self.curvature)
        live = size > _CURVATURE_NOISE * size.max(initial=0.0)
        slope, size = np.where(live, self.slope, 0.0), np.where(live, size, 1.0)
        step = -slope / (size + _shift(slope, size, radius * np.sqrt(len(self.basis))))
        promised = -(slope @ step) - 0.5 * (self.curvature * live) @ step**2
        return self.basis @ step, float(promised)


def dense_model(hessian: sp.csr_array, gradient: np.ndarray, held: Float[np.ndarray, "size r"]) -> Model:
    """Model in all eigenvectors; the held motions get the largest curvature, so rounding cannot move along them."""
    H = hessian.toarray()
    across = H - held @ (held.T @ H)
    across -= (across @ held) @ held.T
    across += np.abs(H).sum(axis=1).max(initial=0.0) * (held @ held.T)
    curvature, basis = sla.eigh(across, overwrite_a=True, check_finite=False)
    return Model(basis, curvature, basis.T @ gradient)


def krylov_model(hessian: sp.csr_array, gradient: np.ndarray, held: Float[np.ndarray, "size r"]) -> Model:
    """Model in the span of H^k g and H^-k g, across the held motions."""
    factor = Factor.of(grounded(hessian, held))
    space = _Space(held, 2 + 2 * _POWERS)
    up, down = space.add(gradient), space.add(factor.solve(gradient))
    for _ in range(_POWERS if factor.negative else _POWERS_DEFINITE):
        up, down = space.add(hessian @ up), space.add(factor.solve(down))
    basis = space.basis
    curvature, turn = np.linalg.eigh(basis.T @ (hessian @ basis))
    return Model(basis @ turn, curvature, turn.T @ (basis.T @ gradient))


def grounded(hessian: sp.csr_array, held: Float[np.ndarray, "size r"]) -> sp.csc_array:
    """H with a spring on as many coordinates as there are held motions, chosen so that none is left without.

    Where H does not see the held motions and g does no work on them, the springs carry nothing: the solution of
    H s = -g is exact, made unique, and the number of negative eigenvalues is that of H.
    """
    if held.shape[1] == 0:
        return sp.csc_array(hessian)
    chosen = sla.qr(held.conj().T, mode="r", pivoting=True)[1][: held.shape[1]]
    spring = np.zeros(len(held))
    spring[chosen] = float(np.abs(hessian.diagonal()).mean()) or 1.0
    return sp.csc_array(hessian + sp.diags_array(spring))


class _Space:
    """Orthonormal vectors across the held motions, one after the other."""

    def __init__(self, held: np.ndarray, most: int) -> None:
        self._held = held
        self._vectors = np.empty((len(held), most), order="F")
        self._count = 0

    @property
    def basis(self) -> np.ndarray:
        return self._vectors[:, : self._count]

    def add(self, vector: np.ndarray) -> np.ndarray:
        """The vector's part across all others, of length one; the vector itself when nothing is left of it."""
        size = np.linalg.norm(vector)
        if not (size > 0 and np.isfinite(size)):
            return vector
        new = vector / size
        for _ in range(2):  # once is not square to rounding when most of the vector is taken away
            new = new - self._held @ (self._held.T @ new)
            new = new - self.basis @ (self.basis.T @ new)
        left = np.linalg.norm(new)
        if left < 1e-12 or self._count >= min(self._vectors.shape):
            return vector / size
        self._vectors[:, self._count] = new / left
        self._count += 1
        return new / left


def _shift(slope: np.ndarray, size: np.ndarray, limit: float) -> float:
    """Smallest mu >= 0 with |slope/(size + mu)| <= limit, by Newton on the secular equation."""
    mu = 0.0
    for _ in range(50):
        step = slope / (size + mu)
        length = np.linalg.norm(step)
        if length <= 1.001 * limit:
            break
        mu += float((length / limit - 1.0) * length**2 / (step**2 @ (1.0 / (size + mu))))
    return mu
