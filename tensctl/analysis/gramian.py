"""Gramians in square-root form, and what it costs to get anywhere in a given time.

    W(T) = int_0^T e^(At) B R^-1 B* e^(A*t) dt = L L*,   W(2h) = W(h) + F W(h) F*,  F = e^(Ah)

The factor is doubled, [L, F L], and shortened by QR to a triangle, so W is never formed and a direction that costs
1e20 times another keeps its digits. It starts with Gauss points over a step in which A turns by less than one radian.
Without damping each F is made of sines and cosines of its own time; with damping F is squared. The least int u'Ru dt
that brings c'x from rest to one is 1/|L'c|^2. Real, or complex as the harmonics of a symmetric structure have it.

Accuracy: phases omega T are good to 1e-16 of themselves, so times beyond 1e12 periods mean nothing; with damping the
squared F errs by its number of squarings times that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Inexact, Int

from tensctl.analysis.scaling import tension_slopes
from tensctl.errors import LinearizationError
from tensctl.linear import LinearModel
from tensctl.threads import one_blas_thread

# Points of Gauss and Legendre over one radian: the error term of 10 points is below 1e-20.
_POINTS = 10
# Doublings after which an endless horizon has not converged; 2^60 radians are more than any damping leaves.
_DOUBLINGS = 60
# An endless Gramian is done when the next part adds less than this of its size.
_DONE = 1e-17


class Verified:
    """A Gramian, or one by harmonic, that knows its residual."""

    @property
    def residual(self) -> float:
        """What the equation of W leaves, over the norms of its terms."""
        raise NotImplementedError

    def verify(self, tol: float = 1e-9) -> None:
        """Check the equation of W.

        Raises
        ------
        LinearizationError
            With the residual.
        """
        if not self.residual <= tol:
            raise LinearizationError(
                f"the Gramian leaves {self.residual:.1e} of its equation; at most {tol:.0e} is expected."
            )


@dataclass(frozen=True, eq=False)
class Gramian(Verified):
    """A Gramian W = L L*.

    Attributes
    ----------
    A, B : (n, n), (n, m)
        Of the equation A W + W A* + B B* = e^(AT) B B* e^(A*T); B is weighted by R already.
    horizon : float, s
        T; infinite for a stable A.
    factor : (n, n)
        L, lower triangular.
    """

    A: Inexact[np.ndarray, "n n"]
    B: Inexact[np.ndarray, "n m"]
    horizon: float
    factor: Inexact[np.ndarray, "n n"]

    @property
    def matrix(self) -> Inexact[np.ndarray, "n n"]:
        """W itself, in which small directions are lost."""
        return self.factor @ self.factor.conj().T

    @property
    def spread(self) -> float:
        """Energy of the dearest direction over that of the cheapest; infinite where one cannot be reached."""
        values = np.linalg.svd(self.factor, compute_uv=False)
        return float((values[0] / values[-1]) ** 2) if values[-1] > 0 else np.inf

    def reach(self, directions: Inexact[np.ndarray, "k n"]) -> Float[np.ndarray, " k"]:
        """|L*c|^2 of each direction, a row c*."""
        return (np.abs(np.asarray(directions) @ self.factor) ** 2).sum(axis=1)

    def energies(self, directions: Inexact[np.ndarray, "k n"]) -> Float[np.ndarray, " k"]:
        """Least int u'Ru dt that brings each c'x from rest to one; the rest of x may end anywhere."""
        with np.errstate(divide="ignore"):
            return 1.0 / self.reach(directions)

    def state_energies(self, states: Inexact[np.ndarray, "k n"]) -> Float[np.ndarray, " k"]:
        """Least int u'Ru dt that brings the whole state from rest to each of the given ones."""
        return (np.abs(np.linalg.solve(self.factor, np.asarray(states).T)) ** 2).sum(axis=0)

    @cached_property
    def left(self) -> tuple[float, tuple[float, ...]]:
        """Norm of what the equation of W leaves, and those of its terms."""
        W, drive = self.matrix, self.B @ self.B.conj().T
        end = np.zeros_like(drive)
        if np.isfinite(self.horizon):
            import scipy.linalg as sla

            last = sla.expm(self.A * self.horizon) @ self.B
            end = last @ last.conj().T
        terms = (self.A @ W, W @ self.A.conj().T, drive, -end)
        return float(np.linalg.norm(np.sum(terms, axis=0))), tuple(float(np.linalg.norm(term)) for term in terms)

    @property
    def residual(self) -> float:
        """What the equation of W leaves, over the norms of its terms."""
        left, terms = self.left
        return left / sum(terms) if sum(terms) > 0 else 0.0


def controllability_gramian(
    linear: LinearModel, horizon: float, *, weights: Float[np.ndarray, " nu"] | None = None
) -> Gramian:
    """What the tendons reach from rest within a time, of the flexible model.

    Parameters
    ----------
    horizon : float, s
        Infinite for a damped model.
    weights : (nu,), optional
        R of int u'Ru dt; dT/du of each tendon by default, so that u'Ru is twice the elastic energy of the shortening.

    Raises
    ------
    LinearizationError
        For a horizon that is not positive, or infinite without damping.
    """
    flexible = linear.flexible
    R = tension_slopes(flexible) if weights is None else np.asarray(weights, float)
    return gramian(flexible.A, flexible.B / np.sqrt(R), horizon, oscillators(flexible))


