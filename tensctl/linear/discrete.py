"""The linear model in discrete time, exact for held and for ramping inputs, with delays of any length.

The controller's command u_k is made at t_k = k dt and acts `delay` later. "zoh" holds it for a period, u(t) = u_k on
[t_k, t_k + dt); "ramp" goes from the last command to it in a straight line, as the actuators of a simulation do. With
delay = (d + f) dt, d whole and 0 <= f < 1, a period has two stretches, f dt and (1 - f) dt, in each of which the input
is a straight line between commands; both are propagated exactly and joined. Commands under way are states.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from tensctl.errors import LinearizationError
from tensctl.linear.model import LinearModel
from tensctl.linear.propagate import stretch

if TYPE_CHECKING:
    import control

Method = Literal["zoh", "ramp"]
Course = list[tuple[float, np.ndarray, np.ndarray]]

# A delay this near to whole periods, in periods, is whole: decimal numbers seldom divide exactly.
_WHOLE = 1e-9


@dataclass(frozen=True, eq=False)
class Discrete:
    """x_(k+1) = A x_k + B u_k,  y_k = C x_k + D u_k.

    Attributes
    ----------
    linear : LinearModel
    dt, delay : float, s
    method : "zoh" or "ramp"
    A, B, C, D
        The states are those of the linear model, then the commands under way, latest first.
    """

    linear: LinearModel
    dt: float
    delay: float
    method: Method
    A: Float[np.ndarray, "nx nx"]
    B: Float[np.ndarray, "nx nu"]
    C: Float[np.ndarray, "ny nx"]
    D: Float[np.ndarray, "ny nu"]

    @property
    def states(self) -> tuple[str, ...]:
        """Labels of the model's states, then `u_t5_1_1_before1` and so on."""
        inputs, own = self.linear.inputs, self.linear.states
        held = (len(self.A) - len(own)) // max(len(inputs), 1)
        return own + tuple(f"{name}_before{k}" for k in range(1, held + 1) for name in inputs)

    def to_statespace(self) -> control.StateSpace:
        """The model as a labelled `control.StateSpace` with period dt."""
        import control

        system = control.ss(
            self.A, self.B, self.C, self.D, self.dt, inputs=list(self.linear.inputs),
            outputs=list(self.linear.outputs), states=list(self.states), name="tensctl_discrete",
        )  # fmt: skip
        assert isinstance(system, control.StateSpace)
        return system

    def verify(self, tol: float = 1e-9) -> None:
        """Check a period against two halves of it.

        Raises
        ------
        LinearizationError
            With the misfit found.
        """
        nx = len(self.linear.states)
        half = stretch(self.linear, 0.5 * self.dt).F
        misfit = np.abs(half @ half - self.A[:nx, :nx]).max(initial=0.0) / max(np.abs(self.A[:nx, :nx]).max(), 1.0)
        if not misfit <= tol:
            raise LinearizationError(f"two half periods miss a whole one by {misfit:.1e}; {tol:.0e} is expected.")


def sample(linear: LinearModel, dt: float, *, method: Method = "zoh", delay: float = 0.0) -> Discrete:
    """Sample a linear model exactly.

    Parameters
    ----------
    linear : LinearModel
    dt : float, s
        Period.
    method : "zoh" or "ramp"
        Whether a command is held for a period, or reached in a straight line at the end of it.
    delay : float, s
        From a command to its first effect: computation, transport; any length, whole periods or not.

    Raises
    ------
    LinearizationError
        For a period or delay that is no length of time.
    """
    if not (np.isfinite(dt) and dt > 0 and np.isfinite(delay) and delay >= 0):
        raise LinearizationError(f"dt is {dt} s and delay {delay} s; a period > 0 and a delay >= 0 are expected.")
    if method not in ("zoh", "ramp"):
        raise LinearizationError(f'method is "{method}"; expected "zoh" or "ramp".')
    nx, nu = linear.B.shape
    course = _course(method, delay / dt)
    memory = course[0][1].size - 1
    F, forced = np.eye(nx), np.zeros((memory + 1, nx, nu))
    for share, start, end in course:
        part = stretch(linear, share * dt)
        F = part.F @ F
        forced = part.F @ forced + start[:, None, None] * part.G0 + end[:, None, None] * part.G1
    through = course[0][1][:, None, None] * linear.D
    A = np.zeros((nx + memory * nu, nx + memory * nu))
    A[:nx, :nx], A[:nx, nx:] = F, np.hstack([np.zeros((nx, 0)), *forced[1:]])
    B = np.zeros((len(A), nu))
    B[:nx] = forced[0]
    # Commands under way move up by one: the newest is u_k, the oldest is forgotten.
    held = np.eye(memory * nu, (memory + 1) * nu)
    B[nx:], A[nx:, nx:] = held[:, :nu], held[:, nu:]
    C = np.hstack([linear.C, *through[1:]])
    return Discrete(linear, float(dt), float(delay), method, A, B, C, through[0])


def _course(method: Method, periods: float) -> Course:
    """Stretches of a period: share of it, and the input at its start and end as weights of u_k, u_(k-1), ..."""
    whole = int(np.floor(periods + _WHOLE))
    part = periods - whole
    part = part if part > _WHOLE else 0.0
    size = whole + (part > 0) + (method == "ramp") + 1
    unit = np.eye(size)

    def at(place: float) -> np.ndarray:
        """The input between commands `place` periods old."""
        old = int(np.floor(place))
        share = place - old
        return unit[old] if share == 0 else (1 - share) * unit[old] + share * unit[old + 1]

    if method == "zoh":
        late = [(part, unit[-1], unit[-1])] if part > 0 else []
        return [*late, (1 - part, unit[whole], unit[whole])]
    late = [(part, at(whole + 1 + part), unit[whole + 1])] if part > 0 else []
    return [*late, (1 - part, unit[whole + 1], at(whole + part))]
