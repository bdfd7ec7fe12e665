"""What the members are made of: one number a member, from the scene's numbers and tables by label."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from tensctl.errors import StructureError
from tensctl.scene import Ratio
from tensctl.structure.gearing import Gearing, build_gearing, read_gangs
from tensctl.structure.labels import by_label, by_part, matches, select
from tensctl.structure.structure import Structure

if TYPE_CHECKING:
    from tensctl.scene import Scene

Law = Literal["k", "EA"]
T = TypeVar("T")
_LOADS = ("push", "wave", "history")


@dataclass(frozen=True, eq=False)
class Members:
    """Material, loads and actuation by member.

    Attributes
    ----------
    mass : (nr,) kg
    law : "k" or "EA"
        Which of the two stays constant when the rest length moves.
    stiffness : (nt,) N/m for law "k", N for law "EA"
    rest_lengths : (nt,) m
        L0, before any control.
    floors : (nt,) m
        Smallest rest length that a control may ask for.
    damping : (nt,) N s/m
    damping_ratio, drag_ratio : float or None
        Fraction of critical of the lowest flexible mode; the model resolves it at the equilibrium.
    drag : float, N s/m on each rod end
    forces : (N, 3) N
        Constant nodal forces: loads and weight.
    gravity : (3,) m/s^2
    inputs : (na,) int
        Tendons whose rest length a control may change and which move something.
    gearing : Gearing
        The motors that change them: the inputs u, (nu,), as many as `inputs` where there are no gangs.
    actuated : (nt,) bool
        Tendons that have an actuator, acting or not.
    rate_max : float, m/s
        Fastest that a command changes a rest length.
    force_max : (nt,) N
        Largest tension that an actuator may meet, its stall limit; infinite where none is given or none acts.
    power_max : float, W
        Largest power that a motor may give or take; infinite where none is given.
    lag : float, s
        Time constant tau of the actuators, du/dt = (command - u)/tau; 0 without lag.
    pushed : (nw,) int
        Nodes on which a disturbance acts.
    radius : (nr,) m
        Of the rods; 0 where the scene gives none.
    EI : (nr,) N m^2
        Bending stiffness of the rods; infinite where the scene gives none.
    """

    mass: Float[np.ndarray, " rods"]
    law: Law
    stiffness: Float[np.ndarray, " tendons"]
    rest_lengths: Float[np.ndarray, " tendons"]
    floors: Float[np.ndarray, " tendons"]
    damping: Float[np.ndarray, " tendons"]
    damping_ratio: float | None
    drag: float
    drag_ratio: float | None
    forces: Float[np.ndarray, "nodes 3"]
    gravity: Float[np.ndarray, " 3"]
    inputs: Int[np.ndarray, " acting"]
    gearing: Gearing
    actuated: Bool[np.ndarray, " tendons"]
    pushed: Int[np.ndarray, " pushed"]
    radius: Float[np.ndarray, " rods"]
    EI: Float[np.ndarray, " rods"]
    force_max: Float[np.ndarray, " tendons"]
    rate_max: float = np.inf
    power_max: float = np.inf
    lag: float = 0.0

    def shortened(self, u: Float[np.ndarray, " inputs"]) -> Float[np.ndarray, " tendons"]:
        """Rest lengths after a total change u of the inputs, m."""
        rest = self.rest_lengths.copy()
        rest[self.inputs] -= self.gearing.spread(u)
        return rest

    def inputs_of(self, rest_lengths: Float[np.ndarray, "*t tendons"]) -> Float[np.ndarray, "*t inputs"]:
        """The change u from L0 that rest lengths amount to, m; the nearest one where gangs do not fit exactly."""
        return self.gearing.gather((self.rest_lengths - rest_lengths)[..., self.inputs])

    @cached_property
    def input_bounds(self) -> tuple[Float[np.ndarray, " inputs"], Float[np.ndarray, " inputs"]]:
        """Least and largest u at which every rest length keeps its floor, m."""
        return self.gearing.bounds((self.rest_lengths - self.floors)[self.inputs])

    @cached_property
    def stall(self) -> Float[np.ndarray, " inputs"]:
        """Largest force that each motor may meet, N: what its tendons pull with at `force_max`, infinite without one.

        Tendons only pull, so those that a gang takes in and those that it lets out at the same time count apart. Of a
        constant EA it is what gives the power, T (1 + T/(2 EA)).
        """
        force = self.force_max[self.inputs]
        if self.law == "EA":
            force = force * (1 + force / (2 * self.stiffness[self.inputs]))
        sides = np.zeros((2, self.gearing.size))
        np.add.at(sides, ((self.gearing.ratio < 0).astype(int), self.gearing.motor), np.abs(self.gearing.ratio) * force)
        return sides.max(axis=0)

    @property
    def damped(self) -> bool:
        """Whether anything in the structure takes energy out."""
        ratios = (self.damping_ratio or 0.0, self.drag_ratio or 0.0)
        return bool(self.damping.any()) or self.drag > 0 or any(ratios)


def build_members(scene: Scene, structure: Structure) -> Members:
    """Give every member its numbers.

    Raises
    ------
    StructureError
        A pattern that names nothing, or a member without a value.
    """
    tendons = scene.tendons
    law: Law = "k" if tendons.EA is None else "EA"
    given = tendons.stiffness if tendons.EA is None else tendons.EA
    if given is None:
        raise StructureError("tendons have neither stiffness nor EA; give one of them.")
    rest = _rest_lengths(scene, structure)
    damping, damping_ratio = _coefficient_or_ratio(tendons.damping)
    drag, drag_ratio = _coefficient_or_ratio(0.0 if scene.drag is None else scene.drag.coefficient)
    gravity = _gravity(scene, structure)
    actuated = select(structure.tendon_labels, scene.actuators.tendons, "actuators.tendons")
    gangs = scene.actuators.gangs or {}
    ratios, gang = read_gangs(structure.tendon_labels, gangs)
    actuated |= gang >= 0
    inputs = np.flatnonzero(actuated & ~structure.grounded_tendons)
    mass = by_label(structure.rod_labels, scene.rods.mass, "rods.mass")
    key = "stiffness" if law == "k" else "EA"
    EI = np.inf if scene.rods.EI is None else scene.rods.EI
    return Members(
        mass=mass,
        law=law,
        stiffness=_summed(structure, given, f"tendons.{key}"),
        rest_lengths=rest,
        floors=scene.actuators.floor * rest,
        damping=_summed(structure, damping, "tendons.damping", default=0.0),
        damping_ratio=damping_ratio,
        drag=drag,
        drag_ratio=drag_ratio,
        forces=_forces(scene, structure, mass, gravity),
        gravity=gravity,
        inputs=inputs,
        gearing=build_gearing(structure.tendon_labels, inputs, ratios, gang, tuple(gangs)),
        actuated=actuated,
        pushed=_pushed(scene, structure),
        radius=by_label(structure.rod_labels, scene.rods.radius, "rods.radius", default=0.0),
        EI=by_label(structure.rod_labels, EI, "rods.EI", default=np.inf),
        force_max=_force_max(scene, structure, inputs),
        rate_max=np.inf if scene.actuators.rate_max is None else scene.actuators.rate_max,
        power_max=np.inf if scene.actuators.power_max is None else scene.actuators.power_max,
        lag=scene.actuators.lag,
    )


def _force_max(scene: Scene, structure: Structure, inputs: np.ndarray) -> np.ndarray:
    """Stall limits of the acting tendons; merged ones add up, as their stiffnesses do."""
    given, limits = scene.actuators.force_max, np.full(len(structure.tendons), np.inf)
    if given is None:
        return limits
    for pattern in given if isinstance(given, Mapping) else ():
        if not np.isin(matches(structure.tendon_labels, pattern, "actuators.force_max"), inputs).any():
            raise StructureError(
                f'actuators.force_max: "{pattern}" names no tendon with an acting actuator; '
                "name one of actuators.tendons, or leave it out."
            )
    limits[inputs] = _summed(structure, given, "actuators.force_max", default=np.inf)[inputs]
    return limits


def _summed(structure: Structure, values, key: str, default: float | None = None) -> np.ndarray:
    """Values of tendons; tendons merged side by side add up."""
    return np.array([parts.sum() for parts in by_part(structure.tendon_labels, values, key, default)])


def _common(structure: Structure, values, key: str) -> np.ndarray:
    """Values of tendons; tendons merged side by side must have the same."""
    parts = by_part(structure.tendon_labels, values, key)
    for label, numbers in zip(structure.tendon_labels, parts, strict=True):
        if np.ptp(numbers) > 0:
            raise StructureError(
                f"{key}: {label} is one tendon made of several side by side, which need one value, "
                f"not {', '.join(f'{number:g}' for number in numbers)}."
            )
    return np.array([numbers[0] for numbers in parts])


def _coefficient_or_ratio(given: T | Ratio) -> tuple[T | float, float | None]:
    """The coefficient and no ratio, or no coefficient yet and the ratio."""
    return (0.0, given.ratio) if isinstance(given, Ratio) else (given, None)


def _rest_lengths(scene: Scene, structure: Structure) -> np.ndarray:
    tendons = scene.tendons
    if tendons.rest_length is not None:
        return _common(structure, tendons.rest_length, "tendons.rest_length")
    if tendons.rest_ratio is None:
        raise StructureError("tendons have neither rest_ratio nor rest_length; give one of them.")
    ratio = _common(structure, tendons.rest_ratio, "tendons.rest_ratio")
    rest = ratio * structure.tendon_lengths
    if not (rest > 0).all():
        label = structure.tendon_labels[int((rest <= 0).argmax())]
        raise StructureError(
            f"tendon {label} joins two nodes at the same place, so rest_ratio gives it rest length 0; "
            "give its rest_length in m."
        )
    return rest


def _gravity(scene: Scene, structure: Structure) -> np.ndarray:
    if scene.gravity is None:
        return np.zeros(3)
    g = scene.gravity.g
    if isinstance(g, float | int):
        return np.array([0.0, -g, 0.0] if structure.planar else [0.0, 0.0, -g])
    return _in_plane(structure, g, "gravity.g")


def _in_plane(structure: Structure, vector: Sequence[float], key: str) -> np.ndarray:
    """A vector of the scene, refused where it leads out of a planar structure."""
    if structure.planar and vector[2] != 0:
        raise StructureError(
            f"{key} is {list(vector)}; a planar structure has no third direction, so give 0 as its third component."
        )
    return np.array(vector, float)


def _forces(scene: Scene, structure: Structure, mass: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    forces = np.zeros_like(structure.nodes)
    for pattern, force in (scene.loads or {}).items():
        at = matches(structure.node_labels, pattern, "loads")
        forces[at] += _in_plane(structure, force, f"loads.{pattern}")
    return forces + nodal_weight(structure, mass, gravity)


def nodal_weight(
    structure: Structure, mass: Float[np.ndarray, " rods"], gravity: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, "nodes 3"]:
    """Weight of the rods on their nodes, half on each end, N."""
    weight = np.zeros_like(structure.nodes)
    np.add.at(weight, structure.rods, 0.5 * mass[:, None, None] * gravity)
    return weight


def _pushed(scene: Scene, structure: Structure) -> np.ndarray:
    asked = scene.simulation
    loads = () if asked is None else [(kind, load) for kind in _LOADS for load in getattr(asked, kind)]
    for kind, load in loads:
        _in_plane(structure, load.force, f"the force of simulation.{kind} on {load.node}")
    nodes = [matches(structure.node_labels, load.node, f"simulation.{kind}.node") for kind, load in loads]
    return np.unique(np.array([i for found in nodes for i in found], int))
