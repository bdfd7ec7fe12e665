"""The exact linear model about an equilibrium, in energy coordinates.

With mass-normalised modes eta, omega^2 and damping Z = Phi' C Phi, the state x = (s eta, eta') obeys

    d/dt (s eta) = s eta',   eta'' = -(omega^2/s) (s eta) - Z eta' + Phi' G u,   s = omega

so |x|^2/2 is the energy of a flexible mode. Modes without stiffness (rigid-body, mechanism, unstable) take the lowest
flexible omega as s. Projected on the rods' manifold, with the rods' compression in H, nothing of it is approximate,
and no length constraint leaves a spurious zero eigenvalue.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from tensctl.errors import LinearizationError
from tensctl.linear.frame import Frame, best_fit
from tensctl.linear.modes import Mode, find_modes
from tensctl.linear.outputs import Output, OutputMap, output_map, safe_label
from tensctl.model import Dynamics, damping_matrix
from tensctl.statics import Equilibrium, stretch_map

if TYPE_CHECKING:
    import control

# A tendon whose stretch is below this part of its length stands on the slack boundary.
_BOUNDARY = 1e-9


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linear model of some modes of a structure; all of them unless a part was taken.

    Attributes
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        The point of linearisation; states, inputs and outputs are deviations from it.
    modes : tuple of Mode
    outputs_map : OutputMap
    """

    dynamics: Dynamics
    equilibrium: Equilibrium
    modes: tuple[Mode, ...]
    outputs_map: OutputMap

    @cached_property
    def _columns(self) -> np.ndarray:
        return np.array([mode.index for mode in self.modes], int)

    @cached_property
    def order(self) -> np.ndarray:
        """Positions of (s eta, eta') in x: rigid-body modes stand before the flexible ones, each part in full."""
        rigid = np.array([mode.kind == "rigid-body" for mode in self.modes], bool)
        k = np.arange(len(self.modes))
        parts = [k[rigid], k[rigid] + k.size, k[~rigid], k[~rigid] + k.size]
        return np.concatenate(parts).astype(int)

    @cached_property
    def shapes(self) -> Float[np.ndarray, "size modes"]:
        """Mass-normalised mode shapes in tangent coordinates."""
        return self.equilibrium.spectrum.shapes[:, self._columns]

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
        s, zero = self.scales, np.zeros((len(self.modes), len(self.modes)))
        damping = zero
        if self.dynamics.damped:
            C = damping_matrix(self.equilibrium.point, self.dynamics.damping, self.dynamics.drag)
            damping = self.shapes.T @ (C @ self.shapes)
        full = np.block([[zero, np.diag(s)], [np.diag(-omega2 / s), -damping]])
        return full[np.ix_(self.order, self.order)]

    @cached_property
    def B(self) -> Float[np.ndarray, "nx nu"]:
        """Input matrix: rest-length shortening of the acting tendons, m."""
        drive = self.shapes.T @ self.equilibrium.point.input_map[:, self.dynamics.members.inputs].toarray()
        return np.vstack([np.zeros_like(drive), drive])[self.order]

    @cached_property
    def E(self) -> Float[np.ndarray, "nx nw"]:
        """Disturbance matrix: forces on the pushed nodes, N, without z in a plane."""
        rows = (3 * self.dynamics.members.pushed[:, None] + np.arange(self.dynamics.structure.dimension)).ravel()
        drive = self.shapes.T @ self.equilibrium.point.tangent[rows].toarray().T
        return np.vstack([np.zeros_like(drive), drive])[self.order]

    @cached_property
    def C(self) -> Float[np.ndarray, "ny nx"]:
        """Output matrix."""
        position = self.outputs_map.position @ self.shapes / self.scales
        return np.hstack([position, self.outputs_map.rate @ self.shapes])[:, self.order]

    @cached_property
    def D(self) -> Float[np.ndarray, "ny nu"]:
        """Feedthrough: tensions answer to their own rest length at once."""
        return self.outputs_map.feedthrough[:, self.dynamics.members.inputs]

    @cached_property
    def stretch(self) -> Float[np.ndarray, "nt modes"]:
        """Growth of every tendon's length per unit of each mass-normalised mode."""
        return stretch_map(self.equilibrium) @ self.shapes

    @cached_property
    def states(self) -> tuple[str, ...]:
        """State labels: `q7`, `v7` are omega eta and eta' of mode 7; rigid-body modes are `rq1`, `rv1`."""
        names = [("r" if m.kind == "rigid-body" else "", m.index + 1) for m in self.modes]
        both = [f"{r}q{k}" for r, k in names] + [f"{r}v{k}" for r, k in names]
        return tuple(both[i] for i in self.order)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Input labels: `u_` and the tendon's label."""
        return tuple(f"u_{safe_label(label)}" for label in self.dynamics.input_labels)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Output labels: `P4_1_1_x`, `l_t5_1_1`, `T_t5_1_1`."""
        return self.outputs_map.labels

    @cached_property
    def flexible(self) -> LinearModel:
        """The model without rigid-body modes: what LQR, Gramians and MPC take."""
        kept = tuple(mode for mode in self.modes if mode.kind != "rigid-body")
        return LinearModel(self.dynamics, self.equilibrium, kept, self.outputs_map)

    def frame(self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]) -> Frame | None:
        """The co-moving frame of a free structure; None when the ground holds anything of it."""
        if self.dynamics.structure.held.any():
            return None
        return best_fit(self.equilibrium.potential, self.equilibrium.nodes, nodes, velocities)

    def state_of(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
    ) -> Float[np.ndarray, " nx"]:
        """State x of the nonlinear structure: great-circle chart about the equilibrium, in the co-moving frame.

        A sub-model without rigid-body modes sees a free structure from its co-moving frame; the full model of a
        free structure measures in the world.
        """
        frame = None if any(m.kind == "rigid-body" for m in self.modes) else self.frame(nodes, velocities)
        if frame is not None:
            nodes, velocities = frame.nodes(nodes), frame.velocities(nodes, velocities)
        manifold, members = self.equilibrium.potential.manifold, self.dynamics.members
        weight = manifold.mass(members.mass)
        xi = manifold.logarithm(self.equilibrium.nodes, nodes)
        rate = manifold.velocity(self.equilibrium.nodes, nodes, velocities)
        eta, speed = self.shapes.T @ (weight * xi), self.shapes.T @ (weight * rate)
        return np.concatenate([self.scales * eta, speed])[self.order]

    def to_statespace(self) -> control.StateSpace:
        """The model as a labelled `control.StateSpace`; keep labels with `copy_names=True` when converting it."""
        import control

        system = control.ss(
            self.A, self.B, self.C, self.D,
            inputs=list(self.inputs), outputs=list(self.outputs), states=list(self.states), name="tensctl_linear",
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


def linearize(
    dynamics: Dynamics, equilibrium: Equilibrium, *, outputs: tuple[Output, ...] | list[Output] = ("nodes", "tensions")
) -> LinearModel:
    """Linearise a model about an equilibrium, exactly, on the rods' manifold.

    Parameters
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        Of the same structure.
    outputs : sequence of "nodes", "lengths", "tensions"
        Outputs of C and D, in this order.

    Raises
    ------
    LinearizationError
        When a tendon stands on the slack boundary, where the structure has no single linear model, or for an
        unknown output.
    """
    unknown = [kind for kind in outputs if kind not in ("nodes", "lengths", "tensions")]
    if unknown:
        raise LinearizationError(f'output "{unknown[0]}" is unknown; choose from nodes, lengths, tensions.')
    check_point(dynamics, equilibrium)
    if not equilibrium.spectrum.complete:
        raise LinearizationError(
            f"the structure has {equilibrium.potential.manifold.size} degrees of freedom, too many for modes; "
            "its lowest frequencies are in equilibrium.omega2."
        )
    return LinearModel(
        dynamics, equilibrium, find_modes(equilibrium), output_map(dynamics, equilibrium, tuple(outputs))
    )


def check_point(dynamics: Dynamics, equilibrium: Equilibrium) -> None:
    """Refuse a point that the dynamics has no linear model about.

    Raises
    ------
    LinearizationError
        For an equilibrium of other members, on the slack boundary, or all slack.
    """
    if not _same(dynamics, equilibrium):
        raise LinearizationError(
            "the equilibrium belongs to another structure or other materials; make it and the dynamics from one scene."
        )
    stretch = equilibrium.lengths - equilibrium.rest_lengths
    edge = np.abs(stretch) <= _BOUNDARY * equilibrium.lengths
    edge &= ~dynamics.structure.grounded_tendons
    if edge.any() and not equilibrium.point.at_ease:
        label = dynamics.structure.tendon_labels[int(edge.argmax())]
        raise LinearizationError(
            f"tendon {label} is {stretch[edge.argmax()]:.1e} m from slack, so the structure has two linear models "
            "here; change its rest length a little."
        )
    if equilibrium.point.at_ease:
        raise LinearizationError("every tendon is slack, so nothing holds the shape; shorten the rest lengths.")


def _same(dynamics: Dynamics, equilibrium: Equilibrium) -> bool:
    """Whether both speak of the same members, materials and loads."""
    ours, theirs = dynamics.potential, equilibrium.potential
    if ours is theirs:
        return True
    pairs = (
        (ours.structure.rods, theirs.structure.rods),
        (ours.structure.segments, theirs.structure.segments),
        (ours.structure.segment_tendon, theirs.structure.segment_tendon),
        (ours.structure.held, theirs.structure.held),
        (ours.members.stiffness, theirs.members.stiffness),
        (ours.members.mass, theirs.members.mass),
        (ours.members.forces, theirs.members.forces),
    )
    return ours.members.law == theirs.members.law and all(np.array_equal(a, b) for a, b in pairs)
