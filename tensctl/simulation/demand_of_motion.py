"""The demand of a path or of a run.

A path has the rods' inertia as far as rest lengths can make its force, and feedback has to do the rest, so energies do
not balance to the last digit; without inertia they do, at equilibria. A run has what was recorded of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Choice
from tensctl.simulation.actuator_work import Pull, motor_forces, pull_of_run, pull_of_tensions
from tensctl.simulation.checked import check_pushes
from tensctl.simulation.demand import ActuatorDemand, Kind, Peak, Work
from tensctl.simulation.energy import energy_at
from tensctl.simulation.loads import Load
from tensctl.simulation.run import Run
from tensctl.structure import Members
from tensctl.synthesis import ShapePath

# Times of each leg at which a path is looked at: work is then good to 1e-7 of itself, and peaks to 1e-5, where speeds
# jump between two legs as well.
_TIMES = 1001
# Part of themselves by which lengths may be off: the tolerance that a run has by default.
_OFF = 1e-10


def actuator_demand(
    motion: ShapePath | Run, dynamics: Dynamics | None = None, *, pushes: Sequence[Load] = (), inertia: bool = True
) -> ActuatorDemand:
    """Force, speed, power and work of each actuator over a path or a run, with peaks.

    Parameters
    ----------
    motion : ShapePath or Run
    dynamics : Dynamics
        Of a run, which holds neither masses nor motors; a path has its own.
    pushes : sequence of Push, Wave or History
        Those that the run was given: they do work too, so energies are not compared.
    inertia : bool
        Whether a path is as fast as planned, or counts as infinitely slow, with the forces of its equilibria.

    Raises
    ------
    SimulationError
        A run without the dynamics that it belongs to, or a motion without actuators.
    """
    inertia = argument("inertia", inertia, Choice(True, False), SimulationError)
    if isinstance(motion, ShapePath):
        return _of_path(motion, inertia)
    check_kind(Run, error=SimulationError, motion=motion)
    if dynamics is not None:
        check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    check_pushes(pushes)
    if dynamics is None or motion.input_labels != dynamics.input_labels:
        raise SimulationError(
            "a run holds neither masses nor motors; give actuator_demand(run, dynamics) those of its scene."
        )
    change = energy_at(dynamics, motion, -1) - energy_at(dynamics, motion, 0)
    closed = not (dynamics.damped or pushes)
    pull = pull_of_run(dynamics, motion)
    return _demand("run", dynamics.members, pull, motion.tensions, motion.lengths, change, closed)


def _of_path(path: ShapePath, inertia: bool) -> ActuatorDemand:
    time = np.unique(np.concatenate([leg.moments(_TIMES) for leg in path.legs]))
    members = path.target.potential.members
    tensions = path.tensions_at(time) if inertia else path.balanced_tensions_at(time)
    inputs = path.inputs_at(time) if inertia else path.balanced_inputs_at(time)
    pull = pull_of_tensions(members, time, inputs, tensions)
    lengths = path.equilibria[0].lengths
    change = path.target.energy - path.equilibria[0].energy
    return _demand("path" if inertia else "slow path", members, pull, tensions, lengths, change, not inertia)


def _demand(
    of: Kind, members: Members, pull: Pull, tensions: np.ndarray, lengths: np.ndarray, energy_change: float,
    closed: bool,
) -> ActuatorDemand:  # fmt: skip
    labels, motor = members.gearing.labels, members.gearing.motor
    if not labels:
        raise SimulationError("no tendon has an actuator that moves anything, so nothing is asked of any.")
    speed, works = pull.speed, pull.works()
    after = np.zeros_like(speed)
    after[:-1] = pull.force[:-1] * speed[1:]
    shares = np.zeros_like(speed)
    np.maximum.at(shares.T, motor, (tensions / members.force_max).T[members.inputs])
    return ActuatorDemand(
        of=of,
        labels=labels,
        time=pull.time,
        force=motor_forces(members, tensions),
        speed=speed,
        power=pull.force * speed,
        power_after=after,
        work=Work(np.maximum(works, 0).sum(axis=0), np.minimum(works, 0).sum(axis=0), works.sum(axis=0)),
        work_error=pull.error,
        load=Peak(shares.max(axis=0), pull.time[shares.argmax(axis=0)]),
        energy_change=energy_change,
        energy_error=_OFF * float((tensions * lengths).sum(axis=1).max()),
        closed=closed,
    )
