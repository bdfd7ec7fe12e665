"""What was measured: each integrator at each tolerance, and the reference that it was held against."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

# Errors, m, for which the printed table names a setting, beside the one that the scene wants.
_ASKED = (1e-6, 1e-9)


@dataclass(frozen=True)
class Attempt:
    """One integrator at one tolerance.

    Attributes
    ----------
    method : str
    tol : float
    error : float, m
        Largest distance of any node to the reference; infinite when the run failed.
    seconds : float, s
        Least wall time of three runs, compiled code warm.
    evaluations : int
    rod_drift : float
        Relative change of a rod's length.
    energy_drift : float
        Largest change of the total energy over the largest energy; nan where energy is not kept.
    momentum_drift : float
        Largest change of linear momentum over mass times top speed, and of angular momentum about the mass centre over
        that times the size; nan with loads, weight, drag or held nodes. Dampers in tendons keep both.
    failure : str
        Why it has no result: what went wrong, or that it was skipped.
    """

    method: str
    tol: float
    error: float
    seconds: float
    evaluations: int
    rod_drift: float
    energy_drift: float
    momentum_drift: float
    failure: str = ""

    @classmethod
    def failed(cls, method: str, tol: float, why: str) -> Attempt:
        """One without a result."""
        return cls(method, tol, np.inf, np.nan, 0, np.nan, np.nan, np.nan, why)


@dataclass(frozen=True)
class WorkPrecision:
    """All attempts, and the reference that they were measured against.

    Attributes
    ----------
    attempts : tuple of Attempt
    t_end : float, s
    reference_error : float, m
        Largest distance of the reference to a second run: what its own error may be.
    reference : str
        Which two runs these were.
    wanted : float, m
        Error that the recommended setting has to reach.
    failure : str
        Why there is no reference, and so no attempt; empty when there is one.
    """

    attempts: tuple[Attempt, ...]
    t_end: float
    reference_error: float
    reference: str = ""
    wanted: float = _ASKED[0]
    failure: str = ""

    def advised(self, error: float | None = None) -> Attempt | None:
        """The fastest attempt at least as accurate as asked for, m; None when none is, or the reference is not."""
        wanted = self.wanted if error is None else error
        good = [attempt for attempt in self.attempts if max(attempt.error, self.reference_error) <= wanted]
        return min(good, key=lambda attempt: attempt.seconds, default=None)

    def advice(self, error: float | None = None) -> str:
        """The setting to use for an error, m, in one line; by default for the error that the scene wants."""
        wanted = self.wanted if error is None else error
        best = self.advised(wanted)
        text = "no setting reaches it" if best is None else f'method = "{best.method}", tol = {best.tol:.0e}'
        return f"for {wanted:.0e} m: {text}"

    @property
    def still(self) -> bool:
        """Whether nothing moves, so that every setting is exact."""
        done = [a for a in self.attempts if not a.failure]
        return bool(done) and all(a.error == 0 for a in done)

    def table(self) -> str:
        """The attempts as aligned text, then the setting to use."""
        names = ("error [m]", "time [s]", "rhs", "rod drift", "energy", "momentum")
        lines = [" ".join([f"{'method':11} {'tol':>7}", *(f"{name:>10}" for name in names)])]
        lines += [self._line(a) for a in self.attempts]
        if self.still:
            return "\n".join([*lines, f"over {self.t_end:g} s; nothing moves, so there is nothing to choose"])
        lines.append(f"over {self.t_end:g} s; the reference is good to {self.reference_error:.0e} m: {self.reference}")
        lines += [self.advice(wanted) for wanted in sorted({self.wanted, *_ASKED}, reverse=True)]
        return "\n".join(lines)

    def to_dict(self) -> dict:
        """Everything as plain numbers and texts for JSON; None for what is not known."""
        best = self.advised()
        return {
            "t_end": self.t_end,
            "reference": self.reference,
            "reference_error": _plain(self.reference_error),
            "wanted": self.wanted,
            "recommended": None if best is None else {"method": best.method, "tol": best.tol},
            "failure": self.failure,
            "attempts": [{k: _plain(v) for k, v in asdict(a).items()} for a in self.attempts],
        }

    def _line(self, a: Attempt) -> str:
        if a.failure:
            return f"{a.method:11} {a.tol:7.0e} {a.failure}"
        below = a.error < self.reference_error
        error = f"<{self.reference_error:.1e}" if below else f"{a.error:.1e}"
        numbers = f"{error:>10} {a.seconds:10.2e} {a.evaluations:10d} {a.rod_drift:10.1e}"
        return f"{a.method:11} {a.tol:7.0e} {numbers} {_drift(a.energy_drift):>10} {_drift(a.momentum_drift):>10}"


def _plain(value: object) -> object:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _drift(drift: float) -> str:
    """A drift, or a dash where something changes what would be kept."""
    return "-" if np.isnan(drift) else f"{drift:.1e}"