def observability_gramian(linear: LinearModel, horizon: float) -> Gramian:
    """What the outputs show of a state within a time: int |y|^2 dt = x' W x; the dual of `controllability_gramian`."""
    flexible = linear.flexible
    return gramian(flexible.A.T, flexible.C.T, horizon, oscillators(flexible), transposed=True)


def single_gramians(linear: LinearModel, horizon: float) -> Float[np.ndarray, "nu n n"]:
    """Gramians of each tendon alone, which add up to that of all; inputs in the square root of their energy.

    One doubling for each tendon: 0.05 s for 24 tendons, half a minute for the 168 of (6,3).
    """
    flexible = linear.flexible
    B = flexible.B / np.sqrt(tension_slopes(flexible))
    modes = oscillators(flexible)
    each = [gramian(flexible.A, B[:, [t]], horizon, modes).matrix for t in range(B.shape[1])]
    return np.array(each).reshape(-1, len(flexible.A), len(flexible.A))


@dataclass(frozen=True, eq=False)
class Oscillators:
    """Undamped modes, which turn by themselves: squared frequencies, scales of positions, and places in the state."""

    omega2: Float[np.ndarray, " modes"]
    scales: Float[np.ndarray, " modes"]
    order: Int[np.ndarray, " nx"]


def oscillators(flexible: LinearModel) -> Oscillators | None:
    """The modes of a flexible model without damping; None with it."""
    omega2 = np.array([mode.omega2 for mode in flexible.modes], float)
    return None if flexible.dynamics.damped else Oscillators(omega2, flexible.scales, flexible.order)


@one_blas_thread()
def gramian(
    A: Inexact[np.ndarray, "n n"],
    B: Inexact[np.ndarray, "n m"],
    horizon: float,
    undamped: Oscillators | None,
    *,
    transposed: bool = False,
) -> Gramian:
    """The Gramian of A and B, which is weighted already.

    Parameters
    ----------
    undamped : Oscillators or None
        What A is made of, where there is no damping.
    transposed : bool
        Whether A is the transpose of theirs.

    Raises
    ------
    LinearizationError
        For a horizon that is not positive, or infinite without damping.
    """
    if not horizon > 0:
        raise LinearizationError(f"horizon is {horizon}; expected a time > 0 s.")
    endless, damped = np.isinf(horizon), undamped is None
    if endless and (not damped or np.real(np.linalg.eigvals(A)).max(initial=-np.inf) >= 0):
        raise LinearizationError("an infinite horizon needs damping in every mode; give the horizon as a time in s.")
    speed = float(np.linalg.norm(A, 2)) if A.size else 0.0
    turn = _Turn(A, undamped, transposed=transposed)
    if endless:
        return Gramian(A, B, np.inf, summed(turn(1.0 / speed), _first(turn, B, 1.0 / speed)))
    doublings = int(np.ceil(np.log2(max(horizon * speed, 1.0))))
    step = horizon / 2**doublings
    L, F = _shortened(_first(turn, B, step)), turn(step)
    for k in range(doublings):
        L = _shortened(np.hstack([L, F @ L]))
        F = F @ F if damped else turn(step * 2 ** (k + 1))
    return Gramian(A, B, float(horizon), L)


def summed(F: Inexact[np.ndarray, "n n"], B: Inexact[np.ndarray, "n m"]) -> Inexact[np.ndarray, "n n"]:
    """L with L L* = sum_j F^j B B* F*^j of a stable F, lower triangular: the Gramian of a sampled system."""
    L = _shortened(B)
    for _ in range(_DOUBLINGS):
        more = F @ L
        L = _shortened(np.hstack([L, more]))
        if np.linalg.norm(more) <= _DONE * np.linalg.norm(L):
            break
        F = F @ F
    return L


def _first(turn: _Turn, B: np.ndarray, step: float) -> np.ndarray:
    """Factor of W over one step, by Gauss points: weights are positive, so they have roots."""
    points, weights = np.polynomial.legendre.leggauss(_POINTS)
    times = 0.5 * step * (points + 1)
    return np.hstack([np.sqrt(0.5 * step * w) * (turn(t) @ B) for t, w in zip(times, weights, strict=True)])


def _shortened(L: np.ndarray) -> np.ndarray:
    """A square lower triangle with the same L L*."""
    n, m = L.shape
    wide = L if m >= n else np.hstack([L, np.zeros((n, n - m))])
    return np.asarray(np.linalg.qr(wide.conj().T, mode="r")).conj().T


class _Turn:
    """e^(At): each undamped mode turns by its own angle, exactly; anything else is a matrix exponential."""

    def __init__(self, A: np.ndarray, undamped: Oscillators | None, *, transposed: bool) -> None:
        self._A, self._undamped, self._transposed = A, undamped, transposed

    def __call__(self, t: float) -> np.ndarray:
        if self._undamped is None:
            import scipy.linalg as sla

            return sla.expm(self._A * t)
        modes, half = self._undamped, self._undamped.omega2.size
        omega = np.sqrt(modes.omega2 + 0j)
        s, one = modes.scales, np.arange(half)
        # cos and sin of a real or an imaginary angle; sin(w t)/w is t where w is zero.
        cos, over = np.real(np.cos(omega * t)), np.real(t * np.sinc(omega * t / np.pi))
        full = np.zeros((2 * half, 2 * half))
        full[one, one], full[one + half, one + half] = cos, cos
        full[one, one + half], full[one + half, one] = s * over, -np.real(omega**2) / s * over
        sorted_ = full[np.ix_(modes.order, modes.order)]
        return sorted_.T if self._transposed else sorted_
