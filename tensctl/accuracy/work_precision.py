"""Error against run time, for a scene's own free motion.

Every integrator that applies runs at several tolerances; the error is the largest distance of any node to a reference
made by the strictest setting, whose own error is estimated by the change from the next strictest. Nothing is compared
below that estimate. Slack-taut motion is chaotic: the time is halved until the reference can be trusted. A method stops
tightening its tolerance when the next run would not fit into its share of the time budget.
"""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tensctl.errors import SimulationError, TensctlError
from tensctl.model import Dynamics, build_dynamics
from tensctl.simulation import Load, Push, Run, Schedule, momenta, simulate, total_energy
from tensctl.simulation.asked import loads_of, schedule_of, start_of
from tensctl.simulation.integrators import Method
from tensctl.simulation.integrators.choose import applicable
from tensctl.simulation.moving import Start
from tensctl.statics import find_equilibrium

if TYPE_CHECKING:
    from tensctl.scene import Scene

_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_STRICT, _STRICTEST = 1e-13, 1e-14
_LONGEST = 2.0
_RECORDS = 51
# Further runs of one setting, to time it warm, are made only when a run takes less than this, s.
_REPEATS, _QUICK = 3, 1.0
# All attempts together, s; each method has an equal share.
_BUDGET = 30.0
# The time is halved at most so often, until the reference is good to this part of the structure's size.
_HALVINGS, _TRUSTED = 4, 1e-6


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
        that times the size; nan with loads, weight, dampers, drag or held nodes.
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
        """The fastest attempt at least as accurate as asked for, m; None when none is, or the reference is not."""
        good = [attempt for attempt in self.attempts if max(attempt.error, self.reference_error) <= error]
        return min(good, key=lambda attempt: attempt.seconds, default=None)

    def table(self) -> str:
        """The attempts as aligned text, then the setting to use."""
        names = ("error [m]", "time [s]", "rhs", "rod drift", "energy", "momentum")
        lines = [" ".join([f"{'method':11} {'tol':>7}", *(f"{name:>10}" for name in names)])]
        lines += [self._line(a) for a in self.attempts]
        if all(a.error == 0 for a in self.attempts if not a.failure):
            return "\n".join([*lines, f"over {self.t_end:g} s; nothing moves, so there is nothing to choose"])
        lines.append(f"over {self.t_end:g} s; the reference itself is good to {self.reference_error:.0e} m")
        for wanted in (1e-6, 1e-9):
            best = self.advised(wanted)
            text = "no setting reaches it" if best is None else f'method = "{best.method}", tol = {best.tol:.0e}'
            lines.append(f"for {wanted:.0e} m: {text}")
        return "\n".join(lines)

    def to_dict(self) -> dict:
        """Everything as plain numbers and texts for JSON; None for what is not known."""
        attempts = [{k: _plain(v) for k, v in asdict(a).items()} for a in self.attempts]
        return {"t_end": self.t_end, "reference_error": self.reference_error, "attempts": attempts}

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


def work_precision(scene: Scene, *, budget: float = _BUDGET) -> WorkPrecision:
    """Measure error against run time for a scene's own motion.

    The scene's own start, velocities, loads and schedule count; no controller acts, and a start at rest that only the
    controller would disturb is a release from the initial nodes. Where pushes alone disturb it, the first begins at
    once. The run lasts as long as the scene's simulation, at most 2 s.

    Parameters
    ----------
    scene : Scene
    budget : float, s
        Time for all attempts; what would take longer is listed as skipped. The reference comes on top.

    Raises
    ------
    SimulationError
        When the reference itself cannot be made.
    """
    motion = _motion(scene)
    methods = applicable(motion.dynamics)
    size = float(np.ptp(motion.dynamics.structure.nodes, axis=0).max())
    reference, doubt = motion.reference(methods[0])
    for _ in range(_HALVINGS):
        if doubt <= _TRUSTED * size:
            break
        motion = replace(motion, t_end=motion.t_end / 2)
        reference, doubt = motion.reference(methods[0])
    if doubt > _TRUSTED * size:
        raise SimulationError(
            f"two runs at tol = {_STRICT:.0e} and {_STRICTEST:.0e} part by {doubt:.1e} m within {motion.t_end:g} s;"
            " nothing can be compared with them, so give a shorter t_end or a calmer motion."
        )
    attempts = [a for method in methods for a in motion.attempts(method, reference, budget / len(methods))]
    return WorkPrecision(tuple(attempts), motion.t_end, doubt)


