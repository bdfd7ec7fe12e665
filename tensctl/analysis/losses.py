"""What is lost when a tendon is cut, or its motor jams.

    cut:    the tendon is gone; the structure looks for a new rest from the old one, and is judged there
    jammed: the tendon stays as it is and its motor is no input any more, with all that the motor pulls

A table over all tendons. Where the equilibrium is cyclically symmetric, and inputs and dampers with it, one tendon of
each orbit is solved and stands for all: 8 solves instead of 24 at (3,1). The output that suffers is named for that one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from tensctl.analysis.measures import moved_outputs, static_outputs
from tensctl.analysis.modal import controllability
from tensctl.analysis.reach import Reach
from tensctl.elements import JointedManifold, Potential, RodManifold
from tensctl.errors import TensctlError
from tensctl.linear import LinearModel, best_fit, linearize
from tensctl.model import Dynamics
from tensctl.statics import Equilibrium, find_symmetry, settle
from tensctl.structure.gearing import Gearing

Rest = Literal["stable", "unstable", "undecided", "nothing taut", "none found"]
_WORDS: dict[str, Rest] = {"yes": "stable", "no": "unstable", "undecided": "undecided", "no prestress": "nothing taut"}


@dataclass(frozen=True)
class Loss:
    """What the loss of one tendon, and of each that is its image, takes away.

    Attributes
    ----------
    tendons : tuple of str
        The tendon that was looked at first, then its images.
    rest : "stable", "unstable", "undecided", "nothing taut" or "none found"
        Where the structure rests without it.
    moved : float, m
        Largest displacement of a node when it is cut; of a free structure within its own frame.
    slack : int
        Other tendons that then carry nothing.
    frequency : float, Hz
        Lowest flexible frequency then.
    driven_cut, driven_jammed : (int, int)
        Modes that are still driven, of how many flexible ones; (0, 0) where a cut leaves no linear model.
    held_cut, held_jammed : int
        Rank of static reach.
    worst : (str, float)
        When it jams: the output whose static reach suffers most, and what is left of it, 0 to 1.
    note : str
        Why something could not be judged.
    """

    tendons: tuple[str, ...]
    rest: Rest
    moved: float = np.nan
    slack: int = 0
    frequency: float = 0.0
    driven_cut: tuple[int, int] = (0, 0)
    driven_jammed: tuple[int, int] = (0, 0)
    held_cut: int = 0
    held_jammed: int = 0
    worst: tuple[str, float] = ("", np.nan)
    note: str = ""


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Losses of all tendons between nodes that can move.

    Attributes
    ----------
    linear : LinearModel
    losses : tuple of Loss
    """

    linear: LinearModel
    losses: tuple[Loss, ...]

    @property
    def vital(self) -> tuple[str, ...]:
        """Tendons without which no stable rest was found."""
        return tuple(label for loss in self.losses if loss.rest != "stable" for label in loss.tendons)

    def __str__(self) -> str:
        """One line an orbit."""
        from tensctl.analysis.words import aligned

        lines = [["tendons", "cut: rests", "moves [m]", "slack", "f [Hz]", "driven", "held", "jammed: driven", "held",
                  "weakest output, what is left"]]  # fmt: skip
        for loss in self.losses:
            cut, jam = loss.driven_cut, loss.driven_jammed
            first, *others = loss.tendons
            more = f" and {len(others)} like it" if others else ""
            gone = cut == (0, 0)
            lines.append([
                first + more, loss.rest, f"{loss.moved:.3g}", str(loss.slack), f"{loss.frequency:.4g}",
                "-" if gone else f"{cut[0]} of {cut[1]}", "-" if gone else str(loss.held_cut),
                f"{jam[0]} of {jam[1]}" if jam != (0, 0) else "no input", str(loss.held_jammed),
                f"{loss.worst[0]} {100 * loss.worst[1]:.0f} %" if loss.worst[0] else loss.note,
            ])  # fmt: skip
        return "what is lost without a tendon\n" + aligned(lines)


def redundancy(linear: LinearModel) -> Redundancy:
    """Cut each tendon, and jam each motor, one at a time."""
    return Redundancy(linear, tuple(_loss(linear, orbit) for orbit in orbits(linear)))


def orbits(linear: LinearModel) -> list[np.ndarray]:
    """Tendons in groups of images of each other; one by one without symmetry. Between pins nothing is lost."""
    rest, dynamics = linear.equilibrium, linear.dynamics
    moving = ~rest.structure.grounded_tendons
    found = find_symmetry(rest.potential, rest.nodes, rest.rest_lengths)
    kept = None if found is None else found.tendons
    if kept is not None:
        alike = (dynamics.members.actuated, dynamics.damping)
        if not dynamics.members.gearing.plain or any((values[kept] != values[kept[0]]).any() for values in alike):
            kept = None
    if kept is None:
        return [np.array([t]) for t in np.flatnonzero(moving)]
    return sorted((orbit for orbit in kept.T if moving[orbit[0]]), key=lambda orbit: int(orbit[0]))


def without(linear: LinearModel, tendon: int) -> Equilibrium:
    """The rest that is found when a tendon is cut, from where it was.

    Raises
    ------
    EquilibriumError
        When none is found.
    """
    rest = linear.equilibrium
    potential = _cut(rest, tendon)
    return settle(potential, start=rest.nodes, symmetric=False)


