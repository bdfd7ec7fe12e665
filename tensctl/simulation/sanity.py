"""Whether a run is physical: rods that touch or buckle, tendons that hang slack, each told with its time and place.

The equations of motion know no contact and no bending. Rods that meet go through each other, and a rod carries any
load; so a run is looked over when it is there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.given import check_kind
from tensctl.simulation.buckling import Buckling, buckling
from tensctl.simulation.checked import check_pushes
from tensctl.simulation.clearance import Clearance, Segments, clearance
from tensctl.simulation.loads import Load
from tensctl.simulation.rod_forces import RodForces, rod_forces_along
from tensctl.simulation.run import Run
from tensctl.simulation.warn import MET, warnings_of
from tensctl.structure import Structure

# Rods without a radius count as close below this part of their length: thinner ones than 1:100 are rare, so two of
# them would touch. A larger value warns of more.
NEAR = 0.01


@dataclass(frozen=True, eq=False)
class Sanity:
    """What a run looks like to somebody who would build it.

    Attributes
    ----------
    structure : Structure
    time : (t,) s
    thick : bool
        Whether rods have a radius, so that distances are between surfaces and 0 is contact.
    rods : Clearance or None
        Between rods; None with fewer than two.
    tendons : Clearance or None
        Between rods (first) and tendons (second), slack ones taken straight; None without tendons.
    forces : RodForces
        Axial forces along the rods.
    buckling : Buckling or None
        None where no rod has EI.
    slack : (t,)
        Part of the tendons that carry nothing, 0 to 1; those between two pinned nodes do not count.
    local_errors : float, m
        Those of the run, see `Run`.
    """

    structure: Structure
    time: Float[np.ndarray, " t"]
    thick: bool
    rods: Clearance | None
    tendons: Clearance | None
    forces: RodForces
    buckling: Buckling | None
    slack: Float[np.ndarray, " t"]
    local_errors: float

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Sentences about what could not happen to a real structure, with time and place; empty when all is well."""
        return warnings_of(self)

    @property
    def not_checked(self) -> tuple[str, ...]:
        """What was left out, and what the scene would have to give."""
        missing = () if self.thick else ("contact of rods with a thickness: give rods.radius",)
        return missing if self.buckling is not None else (*missing, "buckling: give rods.EI")

    @property
    def largest_compression(self) -> tuple[float, str, float] | None:
        """Largest compression of all rods and times, N; the rod's label and the time, s. None without rods."""
        largest = self.forces.largest
        if not largest.size:
            return None
        moment, rod = np.unravel_index(largest.argmax(), largest.shape)
        return float(largest[moment, rod]), self.structure.rod_labels[int(rod)], float(self.time[moment])

    @property
    def most_slack(self) -> tuple[float, float]:
        """Largest part of slack tendons, and when it first occurs, s."""
        return float(self.slack.max()), float(self.time[self.slack.argmax()])


def inspect_run(dynamics: Dynamics, run: Run, *, pushes: Sequence[Load] = ()) -> Sanity:
    """Look over a run: clearance of rods and tendons, forces along rods, buckling, slack tendons.

    Parameters
    ----------
    dynamics : Dynamics
    run : Run
    pushes : sequence of Push, Wave or History
        Those that the run was given; they act on the rods' ends.

    Returns
    -------
    Sanity
        Print its `warnings`.

    Raises
    ------
    SimulationError
        An argument of another kind, or a run of another structure.
    """
    check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    check_kind(Run, error=SimulationError, run=run)
    check_pushes(pushes)
    structure, members = dynamics.structure, dynamics.members
    length = structure.rod_lengths
    thin = Segments(structure.rods, members.radius, MET * length)
    rods = Segments(structure.rods, members.radius, np.where(members.radius > 0, MET, NEAR) * length)
    none = np.zeros(len(structure.segments))
    forces = rod_forces_along(dynamics, run, pushes)
    return Sanity(
        structure=structure,
        time=run.time,
        thick=bool((members.radius > 0).any()),
        rods=clearance(run.time, run.nodes, run.velocities, rods) if len(rods.ends) > 1 else None,
        tendons=clearance(run.time, run.nodes, run.velocities, thin, Segments(structure.segments, none, none))
        if len(structure.segments) and len(rods.ends)
        else None,
        forces=forces,
        buckling=buckling(run.time, forces.largest, members.EI, length) if np.isfinite(members.EI).any() else None,
        slack=_slack(structure, run),
        local_errors=run.local_errors,
    )


def _slack(structure: Structure, run: Run) -> np.ndarray:
    moving = ~structure.grounded_tendons
    return (run.tensions[:, moving] == 0).mean(axis=1) if moving.any() else np.zeros(len(run.time))
