"""Structure-preserving doubling: each step squares the closed loop, so convergence is quadratic.

    A <- A W A,   G <- G + A W G A*,   H <- H + A* H W A,   W = (I + G H)^-1

H tends to the stabilising X of X = A*X (I + GX)^-1 A + H (Chu, Fan and Lin, Linear Algebra Appl. 396, 2005). The
continuous equation A*X + XA - XGX + Q = 0 enters through a Cayley transform with a shift gamma. A mode of frequency
omega and damping ratio zeta is seen with the decay 4 zeta min(gamma/omega, omega/gamma), which is what rounding has to
leave visible: the geometric mean of the slowest and the fastest rate is the best gamma. Measured at 200 states over
eight decades of frequency: 20 steps and a residual of 2e-13, against 33 steps and 1e-9 with gamma beyond the spectrum.

Real or complex; products and solves of size n only.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Inexact
from scipy.linalg import lapack

from tensctl.errors import SynthesisError

_STEPS = 60
_DONE = 1e-15
# The closed loop, squared at every step, has decayed to this when the doubling is done. An undamped mode that nothing
# drives stays at size one, however little the solution still grows.
_DECAYED = 1e-4
# Part of the closed loop's speed, about |G|^1/2 |Q|^1/2, below which the Cayley shift is not taken: A may be zero.
_SLOW = 1e-2
# (A - gamma I)^-1 larger than this over gamma: an unstable eigenvalue stands near gamma, or A is far from normal.
_NEAR = 1e4
# A Lyapunov solution is a correction here; this part of it is beyond what one correction can use.
_ENOUGH = 1e-8

Square = Inexact[np.ndarray, "n n"]


def doubling(A: Square, G: Square, H: Square, enough: float = _DONE) -> Square:
    """The stabilising solution of X = A*X (I + GX)^-1 A + H, to a part `enough` of itself.

    Raises
    ------
    SynthesisError
        When there is none: some mode is neither damped nor driven.
    """
    eye = np.eye(len(A))
    for _ in range(_STEPS):
        if enough > _DONE:  # refined afterwards, so an inverse is good enough, in two thirds of the time
            W = inverse(eye + G @ H)
            forward, spread = W @ A, W @ (G @ A.conj().T)
        else:
            solved = np.linalg.solve(eye + G @ H, np.hstack([A, G @ A.conj().T]))
            forward, spread = np.split(solved, 2, axis=1)
        growth = A.conj().T @ (H @ forward)
        G = hermitian(G + A @ spread)
        A, H = A @ forward, hermitian(H + growth)
        with np.errstate(over="ignore"):
            size, left = np.linalg.norm(H), np.linalg.norm(A)
        if not np.isfinite(size):
            break
        # What further steps add is at most about |A|^2 |H|.
        if left**2 <= enough or (np.linalg.norm(growth) <= _DONE * size and left <= _DECAYED):
            return H
    raise no_solution()


def no_solution() -> SynthesisError:
    """What is said where some mode is neither damped nor driven."""
    return SynthesisError(
        "the Riccati equation has no stabilising solution: some mode is neither damped nor driven by an input; "
        "see the controllability report, or give the mode a tendon that reaches it."
    )


def cayley_shift(A: Square, G: Square, Q: Square) -> float:
    """The shift gamma: between the slowest and the fastest rate of A, or beyond the spectrum where that is not safe."""
    open_loop = _size(A)
    closed_loop = np.sqrt(np.linalg.norm(G) * np.linalg.norm(Q))
    fastest = float(max(open_loop, _SLOW * closed_loop, np.finfo(float).tiny))
    try:
        between = np.sqrt(fastest / _size(inverse(A)))
        near = _size(inverse(A - between * np.eye(len(A)))) * between
    except np.linalg.LinAlgError:
        return 1.1 * fastest
    return float(between) if between >= np.finfo(float).eps * fastest and near <= _NEAR else 1.1 * fastest


def cayley(A: Square, G: Square, Q: Square, gamma: float) -> tuple[Square, Square, Square]:
    """The discrete triple with the same stabilising solution as the continuous one."""
    eye = np.eye(len(A))
    shifted = np.linalg.inv(A - gamma * eye)
    weighted, driven = Q @ shifted, shifted @ G
    W = np.linalg.inv(A.conj().T - gamma * eye + weighted @ G)
    return eye + 2 * gamma * W.conj().T, 2 * gamma * (driven @ W), 2 * gamma * (W @ weighted)


def lyapunov(A: Square, C: Square, gamma: float) -> Square | None:
    """X of A*X + XA + C = 0 for a stable A to about eight digits, or nothing when A is not stable.

    The squared Smith method: X = sum (S*)^j D S^j with the Cayley transform S of A, twice as many terms at each step.
    """
    eye = np.eye(len(A))
    shifted = inverse(A - gamma * eye)
    S = eye + 2 * gamma * shifted
    X = 2 * gamma * (shifted.conj().T @ C @ shifted)
    for _ in range(_STEPS):
        with np.errstate(over="ignore", invalid="ignore"):
            growth = S.conj().T @ X @ S
            X, left = X + growth, np.linalg.norm(S)
            done = np.linalg.norm(growth) <= _ENOUGH * np.linalg.norm(X) and left <= 1
            S = S if done else S @ S
            # What further steps add is at most about |S|^2 |X|.
            done = done or np.linalg.norm(S) ** 2 <= _ENOUGH
        if done:
            return hermitian(X)
        if not np.isfinite(X).all():
            break
    return None


def inverse(M: Square) -> Square:
    """M^-1 by LAPACK's getrf and getri, in half the time of a solve with the identity.

    Raises
    ------
    numpy.linalg.LinAlgError
        When M is exactly singular.
    """
    routines: Any = lapack.get_lapack_funcs(("getrf", "getri", "getri_lwork"), (M,))
    factor, invert, work = routines
    triangles, pivots, fault = factor(M)
    if fault:
        raise np.linalg.LinAlgError("the matrix is singular.")
    size = int(np.real(work(len(M))[0]))
    return invert(triangles, pivots, lwork=size, overwrite_lu=True)[0]


def hermitian(M: Square) -> Square:
    """M without its skew part, which is rounding."""
    return 0.5 * (M + M.conj().T)


def _size(A: np.ndarray) -> float:
    """A bound on the 2-norm, within a factor of a few for the matrices that are met."""
    return float(np.sqrt(np.linalg.norm(A, 1) * np.linalg.norm(A, np.inf)))