def _cut(rest: Equilibrium, tendon: int) -> Potential:
    """The potential without a tendon; the others keep the rest lengths that they have."""
    structure, members = rest.structure, rest.potential.members
    kept = np.flatnonzero(np.arange(len(structure.tendons)) != tendon)
    smaller = replace(
        structure,
        tendons=structure.tendons[kept],
        tendon_labels=tuple(structure.tendon_labels[t] for t in kept),
        vias=tuple(structure.vias[t] for t in kept) if structure.vias else (),
    )
    acting = members.inputs != tendon
    fewer = replace(
        members,
        **{name: getattr(members, name)[kept] for name in ("stiffness", "floors", "damping", "actuated", "force_max")},
        rest_lengths=rest.rest_lengths[kept],
        inputs=np.flatnonzero(np.isin(kept, members.inputs)),
        gearing=_fewer(members.gearing, acting),
    )
    if isinstance(rest.potential.manifold, JointedManifold):
        return Potential(smaller, fewer, JointedManifold.of(smaller, fewer.mass))
    return Potential(smaller, fewer, RodManifold.of(smaller))


def _fewer(gearing: Gearing, kept: np.ndarray) -> Gearing:
    """The motors of some of the acting tendons."""
    motors, motor = np.unique(gearing.motor[kept], return_inverse=True)
    return Gearing(motor, gearing.ratio[kept], tuple(gearing.labels[k] for k in motors))


def _loss(linear: LinearModel, orbit: np.ndarray) -> Loss:
    tendon, labels = int(orbit[0]), linear.dynamics.structure.tendon_labels
    jammed = _jammed(linear, tendon)
    loss = replace(jammed, tendons=tuple(labels[t] for t in orbit))
    try:
        rest = without(linear, tendon)
    except TensctlError as error:
        return replace(loss, rest="none found", note=str(error))
    moving = ~rest.structure.grounded_tendons
    loss = replace(
        loss,
        rest=_WORDS[str(rest.stable)],
        moved=_moved(linear.equilibrium, rest),
        slack=int(((rest.tensions <= 0) | rest.point.at_ease)[moving].sum()),
    )
    try:
        model = _linear_without(linear, rest, tendon)
    except TensctlError as error:
        return replace(loss, note=str(error))
    frequencies = [mode.frequency for mode in model.modes if mode.kind == "flexible"]
    return replace(
        loss,
        frequency=min(frequencies, default=0.0),
        driven_cut=_driven(model),
        held_cut=Reach(model).rank,
    )


def _linear_without(linear: LinearModel, rest: Equilibrium, tendon: int) -> LinearModel:
    damping = np.delete(linear.dynamics.damping, tendon)
    dynamics = Dynamics(rest.potential, damping, linear.dynamics.drag, linear.dynamics.clamped)
    return linearize(dynamics, rest, outputs=())


def _jammed(linear: LinearModel, tendon: int) -> Loss:
    """Without its motor: the same equilibrium, one input less."""
    members = linear.dynamics.members
    motor = members.gearing.motor[members.inputs == tendon]
    acting = ~np.isin(members.gearing.motor, motor)
    jammed = replace(members, inputs=members.inputs[acting], gearing=_fewer(members.gearing, acting))
    potential = replace(linear.equilibrium.potential, members=jammed)
    rest = replace(linear.equilibrium, potential=potential)
    dynamics = Dynamics(potential, linear.dynamics.damping, linear.dynamics.drag, linear.dynamics.clamped)
    model = linearize(dynamics, rest, outputs=())
    columns = np.delete(np.arange(members.gearing.size), motor)
    return Loss(
        tendons=(),
        rest="stable",
        driven_jammed=_driven(model) if acting.any() else (0, 0),
        held_jammed=Reach(model).rank,
        worst=_worst(linear, columns) if motor.size else ("", np.nan),
        note="" if motor.size else "no actuator",
    )


def _driven(model: LinearModel) -> tuple[int, int]:
    modes = [mode for mode in controllability(model).modes if mode.kind != "rigid-body"]
    return sum(mode.verdict == "yes" for mode in modes), len(modes)


def _worst(linear: LinearModel, left: np.ndarray) -> tuple[str, float]:
    """The output whose reach, the norm of its row per sqrt(energy), loses most."""
    shown = moved_outputs(linear)
    if not shown:
        return "", np.nan
    reach: Float[np.ndarray, "ny nu"] = static_outputs(linear)
    before = np.linalg.norm(reach, axis=1)
    kept = before > 1e-9 * before.max(initial=0.0)
    part = np.where(kept, np.linalg.norm(reach[:, left], axis=1) / np.where(kept, before, 1.0), np.inf)
    k = int(part.argmin())
    return linear.outputs[shown[k]], float(part[k])


def _moved(before: Equilibrium, after: Equilibrium) -> float:
    nodes = after.nodes
    if not before.structure.held.any():
        nodes = best_fit(before.potential, before.nodes, nodes, np.zeros_like(nodes)).nodes(nodes)
    return float(np.linalg.norm(nodes - before.nodes, axis=1).max())
