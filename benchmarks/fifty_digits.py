"""Modal gains, Hautus distances and Riccati gains of small models in high precision, as references.

Hessian, masses, input map, A, B, Q and R are the doubles that they are; all that follows from them is computed anew.
Distances take 100 digits, since singular values come from M M*; the rest takes 50.
"""

from dataclasses import dataclass

import mpmath as mp
import numpy as np

from tensctl.analysis.scaling import tension_slopes
from tensctl.linear import LinearModel

DIGITS = 50
# A Riccati solution that leaves more than this of its terms is no reference.
_LEFT = 1e-30
_STEPS = 200


@dataclass(frozen=True)
class Undamped:
    """Squared frequencies, ascending, and the rows of B of each mode, of the Hessian and the masses as they are."""

    omega2: list
    rows: np.ndarray

    @classmethod
    def of(cls, linear: LinearModel) -> "Undamped":
        """Of a model without damping."""
        manifold, members = linear.equilibrium.potential.manifold, linear.dynamics.members
        H = exact(linear.equilibrium.point.hessian.toarray())
        root = np.array([mp.sqrt(m) for m in exact(manifold.mass(members.mass))])
        omega2, vectors = mp.eigsy(mp.matrix(((H + H.T) / 2 / np.outer(root, root)).tolist()))
        drive = exact(linear.sparse.G.toarray()) / root[:, None]
        return cls(list(omega2), np.array(vectors.tolist(), dtype=object).T @ drive)

    def pair(self) -> tuple[np.ndarray, np.ndarray]:
        """A and B in energy coordinates, positions first."""
        count = len(self.omega2)
        A, omega = exact(np.zeros((2 * count, 2 * count))), [mp.sqrt(w) for w in self.omega2]
        for k, w in enumerate(omega):
            A[k, count + k], A[count + k, k] = w, -w
        return A, np.vstack([0 * self.rows, self.rows])


def exact(values: np.ndarray) -> np.ndarray:
    """Doubles as numbers of high precision."""
    return np.vectorize(lambda value: mp.mpf(float(value)), otypes=[object])(values)


def size(values: np.ndarray) -> mp.mpf:
    """Root of the sum of squares."""
    return mp.sqrt(mp.fsum(abs(value) ** 2 for value in np.ravel(values)))


def group_gains(linear: LinearModel, groups: list[np.ndarray]) -> np.ndarray:
    """Root of the sum of squared gains of each group of near frequencies, which no choice of directions changes."""
    rows = Undamped.of(linear).rows
    return np.array([float(size(rows[group])) for group in groups])


def damped_gains(linear: LinearModel) -> np.ndarray:
    """sqrt(2) times the drive of each left eigenvector of the damped A, ascending."""
    _, vectors = mp.eig(mp.matrix(linear.A.T.tolist()))
    vectors, B = np.array(vectors.tolist(), dtype=object), exact(linear.B)
    return np.sort([float(mp.sqrt(2) * size(v @ B) / size(v)) for v in vectors.T])


def distances(linear: LinearModel) -> np.ndarray:
    """Smallest singular value of [A - lambda I, B] at every eigenvalue of the upper half plane, ascending, 1/s."""
    with mp.workdps(2 * DIGITS):
        if linear.dynamics.damped:
            A, B = exact(linear.A), exact(linear.B)
            poles = [pole for pole in mp.eig(mp.matrix(A.tolist()))[0] if pole.imag >= 0]
        else:
            found = Undamped.of(linear)
            (A, B), poles = found.pair(), [mp.mpc(0, mp.sqrt(w)) for w in found.omega2]
        B = B / np.array([mp.sqrt(slope) for slope in exact(tension_slopes(linear))])
        eye = exact(np.eye(len(A)))
        return np.sort([float(_smallest(np.hstack([A - pole * eye, B]))) for pole in poles])


def _smallest(M: np.ndarray) -> mp.mpf:
    square = M @ np.vectorize(mp.conj, otypes=[object])(M).T
    return mp.sqrt(abs(mp.eighe(mp.matrix(square.tolist()), eigvals_only=True)[0]))


def regulator(A: np.ndarray, B: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """K = R^-1 B'X with the stabilising X of A'X + XA - X B R^-1 B' X + Q = 0, by doubling with a shift above |A|.

    Raises
    ------
    ArithmeticError
        When the equation is not solved to 30 digits.
    """
    A, B, Q, R = (exact(M) for M in (A, B, Q, R))
    Q = (Q + Q.T) / 2
    eye, weighted = exact(np.eye(len(A))), inverse(R) @ B.T
    G, gamma = B @ weighted, mp.sqrt(size(A) / size(inverse(A)))
    shifted = inverse(A - gamma * eye)
    W = inverse(A.T - gamma * eye + Q @ shifted @ G)
    F, S, X = eye + 2 * gamma * W.T, 2 * gamma * shifted @ G @ W, 2 * gamma * W @ Q @ shifted
    for _ in range(_STEPS):
        inner = inverse(eye + S @ X)
        F, S, X = F @ inner @ F, S + F @ inner @ S @ F.T, X + F.T @ X @ inner @ F
        if size(F) < mp.mpf(10) ** (-DIGITS // 2):
            break
    terms = (A.T @ X, X @ A, -X @ G @ X, Q)
    if not size(sum(terms)) <= _LEFT * sum(size(term) for term in terms):
        raise ArithmeticError("the reference does not solve the Riccati equation")
    return weighted @ X


def inverse(M: np.ndarray) -> np.ndarray:
    """M^-1."""
    return np.array(mp.inverse(mp.matrix(M.tolist())).tolist(), dtype=object)
