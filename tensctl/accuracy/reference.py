"""The run that others are held against, and what its own error may be.

The reference is the strictest run of the method that fits the scene. Its error is taken as its largest distance to a
strict run of another integrator, which shares neither steps nor error terms with it; CVODES takes the forces from
CasADi instead of the kernel as well. Where no such run can be afforded, the next strictest run of the same method
stands in: that sees the error of the steps, and not an error that both share.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from tensctl.accuracy.motion import Motion, distance
from tensctl.errors import SimulationError, TensctlError
from tensctl.simulation import Run
from tensctl.simulation.integrators import Method
from tensctl.simulation.integrators.choose import applicable, fitting

_STRICT, _STRICTEST = 1e-13, 1e-14
# Tolerances through which the other integrator goes, as long as its share of the time lasts.
_CLIMB = (1e-8, 1e-10, 1e-12, _STRICT)
# Other integrators for each that can make the reference, the more accurate first.
_OTHERS: dict[Method, tuple[Method, ...]] = {
    "splitting6": ("dopri5", "cvodes"),
    "dopri5": ("rosenbrock", "cvodes"),
    "rosenbrock": ("cvodes", "dopri5"),
}
# The time is halved at most so often, until the reference is good to this part of the structure's size.
_HALVINGS, _TRUSTED = 4, 1e-6


@dataclass(frozen=True, eq=False)
class Reference:
    """A trusted run of a motion.

    Attributes
    ----------
    motion : Motion
        As long as it can be trusted.
    run : Run
    doubt : float, m
        What its error may be.
    said : str
        Which two runs say so.
    """

    motion: Motion
    run: Run
    doubt: float
    said: str

    @classmethod
    def of(cls, motion: Motion, share: float) -> Reference:
        """The reference, and what its error may be; the other integrator has `share` s.

        Slack-taut motion is chaotic: the time is halved until the reference can be trusted.

        Raises
        ------
        SimulationError
            When it cannot be trusted, or not be made.
        """
        made = _made(motion, share)
        for _ in range(_HALVINGS):
            if made.doubt <= _TRUSTED * motion.size:
                return made
            made = _made(made.motion.shorter(0.5), share)
        if made.doubt <= _TRUSTED * motion.size:
            return made
        raise SimulationError(
            f"within {made.motion.t_end:g} s two strict runs part by {made.doubt:.1e} m ({made.said}); nothing can be"
            " compared with them, so give a shorter t_end or a calmer motion."
        )


def _made(motion: Motion, share: float) -> Reference:
    method, _ = fitting(motion.dynamics, _STRICTEST)
    run = motion.run(method, _STRICTEST)
    apply = applicable(motion.dynamics)
    others: list[Method] = [name for name in _OTHERS[method] if name in apply]
    for other in others:
        strict = _strict_run(motion, other, share / len(others))
        if strict is not None:
            said = f"{method} at {_STRICTEST:.0e} against {other} at {strict[1]:.0e}, another integrator"
            return Reference(motion, run, distance(strict[0], run), said)
    said = f"{method} at {_STRICTEST:.0e} against itself at {_STRICT:.0e}, since no other integrator could be afforded"
    return Reference(motion, run, distance(motion.run(method, _STRICT), run), said)


def _strict_run(motion: Motion, method: Method, share: float) -> tuple[Run, float] | None:
    """The run of the tightest tolerance that the share, s, allows; None below the last but one."""
    began, last, run, reached = time.perf_counter(), 0.0, None, 1.0
    for tol in _CLIMB:
        if time.perf_counter() - began + last > share:
            break
        start = time.perf_counter()
        try:
            run, reached = motion.run(method, tol), tol
        except TensctlError:
            break
        last = time.perf_counter() - start
    return None if run is None or reached > _CLIMB[-2] else (run, reached)