def _motion(scene: Scene) -> _Motion:
    dynamics, asked = build_dynamics(scene), scene.simulation
    if asked is None:
        return _Motion(dynamics, dynamics.structure.nodes, (), (), _LONGEST)
    alone = asked.model_copy(update={"controller": "none"})
    loads, schedule = loads_of(alone), schedule_of(alone)
    if alone.push and len(loads) == len(alone.push) and not schedule and alone.velocity is None and alone.spin is None:
        first = min(push.start for push in alone.push)
        loads = [Push(p.node, p.force, p.start - first, p.stop - first) for p in alone.push]
    start = start_of(alone, dynamics, find_equilibrium(scene))
    return _Motion(dynamics, start, tuple(loads), tuple(schedule), min(asked.t_end, _LONGEST))


@dataclass(frozen=True, eq=False)
class _Motion:
    """The same motion, to be run in several ways."""

    dynamics: Dynamics
    start: Start
    pushes: tuple[Load, ...]
    schedule: tuple[Schedule, ...]
    t_end: float

    def run(self, method: Method, tol: float) -> Run:
        times = np.linspace(0, self.t_end, _RECORDS)
        return simulate(
            self.dynamics, self.start, timepts=times, pushes=self.pushes, schedule=self.schedule, method=method, tol=tol
        )  # fmt: skip

    def reference(self, method: Method) -> tuple[Run, float]:
        """The strictest run, and its distance to the next strictest, m."""
        strictest = self.run(method, _STRICTEST)
        return strictest, _distance(self.run(method, _STRICT), strictest)

    def attempts(self, method: Method, reference: Run, share: float) -> list[Attempt]:
        """One method from loose to tight tolerances, until its share of the budget, s, is spent."""
        self._warm(method)
        done, began, last = [], time.perf_counter(), 0.0
        for tol in _TOLERANCES:
            if time.perf_counter() - began + last > share:
                done.append(_without_result(method, tol, "skipped: it would take too long"))
                continue
            done.append(self._attempt(method, tol, reference))
            last = 0.0 if done[-1].failure else done[-1].seconds
        return done

    def _warm(self, method: Method) -> None:
        """Let kernels compile, or load, before any time is measured."""
        with suppress(TensctlError):
            replace(self, t_end=1e-6 * self.t_end).run(method, _TOLERANCES[0])

    def _attempt(self, method: Method, tol: float, reference: Run) -> Attempt:
        try:
            run, seconds = self._timed(method, tol)
        except TensctlError as error:
            return _without_result(method, tol, str(error))
        energy, momentum = self._drifts(run)
        return Attempt(
            method, tol, _distance(run, reference), seconds, run.evaluations, run.rod_drift, energy, momentum
        )

    def _drifts(self, run: Run) -> tuple[float, float]:
        """Relative drift of energy and of momentum, each nan where the scene itself changes it."""
        structure = self.dynamics.structure
        energy = momentum = np.nan
        if not (self.dynamics.damped or self.pushes or self.schedule):
            total = total_energy(self.dynamics, run)
            energy = float(np.ptp(total) / max(np.abs(total).max(), 1e-300))
        if not (self._outside or self.pushes or structure.held.any()):
            momentum = max(_change(each, scale) for each, scale in _about_centre(self.dynamics, run))
        return energy, momentum

    @property
    def _outside(self) -> bool:
        """Whether constant forces or dampers, drag among them, act."""
        return bool(np.any(self.dynamics.members.forces)) or self.dynamics.damped

    def _timed(self, method: Method, tol: float) -> tuple[Run, float]:
        best, run = np.inf, None
        for _ in range(_REPEATS):
            began = time.perf_counter()
            run = self.run(method, tol)
            best = min(best, time.perf_counter() - began)
            if best > _QUICK and tol < _TOLERANCES[0]:
                break
        assert run is not None
        return run, best


def _distance(run: Run, reference: Run) -> float:
    return float(np.linalg.norm(run.nodes - reference.nodes, axis=2).max())


def _without_result(method: Method, tol: float, why: str) -> Attempt:
    return Attempt(method, tol, np.inf, np.nan, 0, np.nan, np.nan, np.nan, why)


def _about_centre(dynamics: Dynamics, run: Run) -> tuple[tuple[np.ndarray, float], tuple[np.ndarray, float]]:
    """Linear and angular momentum about the mass centre, (t, 3), each with the size to compare its change with."""
    rods, mass = dynamics.structure.rods, dynamics.members.mass
    centre = np.einsum("r,tri->ti", mass, run.nodes[:, rods].mean(axis=2)) / mass.sum()
    linear, angular = momenta(dynamics, run)
    scale = float(mass.sum() * np.linalg.norm(run.velocities, axis=2).max())
    size = float(np.ptp(dynamics.structure.nodes, axis=0).max())
    return (linear, scale), (angular - np.cross(centre, linear), scale * size)


def _change(momentum: np.ndarray, scale: float) -> float:
    return float(np.linalg.norm(momentum - momentum[0], axis=1).max() / max(scale, 1e-300))
