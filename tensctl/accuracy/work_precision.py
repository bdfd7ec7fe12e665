"""Error against run time, for a scene's own free motion.

Every integrator that applies runs at several tolerances; the error is the largest distance of any node to a reference
made by the strictest setting, whose own error is estimated by the change from the next strictest. Nothing is compared
below that estimate.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics, build_dynamics
from tensctl.simulation import Push, Run, simulate, total_energy
from tensctl.simulation.integrators import Method
from tensctl.simulation.moving import Start
from tensctl.statics import find_equilibrium

if TYPE_CHECKING:
    from tensctl.scene import Scene

_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_STRICT, _STRICTEST = 1e-13, 1e-14
_LONGEST = 2.0
_RECORDS = 51
_REPEATS = 3


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
    failure : str
    """

    method: str
    tol: float
    error: float
    seconds: float
    evaluations: int
    rod_drift: float
    energy_drift: float
    failure: str = ""


@dataclass(frozen=True)
class WorkPrecision:
    """All attempts, and the reference that they were measured against.

    Attributes
    ----------
    attempts : tuple of Attempt
    t_end : float, s
    reference_error : float, m
        Estimated error of the reference itself.
    """

    attempts: tuple[Attempt, ...]
    t_end: float
    reference_error: float

    def advised(self, error: float) -> Attempt | None:
        """The fastest attempt at least as accurate as asked for, m; None when there is none."""
        good = [attempt for attempt in self.attempts if attempt.error <= error]
        return min(good, key=lambda attempt: attempt.seconds, default=None)

    def table(self) -> str:
        """The attempts as aligned text, then the setting to use."""
        names = ("error [m]", "time [s]", "rhs", "rod drift", "energy")
        lines = [" ".join([f"{'method':11} {'tol':>7}", *(f"{name:>10}" for name in names)])]
        for a in self.attempts:
            numbers = f"{a.error:10.1e} {a.seconds:10.2e} {a.evaluations:10d} {a.rod_drift:10.1e} {_drift(a):>10}"
            lines.append(f"{a.method:11} {a.tol:7.0e} {numbers}" if not a.failure else f"{a.method:11} {a.failure}")
        if all(a.error == 0 for a in self.attempts):
            return "\n".join([*lines, f"over {self.t_end:g} s; nothing moves, so there is nothing to choose"])
        lines.append(f"over {self.t_end:g} s; the reference itself is good to {self.reference_error:.0e} m")
        for wanted in (1e-6, 1e-9):
            best = self.advised(wanted)
            text = "no setting reaches it" if best is None else f'method = "{best.method}", tol = {best.tol:.0e}'
            lines.append(f"for {wanted:.0e} m: {text}")
        return "\n".join(lines)


def _drift(attempt: Attempt) -> str:
    """Energy drift, or a dash where dampers or pushes change the energy."""
    return "-" if np.isnan(attempt.energy_drift) else f"{attempt.energy_drift:.1e}"


def work_precision(scene: Scene) -> WorkPrecision:
    """Measure error against run time for a scene's own motion.

    With pushes the structure starts at rest in its equilibrium, without them it is released from its initial nodes; no
    controller acts. The run lasts as long as the scene's simulation, at most 2 s, because slack-taut motion is chaotic
    beyond.

    Raises
    ------
    SimulationError
        When the reference itself cannot be made.
    """
    dynamics = build_dynamics(scene)
    asked = scene.simulation
    pushes = () if asked is None else asked.push
    t_end = _LONGEST if asked is None else min(asked.t_end, _LONGEST)
    first = min((push.start for push in pushes), default=0.0)
    moved = [Push(p.node, p.force, p.start - first, p.stop - first) for p in pushes]
    motion = _Motion(dynamics, find_equilibrium(scene) if moved else dynamics.structure.nodes, tuple(moved), t_end)
    methods: tuple[Method, ...] = ("dopri5",) if dynamics.damped else ("splitting6", "splitting4", "dopri5")
    reference, check = motion.run(methods[0], _STRICTEST), motion.run(methods[0], _STRICT)
    attempts = [motion.attempt(method, tol, reference) for method in methods for tol in _TOLERANCES]
    return WorkPrecision(tuple(attempts), t_end, _distance(check, reference))


@dataclass(frozen=True, eq=False)
class _Motion:
    """The same motion, to be run in several ways."""

    dynamics: Dynamics
    start: Start
    pushes: tuple[Push, ...]
    t_end: float

    def run(self, method: Method, tol: float) -> Run:
        times = np.linspace(0, self.t_end, _RECORDS)
        return simulate(
            self.dynamics, self.start, timepts=times, pushes=self.pushes, method=method, tol=tol
        )  # fmt: skip

    def attempt(self, method: Method, tol: float, reference: Run) -> Attempt:
        try:
            run, seconds = self._timed(method, tol)
        except SimulationError as error:
            return Attempt(method, tol, np.inf, np.nan, 0, np.nan, np.nan, str(error))
        kept = not (self.dynamics.damped or self.pushes)
        energy = total_energy(self.dynamics, run) if kept else np.array([np.nan])
        drift = float(np.ptp(energy) / max(np.abs(energy).max(), 1e-300)) if kept else np.nan
        return Attempt(method, tol, _distance(run, reference), seconds, run.evaluations, run.rod_drift, drift)

    def _timed(self, method: Method, tol: float) -> tuple[Run, float]:
        best, run = np.inf, None
        for _ in range(_REPEATS):
            began = time.perf_counter()
            run = self.run(method, tol)
            best = min(best, time.perf_counter() - began)
        assert run is not None
        return run, best


def _distance(run: Run, reference: Run) -> float:
    return float(np.linalg.norm(run.nodes - reference.nodes, axis=2).max())
