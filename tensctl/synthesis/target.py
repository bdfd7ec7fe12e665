"""What is wanted of a shape: numbers that its nodes have, each with its gradient.

height   mean z of the top ring's P4 less mean z of the base ring's P1
tip      mean x, mean y of the top ring less those of the base ring
twist    atan2(sum a x b, sum a . b) of the top ring less that of the base ring, a at rest and b now, seen along z,
         a from the ring's centre: the turn that brings the ring at rest nearest to the ring now
tilt     how far the top ring's normal leans towards x and y (`synthesis.tilt`)
nodes    single coordinates
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from jaxtyping import Bool, Float

from tensctl.errors import SynthesisError
from tensctl.scene import TargetStage, WantedShape
from tensctl.structure import Structure
from tensctl.synthesis.tilt import Tilt, area_vector

if TYPE_CHECKING:
    from tensctl.scene import Scene

# A coordinate is where it is wanted when it is off by less than this part of the largest.
_ROUNDING = 1e-9
_NODE = re.compile(r"P([1-4])_(\d+)_(\d+)")


class Feature(Protocol):
    """A number that a shape has, how it is called, and the metres that one unit of it moves a node."""

    @property
    def name(self) -> str:
        """Name and unit, as in "height, m"."""
        ...

    @property
    def lever(self) -> float:
        """Metres per unit."""
        ...

    def of(self, nodes: np.ndarray) -> float:
        """Value at the given nodes."""
        ...

    def slope(self, nodes: np.ndarray) -> np.ndarray:
        """Gradient at the given nodes, (N, 3)."""
        ...


def levers(features: tuple[Feature, ...]) -> Float[np.ndarray, " k"]:
    """Metres per unit of each."""
    return np.array([feature.lever for feature in features])


@dataclass(frozen=True, eq=False)
class Linear:
    """A linear function of the nodes, in metres: height, sideways place of the tip, one coordinate.

    Attributes
    ----------
    name : str
    gradient : (N, 3)
    """

    name: str
    gradient: Float[np.ndarray, "nodes 3"]
    lever: float = 1.0

    def of(self, nodes: Float[np.ndarray, "nodes 3"]) -> float:
        """Value at the given nodes, m."""
        return float((self.gradient * nodes).sum())

    def slope(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """The same everywhere."""
        return self.gradient


@dataclass(frozen=True, eq=False)
class Twist:
    """Turn of the top ring about z against the base ring, since rest, rad, from -2 pi to 2 pi.

    Attributes
    ----------
    base, top : (N, 3) m
        Places of each ring's nodes from its centre at rest, seen along z; zero at other nodes.
    """

    base: Float[np.ndarray, "nodes 3"]
    top: Float[np.ndarray, "nodes 3"]
    name: str = "twist, rad"

    @property
    def lever(self) -> float:
        """Radius of the top ring, m."""
        return float(np.linalg.norm(self.top, axis=1).max())

    def of(self, nodes: Float[np.ndarray, "nodes 3"]) -> float:
        """Value at the given nodes, rad."""
        return _turn(self.top, nodes)[0] - _turn(self.base, nodes)[0]

    def slope(self, nodes: Float[np.ndarray, "nodes 3"]) -> Float[np.ndarray, "nodes 3"]:
        """Gradient, rad/m."""
        return _turn(self.top, nodes)[1] - _turn(self.base, nodes)[1]


def _turn(rest: np.ndarray, nodes: np.ndarray) -> tuple[float, np.ndarray]:
    """Angle and gradient; places at rest sum to zero, so that the centre of the ring now drops out."""
    across = np.stack([-rest[:, 1], rest[:, 0], np.zeros(len(rest))], axis=1)
    sine, cosine = float((across * nodes).sum()), float((rest * nodes).sum())
    return float(np.arctan2(sine, cosine)), (cosine * across - sine * rest) / (sine**2 + cosine**2)


def shell_rings(structure: Structure) -> tuple[Bool[np.ndarray, " nodes"], Bool[np.ndarray, " nodes"]] | None:
    """Nodes P1 of the first stage and P4 of the last, or None when nodes are not labelled as a shell's."""
    found = [_NODE.fullmatch(label) for label in structure.node_labels]
    stages = [int(match[3]) for match in found if match]
    base = np.array([bool(match) and match[1] == "1" and match[3] == "1" for match in found])
    top = np.array([bool(match) and match[1] == "4" and int(match[3]) == max(stages) for match in found])
    return (base, top) if base.any() and top.any() else None


def shell_height(structure: Structure) -> Linear:
    """Height from P1 of the first stage to P4 of the last, along z.

    Raises
    ------
    SynthesisError
        When the nodes are not labelled as a shell's.
    """
    return _between_rings(structure, 2, "height_scale", "height, m")


