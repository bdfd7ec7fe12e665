"""CVODES through CasADi on the project's own model: x' = f(x, u, w), variable order and step, exact Jacobian.

Another integrator of the same statement of the physics: what it shares with the compiled methods is [S] (5.21), not
the kernel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from tensctl.model.symbolic import symbolic_model
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.judge import Judge, inputs_at
from tensctl.structure import Gearing


@dataclass(eq=False)
class Cvodes(Judge):
    """CVODES: Adams formulas without dampers, BDF with them."""

    @property
    def name(self) -> str:
        """Name of the method."""
        return "cvodes"

    @cached_property
    def _rate(self) -> ca.Function:
        """F with every rest length and every nodal force as inputs."""
        dynamics, members, structure = self.dynamics, self.dynamics.members, self.dynamics.structure
        every = replace(
            members,
            inputs=np.arange(len(structure.tendons)),
            gearing=Gearing.direct(structure.tendon_labels),
            pushed=np.arange(len(structure.nodes)),
        )
        potential = replace(dynamics.potential, members=every)
        return symbolic_model(
            potential, dynamics.damping, dynamics.drag, dynamics.layout, dynamics.constraints, clamped=dynamics.clamped
        ).f

    def prepared(self, drive: Drive) -> ca.Function:
        """CVODES for a drive."""
        dynamics = self.dynamics
        t, span = ca.MX.sym("t"), ca.MX.sym("span", 2)
        x = ca.MX.sym("x", self._rate.size1_in("x"))
        rest, force = inputs_at(drive, span[0] + t * span[1])
        axes, members = dynamics.structure.dimension, dynamics.members
        nodal = ca.vertcat(*(ca.vertsplit(force, 3)[k][:axes] for k in dynamics.layout.place))
        pushes = nodal - ca.DM(members.forces[:, :axes].ravel())
        rate = self._rate(x, ca.DM(members.rest_lengths) - rest, pushes)
        method = "bdf" if dynamics.damped else "adams"
        options = self.options | {"linear_multistep_method": method, "nonlinear_solver_iteration": "newton"}
        return ca.integrator("cvodes", "cvodes", {"x": x, "t": t, "p": span, "ode": span[1] * rate}, 0.0, 1.0, options)

    def advance(self, prepared: ca.Function, q: np.ndarray, v: np.ndarray, span: list[float]) -> None:
        """Move q and v in place from span[0] on for span[1], s."""
        kept = self.dynamics.state_mask
        x = np.concatenate([q[kept], v[kept]])
        found = np.asarray(self.run(prepared, x0=x, p=span)["xf"]).ravel()
        q[kept], v[kept] = found[: found.size // 2], found[found.size // 2 :]
        self.settled(q, v)
