"""Feedback scheduled along a path: the rest lengths that the path needs, and the LQR of the equilibrium nearest to it.

    u(t + dt) = u_ref(t + dt) - K_k (x - x_ref)(t)

x is the state in the model of k, the planned equilibrium nearest to where the path is at t. The reference carries the
rods' inertia, so feedback has little to do: errors, and what the tendons cannot pull at. Where actuators lag, x holds
the rest lengths and u_ref is the command that keeps them on the path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel, linearize
from tensctl.model import Dynamics
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Number
from tensctl.synthesis.feedback import Measured
from tensctl.synthesis.holding import Holding
from tensctl.synthesis.lagging import commands_along, commands_now
from tensctl.synthesis.lqr import LQR, lqr
from tensctl.synthesis.lqr_sampled import SampledLQR
from tensctl.synthesis.path import ShapePath

Design = LQR | SampledLQR


@dataclass(frozen=True, eq=False)
class ScheduledLQR(Holding):
    """State feedback along a path; a controller with `step` and `reset`.

    Attributes
    ----------
    path : ShapePath
    knots : (k,) int
        Planned equilibria that have a design; the last is one of them.
    designs : tuple of LQR or SampledLQR
    """

    path: ShapePath
    knots: Int[np.ndarray, " k"]
    designs: tuple[Design, ...]

    @property
    def dt(self) -> float:
        """Control period, s: the shortest of all designs."""
        return min(design.dt for design in self.designs)

    @property
    def residual(self) -> float:
        """Largest Riccati residual of all designs."""
        return max(design.residual for design in self.designs)

    @property
    def slowest(self) -> float:
        """Real part of the slowest pole of all designs, 1/s; negative when each loop at rest is stable."""
        return max(design.slowest for design in self.designs)

    def _answer(self, t: float, measurement: Measured) -> Float[np.ndarray, " nu"]:
        path, design = self.path, self.at(t)
        linear = design.linear
        now, ahead = commands_along(path, np.array([t, t + self.dt]), linear.lag, self.dt)
        error = linear.seen(measurement.nodes, measurement.velocities, measurement.inputs)
        error = error - linear.seen(path.nodes_at(t), path.velocities_at(t), path.inputs_at(t))
        if isinstance(design, SampledLQR):
            error = np.concatenate([error, commands_now(linear, measurement) - now])
        return np.clip(ahead - design.K @ error, *linear.dynamics.members.input_bounds)

    @property
    def sees_inputs(self) -> bool:
        """Whether designs feed inputs back."""
        return isinstance(self.designs[-1], SampledLQR)

    def _model(self, t: float) -> LinearModel:
        return self.at(t).linear

    def _first(self, t: float) -> Float[np.ndarray, " nu"]:
        return commands_along(self.path, np.array([t]), self.at(t).linear.lag, self.dt)[0]

    def at(self, t: float) -> Design:
        """The design that acts at time t."""
        return self.designs[int(np.abs(self.knots - float(self.path.place(t))).argmin())]

    def verify(self, tol: float = 1e-9) -> None:
        """Check every design.

        Raises
        ------
        SynthesisError
            With the first planned shape whose design fails, and why.
        """
        for knot, design in zip(self.knots, self.designs, strict=True):
            try:
                design.verify(tol)
            except SynthesisError as error:
                raise SynthesisError(f"at planned shape {knot}: {error}") from None


def scheduled_lqr(
    path: ShapePath, dynamics: Dynamics, design: Callable[[LinearModel], Design] = lqr, *, every: int = 2
) -> ScheduledLQR:
    """Design state feedback along a path.

    Parameters
    ----------
    path : ShapePath
    dynamics : Dynamics
        Of the path's scene.
    design : function of a LinearModel
        Gives each design; `lambda linear: tc.lqr(linear, dt=0.02)` for the sampled loop.
    every : int
        One planned equilibrium in so many has a design, counted back from the last.

    Raises
    ------
    SynthesisError
        What the design refuses.
    """
    check_kind(ShapePath, path=path)
    check_kind(Dynamics, dynamics=dynamics)
    every = argument("every", every, Number("planned equilibria", least=1, whole=True))
    if not callable(design):
        raise SynthesisError(f"design is of type {type(design).__name__}; a function of a LinearModel is expected.")
    knots = np.arange(len(path.equilibria) - 1, -1, -every)[::-1]
    models = (linearize(dynamics, path.equilibria[knot], outputs=()) for knot in knots)
    return ScheduledLQR(path, knots, tuple(design(linear) for linear in models))
