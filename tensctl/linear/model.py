"""The exact linear model about an equilibrium, in energy coordinates.

With mass-normalised modes eta, omega^2 and damping Z = Phi' C Phi, the state x = (s eta, eta') obeys

    d/dt (s eta) = s eta',   eta'' = -(omega^2/s) (s eta) - Z eta' + Phi' G u,   s = omega

so |x|^2/2 is the energy of a flexible mode. Modes without stiffness (rigid-body, mechanism, unstable) take the lowest
flexible omega as s. Projected on the rods' manifold, with the rods' compression in H, nothing of it is approximate,
and no length constraint leaves a spurious zero eigenvalue.

Nothing depends on the position of a rigid-body mode, so the flexible model leaves it out. Drag couples the rates of
rigid-body motion to flexible ones, so where there is drag the flexible model keeps these rates as its last states.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import LinearizationError
from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.lag import lag_felt, recast
from tensctl.linear.modes import Mode, Modes
from tensctl.linear.outputs import Output, OutputMap, output_map
from tensctl.linear.second_order import SecondOrder, second_order
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium, stretch_map

if TYPE_CHECKING:
    import control

    from tensctl.linear.discrete import Discrete, Method


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linear model of some modes of a structure; all of them unless a part was taken.

    Attributes
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        The point of linearisation; states, inputs and outputs are deviations from it.
    modes : tuple of Mode, or Modes
        Found when first asked for.
    outputs_map : OutputMap
    loaded : (nw,) int
        Nodes whose loads are the disturbance inputs.
    drifting : tuple of Mode
        Rigid-body modes of which only the rates are states.
    condensed : tuple of Mode
        Modes that are no states and stand where held inputs put them: their static answer is part of D.
    """

    dynamics: Dynamics
    equilibrium: Equilibrium
    modes: Modes | tuple[Mode, ...]
    outputs_map: OutputMap
    loaded: Int[np.ndarray, " loads"] = field(default_factory=lambda: np.zeros(0, int))
    drifting: tuple[Mode, ...] = ()
    condensed: tuple[Mode, ...] = ()

    @cached_property
    def sparse(self) -> SecondOrder:
        """Second-order form of the whole structure in tangent coordinates, sparse, at any size: no modes needed."""
        return second_order(self.dynamics, self.equilibrium, self.outputs_map, self.loaded)

    @cached_property
    def order(self) -> Int[np.ndarray, " nx"]:
        """Positions of (s eta, eta') in x: rigid-body modes stand before the flexible ones, each part in full.

        The rates of drifting modes stand last, in both.
        """
        rigid = np.array([mode.kind == "rigid-body" for mode in self.modes], bool)
        k, last = np.arange(len(self.modes)), np.arange(len(self.drifting))
        parts = [k[rigid], k[rigid] + k.size, k[~rigid], k[~rigid] + k.size, 2 * k.size + last]
        return np.concatenate(parts).astype(int)

    @cached_property
    def shapes(self) -> Float[np.ndarray, "size modes"]:
        """Mass-normalised mode shapes in tangent coordinates."""
        return self._shapes_of(self.modes)

    @cached_property
    def _moving(self) -> np.ndarray:
        """Shapes of all rates that are states."""
        return np.hstack([self.shapes, self._shapes_of(self.drifting)])

    def _shapes_of(self, modes: Sequence[Mode]) -> np.ndarray:
        return self.equilibrium.spectrum.shapes[:, np.array([mode.index for mode in modes], int)]

    @cached_property
    def scales(self) -> Float[np.ndarray, " modes"]:
        """Scaling s of each mode's position, rad/s."""
        omega2 = np.array([mode.omega2 for mode in self.modes])
        flexible = np.array([mode.kind == "flexible" for mode in self.modes], bool)
        lowest = np.sqrt(omega2[flexible].min()) if flexible.any() else 1.0
        return np.where(flexible, np.sqrt(np.where(flexible, omega2, 1.0)), lowest)

    @cached_property
    def A(self) -> Float[np.ndarray, "nx nx"]:
        """State matrix, 1/s."""
        omega2 = np.array([0.0 if m.kind == "rigid-body" else m.omega2 for m in self.modes])
        count, rates = len(self.modes), self._moving.shape[1]
        full = np.zeros((count + rates, count + rates))
        full[np.arange(count), count + np.arange(count)] = self.scales
        full[count + np.arange(count), np.arange(count)] = -omega2 / self.scales
        if self.dynamics.damped:
            full[count:, count:] = -(self._moving.T @ (self.sparse.C @ self._moving))
        return full[np.ix_(self.order, self.order)]

    @cached_property
    def B(self) -> Float[np.ndarray, "nx nu"]:
        """Input matrix: rest-length shortening u, m."""
        return self._driven(self.sparse.G)

    @cached_property
    def E(self) -> Float[np.ndarray, "nx nw"]:
        """Disturbance matrix: forces on the chosen nodes, N, without z in a plane."""
        return self._driven(self.sparse.W)

    def _driven(self, force) -> np.ndarray:
        """How forces in tangent coordinates, one a column, drive the states."""
        rates = (force.T @ self._moving).T
        return np.vstack([np.zeros((len(self.modes), rates.shape[1])), rates])[self.order]

    @cached_property
    def C(self) -> Float[np.ndarray, "ny nx"]:
        """Output matrix."""
        position = self.outputs_map.position @ self.shapes / self.scales
        return np.hstack([position, self.outputs_map.rate @ self._moving])[:, self.order]

    @cached_property
    def D(self) -> Float[np.ndarray, "ny nu"]:
        """Feedthrough: tensions answer to their own rest length at once, condensed modes without delay."""
        direct = self.sparse.F.toarray()
        if not self.condensed:
            return direct
        shapes = self._shapes_of(self.condensed)
        omega2 = np.array([mode.omega2 for mode in self.condensed])
        return direct + (self.outputs_map.position @ shapes / omega2) @ (self.sparse.G.T @ shapes).T

    @cached_property
    def stretch(self) -> Float[np.ndarray, "nt modes"]:
        """Growth of every tendon's length per unit of each mass-normalised mode."""
        return stretch_map(self.equilibrium) @ self.shapes

    @cached_property
    def states(self) -> tuple[str, ...]:
        """State labels: `q7`, `v7` are omega eta and eta' of mode 7; rigid-body modes are `rq1`, `rv1`."""
        names = [("r" if m.kind == "rigid-body" else "", m.index + 1) for m in self.modes]
        both = [f"{r}q{k}" for r, k in names] + [f"{r}v{k}" for r, k in names]
        both += [f"rv{mode.index + 1}" for mode in self.drifting]
        return tuple(both[i] for i in self.order)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Input labels: `u_` and the tendon's label, or the gang's name."""
        return self.sparse.inputs

    @property
    def disturbances(self) -> tuple[str, ...]:
        """Labels of the loads w, the columns of E: `w_P4_1_1_x`."""
        return self.sparse.disturbances

    @property
    def outputs(self) -> tuple[str, ...]:
        """Output labels: `P4_1_1_x`, `v_P4_1_1_x`, `l_t5_1_1`, `T_t5_1_1`, or the names of a mix."""
        return self.outputs_map.labels

    @cached_property
    def flexible(self) -> LinearModel:
        """The model without rigid-body modes: what LQR, Gramians and MPC take.

        Under drag the rigid-body rates stay: they drive flexible modes and are driven by them.
        """
        kept = tuple(mode for mode in self.modes if mode.kind != "rigid-body")
        rigid = tuple(mode for mode in self.modes if mode.kind == "rigid-body")
        return replace(self, modes=kept, drifting=(rigid or self.drifting) if self.dynamics.drag > 0 else ())

    @property
    def lag(self) -> float:
        """Lag of the actuators that the states carry, s: none here, see `actuated`."""
        return 0.0

    @property
    def mechanics(self) -> LinearModel:
        """The part whose inputs are rest lengths: this model."""
        return self

    @property
    def actuated(self) -> LinearModel:
        """The model whose inputs are commands; where the scene's actuators lag, rest lengths are further states.

        A lag that turns the fastest mode by less than a billionth of a radian is left out.
        """
        if not lag_felt(self.dynamics, float(self.scales.max(initial=0.0))):
            return self
        from tensctl.linear.actuated import ActuatedModel

        return recast(self, ActuatedModel)

    def showing(self, outputs: Output | Sequence[Output]) -> LinearModel:
        """The same model with other outputs."""
        return replace(self, outputs_map=output_map(self.dynamics, self.equilibrium, outputs))

    def frame(self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]) -> Frame | None:
        """The co-moving frame of a free structure; None when the ground holds anything of it."""
        if self.dynamics.structure.held.any():
            return None
        return best_fit(self.equilibrium.potential, self.equilibrium.nodes, nodes, velocities)

    def state_of(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " nx"]:
        """State x of the nonlinear structure: great-circle chart about the equilibrium, in the co-moving frame.

        A sub-model without rigid-body modes sees a free structure from its co-moving frame, with the rates of drifting
        modes along its axes; the full model of a free structure measures in the world.
        """
        frame = None if self._in_world else self.frame(nodes, velocities)
        seen, rates, drift = nodes, velocities, velocities
        if frame is not None:
            seen, rates, drift = frame.nodes(nodes), frame.velocities(nodes, velocities), velocities @ frame.rotation
        count, down = len(self.modes), self._to_modes
        xi, rate = self._chart.at(seen, rates)
        parts = [self.scales * (down[:count] @ xi), down[:count] @ rate]
        if self.drifting:
            parts.append(down[count:] @ self._chart.at(seen, drift)[1])
        return np.concatenate(parts)[self.order]

    def seen(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"],
        inputs: Float[np.ndarray, " nu"],
    ) -> Float[np.ndarray, " nx"]:  # fmt: skip
        """State x of the nonlinear structure with its rest-length changes, which are no states here."""
        return self.state_of(nodes, velocities)

    @cached_property
    def _in_world(self) -> bool:
        return any(mode.kind == "rigid-body" for mode in self.modes)

    @cached_property
    def _chart(self):
        return self.equilibrium.potential.manifold.chart(self.equilibrium.nodes)

    @cached_property
    def _to_modes(self) -> np.ndarray:
        """Modal coordinates from tangent coordinates: Phi' M."""
        return self._moving.T * self.equilibrium.potential.manifold.mass(self.dynamics.members.mass)

    def sample(self, dt: float, *, method: Method = "zoh", delay: float = 0.0) -> Discrete:
        """The model in discrete time, exactly: see `tensctl.linear.discrete.sample`.

        Parameters
        ----------
        dt : float, s
        method : "zoh" or "ramp"
            Whether a command is held for a period, or reached in a straight line at the end of it.
        delay : float, s
            From a command to its first effect, of any length.
        """
        from tensctl.linear.discrete import sample

        return sample(self, dt, method=method, delay=delay)

    def to_statespace(self, *, disturbances: bool = False) -> control.StateSpace:
        """The model as a labelled `control.StateSpace`; keep labels with `copy_names=True` when converting it.

        Parameters
        ----------
        disturbances : bool
            Whether the loads w follow the inputs u, as further inputs.
        """
        import control

        B, D, inputs = self.B, self.D, self.inputs
        if disturbances:
            B, inputs = np.hstack([B, self.E]), inputs + self.disturbances
            D = np.hstack([D, np.zeros((len(self.outputs), len(self.disturbances)))])
        system = control.ss(
            self.A, B, self.C, D,
            inputs=list(inputs), outputs=list(self.outputs), states=list(self.states), name="tensctl_linear",
        )  # fmt: skip
        assert isinstance(system, control.StateSpace)
        return system

    def verify(self, tol: float = 1e-9) -> None:
        """Check A against the Hessian and mass matrix that it came from.

        Raises
        ------
        LinearizationError
            With the misfit found.
        """
        point, manifold = self.equilibrium.point, self.equilibrium.potential.manifold
        mass = manifold.mass(self.dynamics.members.mass)
        gram = self.shapes.T @ (mass[:, None] * self.shapes) - np.eye(len(self.modes))
        stiff = self.shapes.T @ (point.hessian @ self.shapes) - np.diag([m.omega2 for m in self.modes])
        scale = max((abs(m.omega2) for m in self.modes), default=1.0)
        misfit = max(np.abs(gram).max(initial=0.0), np.abs(stiff).max(initial=0.0) / scale)
        if misfit > tol:
            raise LinearizationError(f"the modes miss the Hessian by {misfit:.1e} of its size; {tol:.0e} is expected.")
