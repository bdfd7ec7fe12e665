"""What was measured of solvers, each at each tolerance: where tension floors are kept and where they give way."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

import numpy as np

Floors = Literal["kept", "relaxed"]
# Error of the first input, over what it may change in a period, that the recommended solver keeps at worst.
WANTED = 1e-3


@dataclass(frozen=True)
class SolverAttempt:
    """One solver at one tolerance, on the problems of one kind.

    Attributes
    ----------
    solver : str
        One that `[mpc] solver` names, or "cvxpy", the reference statement with states as variables.
    tol : float
        In the solver's own measure.
    floors : "kept" or "relaxed"
        Whether the problems keep all tension floors.
    asked, accepted : int
        Problems, and those whose answer a controller takes: recomputed KKT residual at most 1e-6. Of cvxpy, which
        gives no multipliers of the condensed problem, those that it solves.
    seconds, worst_seconds : float, s
        Median and largest processor time of a solve.
    kkt, worst_kkt : float
        Median and largest residual of all answers, taken or not; nan for cvxpy.
    error, worst_error : float
        Median and largest distance of the first input to the reference, over what an input may change in a period.
    failure : str
        Why it was not asked.
    """

    solver: str
    tol: float
    floors: Floors
    asked: int
    accepted: int
    seconds: float
    worst_seconds: float
    kkt: float
    worst_kkt: float
    error: float
    worst_error: float
    failure: str = ""

    @classmethod
    def skipped(cls, solver: str, tol: float, floors: Floors, why: str) -> SolverAttempt:
        """One without a result."""
        unknown = np.nan
        return cls(solver, tol, floors, 0, 0, unknown, unknown, unknown, unknown, unknown, unknown, why)

    @property
    def failures(self) -> int:
        """Problems without an answer that a controller takes."""
        return self.asked - self.accepted


@dataclass(frozen=True)
class SolverPrecision:
    """All attempts on the problems of one controller.

    Attributes
    ----------
    attempts : tuple of SolverAttempt
    dt : float, s
        Control period.
    horizon, variables, rows : int
        Size of the condensed problem; `rows` without the bounds of variables.
    steps, relaxed_steps : int
        Steps of the closed loop that the problems are from, and those whose floors gave way.
    t_end : float, s
        How far the loop went.
    reference_kkt : float
        Largest KKT residual of the reference's answers.
    """

    attempts: tuple[SolverAttempt, ...]
    dt: float
    horizon: int
    variables: int
    rows: int
    steps: int
    relaxed_steps: int
    t_end: float
    reference_kkt: float

    def advised(self, floors: Floors = "kept") -> SolverAttempt | None:
        """The quickest solver in the median that answers every problem of a kind well enough; None where none does."""
        good = [
            a for a in self.attempts
            if a.floors == floors and a.solver != "cvxpy" and a.asked and not a.failures and a.worst_error <= WANTED
        ]  # fmt: skip
        return min(good, key=lambda a: a.seconds, default=None)

    def advice(self) -> tuple[str, ...]:
        """The setting to use in a line for each kind of problem."""
        if not self.attempts:
            return ("no step of this loop has anything to do, so there is nothing to choose",)
        lines = []
        for floors in ("kept", "relaxed"):
            if not any(a.floors == floors and a.asked for a in self.attempts):
                continue
            best = self.advised(floors)
            if best is None:
                lines.append(f"floors {floors}: no solver answers every problem within {WANTED:.0e}")
                continue
            times = f"{1e3 * best.seconds:.3g} ms in the median, {1e3 * best.worst_seconds:.3g} at worst"
            said = f'solver = "{best.solver}"' if floors == "kept" else f"{best.solver} is the quickest"
            late = "" if best.worst_seconds <= self.dt else "; too long: take a shorter horizon or a longer dt"
            lines.append(f"floors {floors}: {said}, {times} of {1e3 * self.dt:g} ms{late}")
        return tuple(lines)

    @property
    def story(self) -> str:
        """Which problems these are, in a sentence."""
        return (
            f"{self.variables} variables and {self.rows} rows over {self.horizon} periods, from {self.steps} steps of "
            f"the closed loop over {self.t_end:g} s; in {self.relaxed_steps} of them tension floors had to give way"
        )

    def table(self) -> str:
        """The attempts as aligned text, then the setting to use."""
        names = ("median [ms]", "worst", "KKT", "worst", "error", "worst", "failed")
        lines = [" ".join([f"{'solver':9} {'tol':>6} {'floors':8}", *(f"{name:>11}" for name in names)])]
        lines += [_line(a) for a in self.attempts]
        lines.append(f"{self.story}; the reference has a KKT residual of {self.reference_kkt:.0e} at worst")
        return "\n".join([*lines, *self.advice()])

    def to_dict(self) -> dict:
        """Everything as plain numbers and texts for JSON; None for what is not known."""
        best = self.advised()
        return {
            "dt": self.dt, "horizon": self.horizon, "variables": self.variables, "rows": self.rows,
            "steps": self.steps, "relaxed_steps": self.relaxed_steps, "t_end": self.t_end,
            "reference_kkt": _plain(self.reference_kkt),
            "recommended": None if best is None else {"solver": best.solver},
            "attempts": [{k: _plain(v) for k, v in asdict(a).items()} for a in self.attempts],
        }  # fmt: skip


def _line(a: SolverAttempt) -> str:
    head = f"{a.solver:9} {a.tol:6.0e} {a.floors:8}"
    if a.failure:
        return f"{head} {a.failure}"
    times = f"{1e3 * a.seconds:11.3g} {1e3 * a.worst_seconds:11.3g}"
    sizes = " ".join(f"{_known(value):>11}" for value in (a.kkt, a.worst_kkt, a.error, a.worst_error))
    return f"{head} {times} {sizes} {f'{a.failures} of {a.asked}':>11}"


def _known(value: float) -> str:
    return "-" if np.isnan(value) else f"{value:.0e}"


def _plain(value: object) -> object:
    return None if isinstance(value, float) and not np.isfinite(value) else value
