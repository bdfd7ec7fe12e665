"""The best r of all tendons as actuators, by a stated measure, with a bound on what any other choice could reach.

    max f(z)   over z_t in {0, 1}, sum z = r,   f concave (`analysis.measures`)

Greedy choice, then exchanges of one tendon for another; of a monotone submodular f greedy reaches at least 1 - 1/e of
the optimum (Nemhauser, Wolsey and Fisher, Math. Program. 14, 1978). The bound is computed: every choice y satisfies
f(y) <= f(z) + f'(z)(y - z) at every z, and of submodular f also f(y) <= f(T) + sum_t [f(T + t) - f(T)] y_t at every set
T. Cuts at the optima of the cuts so far (Kelley) bring the bound down to that of fractions of tendons; branch and bound
over the same cuts makes it exact where few enough choices are left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.analysis.measures import MEASURES, Measure, MeasureName, measure_of, moved_outputs
from tensctl.errors import LinearizationError
from tensctl.linear import LinearModel
from tensctl.threads import one_blas_thread

# Cuts of the relaxation: the bound falls little after as many; LP and measure cost 2 ms each at (3,1).
_CUTS = 60
# Choices that branch and bound may measure, and branches it may look at; about 2 s at (3,1).
_MEASURED = 4000
_BRANCHES = 40_000
# Exchanges are tried in up to so many rounds, and in models of up to so many tendons.
_ROUNDS = 20
_EXCHANGED = 60
# A choice this much better, relative to the bound, is better.
_BETTER = 1e-9


@dataclass(frozen=True, eq=False)
class Placement:
    """A choice of actuators.

    Attributes
    ----------
    measure : Measure
    labels : tuple of str
        All tendons to choose from.
    chosen : (r,) int
    bound : float
        No choice of r tendons measures more.
    greedy : float
        What greedy choice alone measures.
    exact : bool
        Whether branch and bound has shown that nothing is better.
    """

    measure: Measure
    labels: tuple[str, ...]
    chosen: np.ndarray
    bound: float
    greedy: float
    exact: bool

    @property
    def value(self) -> float:
        """The measure of the choice, recomputed."""
        return self.measure(_taken(self.chosen, self.measure.count))

    @property
    def gap(self) -> float:
        """What another choice could have more, as part of the largest that all tendons together measure over none."""
        return (self.bound - self.value) / _span(self.measure)

    @property
    def tendons(self) -> tuple[str, ...]:
        """Labels of the chosen tendons."""
        return tuple(self.labels[t] for t in self.chosen)

    def verify(self, tol: float = 1e-9) -> None:
        """Check that the choice measures no more than the bound and no less than greedy.

        Raises
        ------
        LinearizationError
            With the numbers.
        """
        if not self.greedy - tol * _span(self.measure) <= self.value <= self.bound + tol * _span(self.measure):
            raise LinearizationError(
                f"the choice measures {self.value:.6g}, not between {self.greedy:.6g} and {self.bound:.6g}."
            )

    def __str__(self) -> str:
        """The choice in one sentence."""
        sure = "nothing is better" if self.exact else f"at most {100 * self.gap:.2g} % of what all have is missing"
        return f"best {len(self.chosen)} by {self.measure.name}: {', '.join(self.tendons)} ({self.value:.5g}; {sure})"


@one_blas_thread()
def place(
    linear: LinearModel, count: int, measure: MeasureName = "log det", *, horizon: float | None = None
) -> Placement:
    """Choose `count` tendons as actuators.

    Parameters
    ----------
    measure : "log det", "inverse", "least gain" or "static reach"
        As `tensctl.analysis.measures` states them.
    horizon : float, s, optional
        Of the Gramians; one period of the slowest flexible mode by default.

    Raises
    ------
    LinearizationError
        For more tendons than there are, or an unknown measure.
    """
    labels = linear.dynamics.input_labels
    if not 1 <= count <= len(labels):
        raise LinearizationError(f"{count} actuators are asked for; expected 1 to {len(labels)} acting tendons.")
    f = measure_of(linear, measure, slowest_period(linear) if horizon is None else horizon)
    greedy = _greedy(f, count)
    start = f(_taken(greedy, f.count))
    chosen = _exchanged(f, greedy)
    cuts = _Cuts(f, count)
    for k in range(count if f.submodular else 0):
        cuts.add_submodular(_taken(greedy[:k], f.count))
    bound = cuts.bound_of(f(_taken(chosen, f.count)))
    chosen, exact = cuts.searched(chosen)
    best = f(_taken(chosen, f.count))
    return Placement(f, labels, np.sort(chosen), best if exact else max(bound, best), start, exact)


def place_by_all(linear: LinearModel, count: int, horizon: float | None = None) -> tuple[Placement, ...]:
    """One choice by every measure that the model has outputs for."""
    without = not moved_outputs(linear)
    names: list[MeasureName] = [name for name in MEASURES if not (name == "static reach" and without)]
    return tuple(place(linear, count, name, horizon=horizon) for name in names)


def slowest_period(linear: LinearModel) -> float:
    """Period of the slowest flexible mode, s; one second where there is none."""
    return 1.0 / min((mode.frequency for mode in linear.modes if mode.frequency > 0), default=1.0)


def _taken(chosen: np.ndarray, count: int) -> Float[np.ndarray, " nu"]:
    z = np.zeros(count)
    z[chosen] = 1.0
    return z


def _span(f: Measure) -> float:
    return max(f(np.ones(f.count)) - f(np.zeros(f.count)), np.finfo(float).tiny)


def _greedy(f: Measure, count: int) -> np.ndarray:
    """One tendon after the other, each the best; of equals the one that points most to where the measure grows."""
    z, order = np.zeros(f.count), []
    for _ in range(count):
        left = np.flatnonzero(z == 0)
        slope = f.slope(z + 1e-3 * (z == 0))
        values = [f(z + (np.arange(f.count) == t)) for t in left]
        order.append(left[np.lexsort((slope[left], np.round(values, 12)))[-1]])
        z[order[-1]] = 1.0
    return np.array(order)


def _exchanged(f: Measure, chosen: np.ndarray) -> np.ndarray:
    """Exchanges of one tendon while they help."""
    z, span = _taken(chosen, f.count), _span(f)
    value = f(z)
    for _ in range(_ROUNDS if f.count <= _EXCHANGED else 0):
        pairs = [(out, into) for out in np.flatnonzero(z) for into in np.flatnonzero(z == 0)]
        values = [f(z - (np.arange(f.count) == out) + (np.arange(f.count) == into)) for out, into in pairs]
        best = int(np.argmax(values)) if values else -1
        if best < 0 or values[best] <= value + _BETTER * span:
            break
        (out, into), value = pairs[best], values[best]
        z[out], z[into] = 0.0, 1.0
    return np.flatnonzero(z)


class _Cuts:
    """Planes above f: f(y) <= base + slope'y."""

    def __init__(self, f: Measure, count: int) -> None:
        self._f, self._count = f, count
        self._bases: list[float] = []
        self._slopes: list[np.ndarray] = []

    def add(self, z: np.ndarray) -> float:
        """The plane that touches f at z, and f there."""
        value, slope = self._f(z), self._f.slope(z)
        self._bases.append(value - float(slope @ z))
        self._slopes.append(slope)
        return value

    def add_submodular(self, z: np.ndarray) -> None:
        """The plane f(z) + sum of what each tendon adds to the choice z: above f where what it adds can only shrink."""
        value, each = self._f(z), np.eye(self._f.count)
        self._bases.append(value)
        self._slopes.append(np.array([0.0 if z[t] else self._f(z + each[t]) - value for t in range(z.size)]))

    def bound_of(self, reached: float) -> float:
        """Least upper bound over fractions of tendons that the cuts find."""
        from scipy.optimize import linprog

        n, bound, best = self._f.count, np.inf, -np.inf
        z = np.full(n, self._count / n)
        for _ in range(_CUTS):
            best = max(best, self.add(z))
            found = linprog(
                np.concatenate([np.zeros(n), [-1.0]]),
                np.hstack([-np.array(self._slopes), np.ones((len(self._bases), 1))]),
                np.array(self._bases),
                np.concatenate([np.ones(n), [0.0]])[None],
                [self._count],
                [(0, 1)] * n + [(None, None)],
                method="highs",
            )
            if found.x is None:
                break
            bound = min(bound, float(found.x[-1]))
            if bound - max(best, reached) <= _BETTER * abs(bound):
                break
            # Half way to the best point so far: plain Kelley swings from corner to corner.
            z = 0.5 * (z + np.clip(found.x[:n], 0, 1))
        return bound

    def searched(self, chosen: np.ndarray) -> tuple[np.ndarray, bool]:
        """Branch and bound over the cuts; the best choice found, and whether the search came to its end."""
        f, n, span = self._f, self._f.count, _span(self._f)
        best, value = chosen, f(_taken(chosen, n))
        order = np.argsort(-np.mean(self._slopes, axis=0), kind="stable")
        bases, slopes = np.array(self._bases), np.array(self._slopes)[:, order]
        stack: list[tuple[tuple[int, ...], int]] = [((), 0)]
        branches, measured = 0, 0
        while stack:
            taken, place = stack.pop()
            branches += 1
            if branches > _BRANCHES or measured > _MEASURED:
                return best, False
            missing = self._count - len(taken)
            if n - place < missing:
                continue
            fixed = bases + slopes[:, list(taken)].sum(axis=1)
            rest = np.sort(slopes[:, place:], axis=1)[:, ::-1][:, :missing].sum(axis=1)
            if (fixed + rest).min() <= value + _BETTER * span:
                continue
            if missing == 0:
                measured += 1
                z = _taken(order[list(taken)], n)
                here = self.add(z)
                bases = np.append(bases, self._bases[-1])
                slopes = np.vstack([slopes, self._slopes[-1][order]])
                if here > value:
                    best, value = order[list(taken)], here
                continue
            stack.append((taken, place + 1))
            stack.append(((*taken, place), place + 1))
        return best, True
