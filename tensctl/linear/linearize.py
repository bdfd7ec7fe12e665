"""Linearise a model about an equilibrium."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from tensctl.errors import LinearizationError
from tensctl.linear.boundary import Side, one_sided
from tensctl.linear.model import LinearModel
from tensctl.linear.modes import REPEATED, Modes
from tensctl.linear.outputs import Output, output_map
from tensctl.model import Dynamics
from tensctl.scene.given import check_kind
from tensctl.statics import Equilibrium
from tensctl.structure import select


def linearize(
    dynamics: Dynamics,
    equilibrium: Equilibrium,
    *,
    outputs: Output | Sequence[Output] = ("nodes", "tensions"),
    loads: Iterable[str] | None = None,
    on_boundary: Side | Mapping[str, Side] = "refuse",
    repeated: float = REPEATED,
) -> LinearModel:
    """Linearise a model about an equilibrium, exactly, on the rods' manifold.

    Nothing is computed before it is asked for: `linear.sparse` needs no modes and serves any size, A and everything
    modal need all of them.

    Parameters
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        Of the same structure.
    outputs : str or Mix, or a sequence of them
        Outputs of C and D, in this order: "nodes", "velocities", "lengths" or "tensions", or some of them by a pattern
        of labels, "nodes:P4_*", "tensions:t5_*", "nodes:*_z"; or weighted sums of these, `Mix`.
    loads : patterns of node labels, optional
        Nodes whose loads are the disturbance inputs of E; by default those that the scene pushes.
    on_boundary : "refuse", "taut", "slack", or a table of these by label pattern
        What a tendon on the slack boundary is taken for; the structure has one linear model on each side.
    repeated : float
        Gap, as a part of omega^2, up to which frequencies are grouped as one (`tensctl.linear.modes` states the rule).

    Raises
    ------
    LinearizationError
        When a tendon stands on the slack boundary and no side is chosen, when all are slack, or for an unknown output.
    """
    if not repeated >= 0:
        raise LinearizationError(f"repeated is {repeated}; a gap >= 0 is expected, as a part of omega^2.")
    here = checked_point(dynamics, equilibrium, on_boundary)
    loaded = dynamics.members.pushed
    if loads is not None:
        loaded = np.flatnonzero(select(dynamics.structure.node_labels, loads, "loads"))
    return LinearModel(dynamics, here, Modes(here, repeated), output_map(dynamics, here, outputs), loaded)


def checked_point(
    dynamics: Dynamics, equilibrium: Equilibrium, on_boundary: Side | Mapping[str, Side] = "refuse"
) -> Equilibrium:
    """The point to linearise about, with tendons on the slack boundary on the side asked for.

    Raises
    ------
    LinearizationError
        For an equilibrium of other members, on the slack boundary, or all slack.
    """
    check_kind(Dynamics, error=LinearizationError, dynamics=dynamics)
    check_kind(Equilibrium, error=LinearizationError, equilibrium=equilibrium)
    if not _same(dynamics, equilibrium):
        raise LinearizationError(
            "the equilibrium belongs to another structure or other materials; make it and the dynamics from one scene."
        )
    here = one_sided(equilibrium, on_boundary)
    if here.point.at_ease:
        raise LinearizationError("every tendon is slack, so nothing holds the shape; shorten the rest lengths.")
    return here


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
