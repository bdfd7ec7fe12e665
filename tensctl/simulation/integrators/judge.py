"""What the independent judges share: inputs as CasADi expressions of time, and one solver for all intervals.

    x'(s) = h f(x, t0 + s h),   s in [0, 1]:   t0 and h are parameters, so the solver is made once for a drive

Judges are for control-size structures and for checking, not for speed: their right-hand side grows with every tendon,
and slack-taut switches are left to their step-size control.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.model.joint_kernel import close
from tensctl.model.kernel import tidy
from tensctl.simulation.drive import Drive

# Below 1e-13 of a state the solvers give up.
_LEAST = 1e-13
# Steps between two recorded times: a judge that needs more gives up instead of crawling for minutes.
_MOST_STEPS = 300_000
# Tendons beyond which a model of CasADi expressions takes minutes to make.
MOST = 400


@dataclass(eq=False)
class Judge:
    """An integrator of SUNDIALS on one statement of the motion.

    Attributes
    ----------
    dynamics : Dynamics
    tol : float
    strict : float
        Error allowed in a step over tol, as for the adaptive explicit method.
    """

    dynamics: Dynamics
    tol: float
    evaluations: int = 0
    switches: int = 0
    local_errors: float = np.nan
    strict: ClassVar[float] = 0.01

    def __post_init__(self) -> None:
        """Refuse what is too large.

        Raises
        ------
        SimulationError
            More than 400 tendons.
        """
        count = len(self.dynamics.structure.tendons)
        if count > MOST:
            raise SimulationError(
                f"{self.name} is for up to {MOST} tendons, not {count}; use auto, or a compiled method."
            )

    @property
    def name(self) -> str:
        """Name of the method."""
        raise NotImplementedError

    def prepared(self, drive: Drive) -> Any:
        """What is made once for a drive."""
        raise NotImplementedError

    def advance(self, prepared: Any, q: np.ndarray, v: np.ndarray, span: list[float]) -> None:
        """Move q and v in place from span[0] on for span[1], s."""
        raise NotImplementedError

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Stop at every time: move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the solver gives up.
        """
        prepared = self.prepared(drive)
        for k in range(1, times.size):
            self.advance(prepared, q, v, [times[k - 1], times[k] - times[k - 1]])
            out_q[k], out_v[k] = q, v

    @property
    def options(self) -> dict[str, float | int]:
        """Tolerances of the solver."""
        size = float(np.ptp(self.dynamics.structure.nodes, axis=0).max())
        share = max(self.strict * self.tol, _LEAST)
        return {"reltol": share, "abstol": share * min(size, 1.0), "max_num_steps": _MOST_STEPS}

    def settled(self, q: np.ndarray, v: np.ndarray) -> None:
        """Put rods to their lengths and joints together."""
        data = self.dynamics.kernel
        tidy(data, q, v)
        if self.dynamics.tied:
            close(data, q, v, np.zeros(data.place[-1]), np.zeros(data.first.size))

    def run(self, solver: ca.Function, **arguments: Any) -> dict[str, Any]:
        """Call the solver; count what it did.

        Raises
        ------
        SimulationError
            When it gives up.
        """
        try:
            answer = solver(**arguments)
        except RuntimeError as error:
            raise SimulationError(f"{self.name} gave up: {_cause(str(error))}; use a larger tol.") from None
        self.evaluations += int(solver.stats().get("nfevals", 0))
        return answer


def _cause(message: str) -> str:
    """The solver's own word for what went wrong, without where in CasADi's sources it was said."""
    named = re.search(r'(\w+) returned "(\w+)"', message)
    return f"{named[1]} returned {named[2]}" if named else message.splitlines()[-1]


def inputs_at(drive: Drive, t: ca.MX) -> tuple[ca.MX, ca.MX]:
    """Rest lengths (nt,) and nodal forces (3K,) at time t."""
    s = t - drive.start
    rest = ca.DM(drive.rest) + s * ca.DM(drive.rate) + (1 - ca.exp(-s / drive.tau)) * ca.DM(drive.lag)
    force = ca.DM(drive.force.ravel()) + s * ca.DM(drive.force_rate.ravel())
    for node, amplitude, omega, phase in zip(
        drive.wave_node, drive.wave_force, drive.wave_omega, drive.wave_phase, strict=True
    ):
        unit = np.zeros((drive.force.size, 1))
        unit[3 * node : 3 * node + 3, 0] = amplitude
        force = force + ca.sin(omega * t + phase) * ca.DM(unit)
    return rest, force
