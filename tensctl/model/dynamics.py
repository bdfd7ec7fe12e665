"""How a structure moves: q'' = explicit in q, q', u, w ([S] 5.21), as CasADi functions and as a compiled kernel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from jaxtyping import Bool, Float

from tensctl.elements import JointedManifold, Potential, RodManifold
from tensctl.errors import StructureError
from tensctl.model.constraints import Constraints
from tensctl.model.damping import resolve_damping
from tensctl.model.explain import Term, as_table, explain
from tensctl.model.layout import Layout
from tensctl.model.symbolic import SymbolicModel, coordinate_count, symbolic_model
from tensctl.scene import Scene
from tensctl.scene.given import check_kind
from tensctl.structure import Members, Structure, nodal_weight

if TYPE_CHECKING:
    from tensctl.model.kernel import KernelData


@dataclass(frozen=True, eq=False)
class Explanation:
    """Terms of a model, in or out; prints as a table."""

    terms: tuple[Term, ...]

    def __str__(self) -> str:
        """The table as aligned text."""
        return as_table(self.terms)


@dataclass(frozen=True, eq=False)
class Dynamics:
    """The model of one scene. CasADi functions and kernel are built when first asked for.

    Attributes
    ----------
    potential : Potential
    damping : (nt,) N s/m
    drag : float, N s/m on each rod end
    clamped : bool
        Whether a damped tendon is held at T >= 0; False lets a taut damper push, for comparison with codes that do.
    """

    potential: Potential
    damping: Float[np.ndarray, " tendons"]
    drag: float
    clamped: bool = True

    @property
    def structure(self) -> Structure:
        """The structure that moves."""
        return self.potential.structure

    @property
    def members(self) -> Members:
        """Its materials, loads and inputs."""
        return self.potential.members

    @property
    def damped(self) -> bool:
        """Whether energy is lost."""
        return bool(self.damping.any()) or self.drag > 0

    @property
    def tied(self) -> bool:
        """Whether joints or guides tie rod ends, so that motion needs multipliers."""
        return self.constraints.first.size > 0

    @property
    def input_labels(self) -> tuple[str, ...]:
        """Labels of the inputs u: acting tendons, and gangs by name."""
        return self.members.gearing.labels

    @cached_property
    def symbolic(self) -> SymbolicModel:
        """The CasADi functions f, y_p, y_l, y_f."""
        return symbolic_model(
            self.potential, self.damping, self.drag, self.layout, self.constraints, clamped=self.clamped
        )

    @property
    def f(self) -> ca.Function:
        """(x, u, w) -> dx/dt."""
        return self.symbolic.f

    @property
    def y_p(self) -> ca.Function:
        """X -> node positions, (3N,) m ([S] 5.22)."""
        return self.symbolic.y_p

    @property
    def y_l(self) -> ca.Function:
        """X -> tendon lengths, (nt,) m."""
        return self.symbolic.y_l

    @property
    def y_f(self) -> ca.Function:
        """(x, u) -> tendon tensions, (nt,) N."""
        return self.symbolic.y_f

    @cached_property
    def constraints(self) -> Constraints:
        """Joints and guides as linear rows; none where rods share nothing."""
        return Constraints.of(self.potential.manifold)

    @cached_property
    def layout(self) -> Layout:
        """Nodes of the kernel: the structure's own, or every rod end by itself where rods share nodes."""
        return Layout.of(self.structure, self.potential.manifold)

    @cached_property
    def kernel(self) -> KernelData:
        """Arrays for the compiled kernel."""
        from tensctl.model.kernel import KernelData

        structure, members, manifold = self.structure, self.members, self.potential.manifold
        layout, rows = self.layout, self.constraints
        segments, rods = layout.place[structure.segments], layout.rods
        return KernelData(
            stiffness=members.stiffness,
            by_strain=members.law == "EA",
            damping=self.damping,
            drag=float(self.drag),
            rod_tail=np.ascontiguousarray(rods[:, 0]),
            rod_head=np.ascontiguousarray(rods[:, 1]),
            hold=manifold.hold,
            anchor=layout.anchor,
            mass=members.mass,
            lengths=manifold.lengths,
            tail_at=3 * segments[:, 0].astype(np.uint64),
            head_at=3 * segments[:, 1].astype(np.uint64),
            row=1,
            rod_tail_at=3 * rods[:, 0].astype(np.uint64),
            rod_head_at=3 * rods[:, 1].astype(np.uint64),
            clamped=self.clamped,
            cables=structure.has_cables,
            pieces=np.bincount(structure.segment_tendon, minlength=len(structure.tendons)),
            first=rows.first,
            second=rows.second,
            target=rows.target,
            couples=rows.couples,
            low=rows.low,
            place=rows.place,
        )

    @cached_property
    def fastest_rate(self) -> float:
        """A bound on every frequency that the structure can have at rest, rad/s."""
        from tensctl.model.rate import fastest_rate

        return fastest_rate(self.potential)

    @cached_property
    def fastest_decay(self) -> float:
        """A bound on the rate at which dampers and drag stop a motion, 1/s."""
        from tensctl.model.rate import fastest_decay

        return fastest_decay(self.potential, self.damping, self.drag)

    def varied(self, *, damping: Float[np.ndarray, " tendons"] | None = None, **members: np.ndarray) -> Dynamics:
        """The same structure with other numbers; what does not depend on them is shared, not made again.

        Parameters
        ----------
        damping : (nt,) N s/m
        **members
            `stiffness`, `rest_lengths`, `mass` or `forces`, as `Members` has them; weight follows the mass where
            no forces are given.
        """
        if "mass" in members and "forces" not in members and self.members.gravity.any():
            heavier = members["mass"] - self.members.mass
            members["forces"] = self.members.forces + nodal_weight(self.structure, heavier, self.members.gravity)
        changed = replace(self.members, **members)
        other = replace(
            self,
            potential=replace(self.potential, members=changed, manifold=self._weighed(changed.mass)),
            damping=self.damping if damping is None else damping,
        )
        kernel = self.kernel._replace(stiffness=changed.stiffness, mass=changed.mass, damping=other.damping)
        shared = {"layout": self.layout, "constraints": self.constraints, "kernel": kernel}
        if "forces" not in members and self.members.law == "k" and not self.members.forces.any():
            stiffer = (changed.stiffness / self.members.stiffness).max(initial=1.0)
            lighter = (changed.mass / self.members.mass).min(initial=1.0)
            shared["fastest_rate"] = self.fastest_rate * np.sqrt(stiffer / lighter)
        other.__dict__.update(shared)
        return other

    def _weighed(self, mass: Float[np.ndarray, " rods"]) -> RodManifold | JointedManifold:
        """The manifold for other rod masses: coordinates of jointed rods are square in the mass metric."""
        manifold = self.potential.manifold
        if isinstance(manifold, RodManifold):
            return manifold
        return replace(manifold, weights=mass.mean() / manifold.ends.mass(mass))

    def rod_coordinates(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "rods 6"]:
        """(q1, q2) of every rod from node positions, or their rates from node velocities."""
        tail, head = nodes[self.structure.rods[:, 0]], nodes[self.structure.rods[:, 1]]
        return np.hstack([tail + head, head - tail])

    def pack(
        self, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"] | None = None
    ) -> Float[np.ndarray, " x"]:
        """State x of the CasADi functions from nodes and node velocities (at rest by default)."""
        rates = np.zeros_like(nodes) if velocities is None else velocities
        keep = self.state_mask
        return np.concatenate([self.rod_coordinates(nodes)[keep], self.rod_coordinates(rates)[keep]])

    def unpack(self, x: Float[np.ndarray, " x"]) -> tuple[np.ndarray, np.ndarray]:
        """Nodes and node velocities, (N, 3) m and m/s, from a state x."""
        size = coordinate_count(self.potential)
        nodes = np.asarray(self.y_p(x)).reshape(-1, 3)
        rates = np.asarray(self.y_p(np.concatenate([x[size:], np.zeros(size)]))).reshape(-1, 3)
        still = np.asarray(self.y_p(np.zeros(2 * size))).reshape(-1, 3)
        return nodes, rates - still

    @cached_property
    def state_mask(self) -> Bool[np.ndarray, "rods 6"]:
        """Which rod coordinates are in the state x: all of a free rod, q2 of one held at one end."""
        hold = self.potential.manifold.hold
        axes = np.arange(3) < self.structure.dimension
        return np.column_stack([np.outer(hold == 0, axes), np.outer(hold != 3, axes)])

    def explain(self) -> Explanation:
        """Each term of the model, in or out, why, and its operation count."""
        return Explanation(explain(self.potential, self.damping, self.drag, self.constraints))


def build_dynamics(scene: Scene) -> Dynamics:
    """Build the model of a scene; only what the scene has is in it.

    Raises
    ------
    StructureError
        No scene, or a recipe or label that does not fit.
    EquilibriumError
        A damping ratio for a structure without a stable equilibrium.
    """
    check_kind(Scene, error=StructureError, scene=scene)
    potential = Potential.of(scene)
    damping, drag = resolve_damping(potential)
    return Dynamics(potential, damping, drag)
