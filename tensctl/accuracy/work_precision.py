"""Error against run time, for a scene's own free motion.

Every integrator that applies runs at several tolerances; the error is the largest distance of any node to a reference
(`accuracy.reference`). Nothing is compared below what the reference's own error may be. A method stops tightening its
tolerance when the next run would not fit into its share of the time budget.
"""

from __future__ import annotations

import time
from contextlib import suppress

import numpy as np

from tensctl.accuracy.motion import Motion, distance
from tensctl.accuracy.reference import Reference
from tensctl.accuracy.result import Attempt, WorkPrecision
from tensctl.errors import SimulationError, TensctlError
from tensctl.scene import AccuracyStage, Scene
from tensctl.scene.given import argument, check_kind, endless
from tensctl.scene.values import Number
from tensctl.simulation import Run
from tensctl.simulation.integrators import Method
from tensctl.simulation.integrators.choose import applicable

# Further runs of one setting, to time it warm, are made only when a run takes less than this, s.
_REPEATS, _QUICK = 3, 1.0


def work_precision(scene: Scene, *, budget: float | None = None) -> WorkPrecision:
    """Measure error against run time for a scene's own motion.

    The scene's own start, velocities, loads and schedule count; no controller acts, and a start at rest that only the
    controller would disturb is a release from the initial nodes. Where pushes alone disturb it, the first begins at
    once. The run lasts as long as the scene's simulation, at most `accuracy.t_end`.

    Parameters
    ----------
    scene : Scene
        `[accuracy]` gives methods, tolerances, budget, the error wanted and the longest time; its defaults otherwise.
    budget : float, s
        Time for all attempts and the judge of the reference, in equal shares; what would take longer is listed as
        skipped. The reference comes on top. The scene's by default.

    Raises
    ------
    SimulationError
        An argument of another kind, or a reference that cannot be made.
    """
    check_kind(Scene, error=SimulationError, scene=scene)
    if budget is not None and not endless(budget):
        budget = argument("budget", budget, Number("s", least=0), SimulationError)
    asked = AccuracyStage() if scene.accuracy is None else scene.accuracy
    motion = Motion.of(scene, asked.t_end)
    methods = asked.methods or applicable(motion.dynamics)
    share = (asked.budget if budget is None else budget) / (1 + len(methods))
    reference = Reference.of(motion, share)
    tolerances = sorted(asked.tolerances, reverse=True)
    attempts = [a for method in methods for a in _attempts(reference, method, tolerances, share)]
    return WorkPrecision(
        tuple(attempts), reference.motion.t_end, reference.doubt, reference.said, wanted=asked.error
    )  # fmt: skip


def _attempts(reference: Reference, method: Method, tolerances: list[float], share: float) -> list[Attempt]:
    """One method from loose to tight tolerances, until its share of the budget, s, is spent."""
    _warm(reference.motion, method, tolerances[0])
    done, began, last = [], time.perf_counter(), 0.0
    for tol in tolerances:
        if time.perf_counter() - began + last > share:
            done.append(Attempt.failed(method, tol, "skipped: it would take too long"))
            continue
        done.append(_attempt(reference, method, tol, share))
        last = 0.0 if done[-1].failure else done[-1].seconds
    return done


def _warm(motion: Motion, method: Method, tol: float) -> None:
    """Let kernels compile, or load, before any time is measured."""
    with suppress(TensctlError):
        motion.shorter(1e-6).run(method, tol)


def _attempt(reference: Reference, method: Method, tol: float, share: float) -> Attempt:
    motion = reference.motion
    try:
        run, seconds = _timed(motion, method, tol, share)
    except TensctlError as error:
        return Attempt.failed(method, tol, str(error))
    energy, momentum = motion.drifts(run)
    error = distance(run, reference.run)
    return Attempt(method, tol, error, seconds, run.evaluations, run.rod_drift, energy, momentum)


def _timed(motion: Motion, method: Method, tol: float, share: float) -> tuple[Run, float]:
    """A run and the least time it took; a slow one runs once."""
    best, run = np.inf, None
    for _ in range(_REPEATS):
        began = time.perf_counter()
        run = motion.run(method, tol)
        best = min(best, time.perf_counter() - began)
        if best > min(_QUICK, share / _REPEATS):
            break
    assert run is not None
    return run, best