def features_of(wanted: WantedShape, structure: Structure, nodes: np.ndarray) -> list[tuple[Feature, float]]:
    """Every feature that a target names, and its value in the end, for a path that begins at the given nodes.

    Raises
    ------
    SynthesisError
        A feature that this structure does not have.
    """
    found: list[tuple[Feature, float]] = []
    if wanted.height_scale is not None:
        height = shell_height(structure)
        found.append((height, _standing(height.of(nodes)) * wanted.height_scale))
    if wanted.twist is not None:
        base, top = _rings(structure, "twist")
        twist = Twist(_from_centre(nodes, base), _from_centre(nodes, top))
        found.append((twist, wanted.twist))
    for key in ("tip", "tilt", "nodes"):
        if getattr(wanted, key) is not None and not structure.held.any():
            raise SynthesisError(f"target.{key} needs pins: this structure is free, so its place is not its shape.")
    for axis, by in enumerate(wanted.tip or ()):
        sideways = _between_rings(structure, axis, "tip", f"tip {'xy'[axis]}, m")
        found.append((sideways, sideways.of(nodes) + by))
    found += [(_tilt(structure, nodes, axis), angle) for axis, angle in enumerate(wanted.tilt or ())]
    for label, place in (wanted.nodes or {}).items():
        found += _place(structure, nodes, label, place)
    return found


def _place(
    structure: Structure, nodes: np.ndarray, label: str, place: tuple[float, float, float]
) -> list[tuple[Feature, float]]:
    """Coordinates of a node, save those in which the ground holds it, and which are where they are wanted."""
    if label not in structure.node_labels:
        raise SynthesisError(f"target.nodes names {label}, which is no node of this structure.")
    node = structure.node_labels.index(label)
    held = ~structure.free[node]
    away = held & (np.abs(nodes[node] - place) > _ROUNDING * np.abs(nodes).max())
    if away.any() or held.all():
        along = " and ".join(axis for axis, is_held in zip("xyz", held, strict=True) if is_held)
        where = ", ".join(f"{value:.4g}" for value in nodes[node])
        raise SynthesisError(
            f"target.nodes wants {label} at [{', '.join(f'{value:g}' for value in place)}], but the ground holds it "
            f"along {along} at [{where}]; name a node that can move there, or leave it out."
        )
    return [(_coordinate(structure, label, int(axis)), place[axis]) for axis in np.flatnonzero(~held)]


def _coordinate(structure: Structure, label: str, axis: int) -> Linear:
    gradient = np.zeros_like(structure.nodes)
    gradient[structure.node_labels.index(label), axis] = 1.0
    return Linear(f"{label} {'xyz'[axis]}, m", gradient)


def _between_rings(structure: Structure, axis: int, key: str, name: str) -> Linear:
    base, top = _rings(structure, key)
    gradient = np.zeros_like(structure.nodes)
    gradient[base, axis] -= 1 / base.sum()
    gradient[top, axis] += 1 / top.sum()
    return Linear(name, gradient)


def _rings(structure: Structure, key: str) -> tuple[np.ndarray, np.ndarray]:
    rings = shell_rings(structure)
    if rings is None:
        raise SynthesisError(
            f"target.{key} needs a shell with base nodes P1_i_1 and top nodes P4_i_m; this structure has none."
        )
    return rings


def _tilt(structure: Structure, nodes: np.ndarray, axis: int) -> Tilt:
    _, top = _rings(structure, "tilt")
    ring = np.flatnonzero(top)
    if area_vector(nodes[ring])[2] < 0:
        ring = ring[::-1]
    return Tilt(ring, axis, float(np.linalg.norm(_from_centre(nodes, top), axis=1).max()))


def _from_centre(nodes: np.ndarray, ring: np.ndarray) -> np.ndarray:
    places = np.zeros_like(nodes)
    places[ring, :2] = nodes[ring, :2] - nodes[ring, :2].mean(axis=0)
    return places


def _standing(height: float) -> float:
    if not height > 0:
        raise SynthesisError(
            f"the structure hangs below its base (height {height:.4g} m), so it cannot stand taller or lower; "
            "stiffen the tendons, or lower gravity and loads."
        )
    return height


def wanted_target(scene: Scene, asked: float | Mapping[str, object] | TargetStage | None) -> TargetStage:
    """The target of a call, or the scene's own, checked as a scene's `[target]` is.

    Raises
    ------
    SceneError
        A key or value that `[target]` would refuse.
    SynthesisError
        When neither the call nor the scene names a target.
    """
    if asked is None:
        if scene.target is None:
            raise SynthesisError("no target is given: add [target] height_scale to the scene, or pass target=1.2.")
        return scene.target
    if isinstance(asked, TargetStage):
        return asked
    if isinstance(asked, Mapping):
        return TargetStage.checked(**{str(key): value for key, value in asked.items()})
    timing = {} if scene.target is None else {"start": scene.target.start, "duration": scene.target.duration}
    return TargetStage.checked(height_scale=asked, **timing)
