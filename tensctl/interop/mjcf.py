"""The structure with its materials as MuJoCo MJCF, undamped to rounding the same mechanics.

    rod     body along its own z, inertia diag(J, J, J/1000), J = m L^2/12 about the centre; m L^2/3 about a pin
    tendon  spatial tendon with springlength "0 L0": k (l - L0) while l > L0, nothing while slack; cables alike

MuJoCo wants an inertia about the rod's axis, which [S] Theorem 3.1 does not have. A thousandth of J is that of a round
bar 77 times as long as its radius. Whatever it is, it moves no node: every force acts on the axis, so nothing turns the
rod about it, a spin that starts at zero stays zero, and the gyroscopic terms, all proportional to it, vanish.

What MuJoCo has otherwise: its tendon damper also acts on slack tendons and can push, where tensctl's carries nothing;
damped models agree as long as every damped tendon is taut and pulls. Its constraints are springs, neither joints nor
guides, so structures whose rods share a moving node, guided and planar ones are refused.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as Xml

import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold
from tensctl.errors import OutputError, StructureError
from tensctl.model import Dynamics, build_dynamics
from tensctl.statics import find_equilibrium
from tensctl.structure import Structure, nodal_weight, refuse_partial

if TYPE_CHECKING:
    from tensctl.scene import Scene

# Inertia about a rod's axis over that across. A free choice; a smaller one magnifies the rounding of torques into spin.
_SPIN_INERTIA = 1e-3
# Radius over length of the round bar that has this inertia: 6 (r/L)^2 = 1e-3.
_RADIUS = (_SPIN_INERTIA / 6) ** 0.5
# The site in whose axes forces on nodes are given.
_FRAME = "ground axes"


def write_mjcf(scene: Scene, path: str | Path) -> Path:
    """Write a scene's structure as a MuJoCo model.

    Nodes become sites, rods bodies and tendons spatial tendons, all under their own labels. Nodes with loads, drag or
    pushes get an actuator an axis, `P1_1_1.x` and so on: its control is a further force on the node, N. The model
    starts at the scene's initial nodes; where the scene asks for its equilibrium, a keyframe of that name holds it.

    Raises
    ------
    StructureError
        A structure that has no model of motion.
    OutputError
        When the file cannot be written.
    """
    path = Path(path)
    rest = None if scene.equilibrium is None else find_equilibrium(scene).nodes
    text = mjcf(build_dynamics(scene), title=scene.title, equilibrium=rest)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from None
    return path


def mjcf(dynamics: Dynamics, *, title: str = "", equilibrium: Float[np.ndarray, "nodes 3"] | None = None) -> str:
    """The MJCF text of a structure with its materials, numbers exact to the last bit.

    Raises
    ------
    StructureError
        A structure with joints or guides, or in a plane.
    """
    structure, members = dynamics.structure, dynamics.members
    _check_untied(structure)
    root = Xml.Element("mujoco", model=title or "tensctl")
    Xml.SubElement(root, "compiler", angle="radian", inertiafromgeom="false")
    # Contacts off: rods are lines, which pass through each other as they do in tensctl.
    option = Xml.SubElement(root, "option", gravity=_text(members.gravity), timestep="0.001", integrator="RK4")
    Xml.SubElement(option, "flag", contact="disable")
    world = Xml.SubElement(root, "worldbody")
    _add_ground(world, structure)
    for rod in range(len(structure.rods)):
        _add_rod(world, dynamics, rod)
    _add_tendons(root, dynamics)
    _add_forces(root, world, dynamics)
    if equilibrium is not None:
        place, _ = mujoco_state(dynamics, equilibrium, np.zeros_like(equilibrium))
        Xml.SubElement(Xml.SubElement(root, "keyframe"), "key", name="equilibrium", qpos=_text(place))
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode") + "\n"


def mujoco_state(
    dynamics: Dynamics, nodes: Float[np.ndarray, "nodes 3"], velocities: Float[np.ndarray, "nodes 3"]
) -> tuple[Float[np.ndarray, " nq"], Float[np.ndarray, " nv"]]:
    """MuJoCo's qpos and qvel of a state: centre and quaternion of each free rod, quaternion of each rod on a pin.

    A ball joint counts from where the structure's own nodes have the rod, a free joint from nowhere. Angular velocities
    are in the rod's own frame, as MuJoCo has them, without spin about the axis.
    """
    hold, rods = dynamics.potential.manifold.hold, dynamics.structure.rods
    place, speed = [np.zeros(0)], [np.zeros(0)]
    for kind, (a, b), first in zip(hold, rods, dynamics.structure.rod_vectors, strict=True):
        if kind == Hold.FIXED:
            continue
        vector, rate = nodes[b] - nodes[a], velocities[b] - velocities[a]
        turn = _turn(vector)
        if kind == Hold.FREE:
            place.append(0.5 * (nodes[a] + nodes[b]))
            speed.append(0.5 * (velocities[a] + velocities[b]))
        place.append(turn if kind == Hold.FREE else _since(_turn(first), turn))
        speed.append(_matrix(turn).T @ np.cross(vector, rate) / (vector @ vector))
    return np.concatenate(place), np.concatenate(speed)


def _check_untied(structure: Structure) -> None:
    refuse_partial(structure, "MuJoCo holds single directions by springs only", "pin whole nodes of a network")
    if structure.jointed:
        raise StructureError(
            "rods of this structure share a node that moves, and MuJoCo joins bodies by springs only; "
            "give each rod nodes of its own."
        )


def _add_ground(world: Xml.Element, structure: Structure) -> None:
    for node in np.flatnonzero(structure.pinned):
        Xml.SubElement(world, "site", name=structure.node_labels[node], pos=_text(structure.nodes[node]))


def _add_rod(world: Xml.Element, dynamics: Dynamics, rod: int) -> None:
    structure, kernel = dynamics.structure, dynamics.kernel
    (tail, head), hold, length = structure.rods[rod], Hold(kernel.hold[rod]), float(kernel.lengths[rod])
    if hold == Hold.FIXED:
        ends = _text(structure.nodes[[tail, head]].ravel())
        _add_bar(world, structure.rod_labels[rod], ends, length)
        return
    # Along the body's z: where the ends are, seen from the centre of a free rod or from the pin of a held one.
    low, high = {Hold.FREE: (-0.5, 0.5), Hold.TAIL: (0.0, 1.0), Hold.HEAD: (-1.0, 0.0)}[hold]
    start, stop = structure.nodes[tail], structure.nodes[head]
    origin = {Hold.FREE: 0.5 * (start + stop), Hold.TAIL: start, Hold.HEAD: stop}[hold]
    turn = _text(_turn(structure.rod_vectors[rod]))
    body = Xml.SubElement(world, "body", name=structure.rod_labels[rod], pos=_text(origin), quat=turn)
    label = structure.rod_labels[rod]
    Xml.SubElement(body, "joint", name=label, type="free" if hold == Hold.FREE else "ball")
    mass = float(dynamics.members.mass[rod])
    across = mass * length**2 / 12
    inertia = _text([across, across, _SPIN_INERTIA * across])
    middle = _text([0, 0, 0.5 * (low + high) * length])
    Xml.SubElement(body, "inertial", pos=middle, mass=_text(mass), diaginertia=inertia)
    _add_bar(body, structure.rod_labels[rod], _text([0, 0, low * length, 0, 0, high * length]), length)
    for node, place in ((tail, low), (head, high)):
        if not structure.pinned[node]:
            Xml.SubElement(body, "site", name=structure.node_labels[node], pos=_text([0, 0, place * length]))


def _add_bar(parent: Xml.Element, label: str, ends: str, length: float) -> None:
    """What is seen of a rod; it has no mass and touches nothing."""
    Xml.SubElement(
        parent, "geom", name=label, type="capsule", fromto=ends, size=_text(_RADIUS * length),
        contype="0", conaffinity="0", mass="0", rgba="0.15 0.2 0.25 1",
    )  # fmt: skip


def _add_tendons(root: Xml.Element, dynamics: Dynamics) -> None:
    structure, members = dynamics.structure, dynamics.members
    stiffness = members.stiffness if members.law == "k" else members.stiffness / members.rest_lengths
    parent, size = Xml.SubElement(root, "tendon"), float(np.ptp(structure.nodes, axis=0).max())
    for t, path in enumerate(structure.paths):
        numbers = {"springlength": _text([0.0, members.rest_lengths[t]]), "stiffness": _text(stiffness[t])}
        if dynamics.damping[t] > 0:
            numbers["damping"] = _text(dynamics.damping[t])
        tendon = Xml.SubElement(
            parent, "spatial", numbers, name=structure.tendon_labels[t], width=_text(_RADIUS * size / 4)
        )
        for node in path:
            Xml.SubElement(tendon, "site", site=structure.node_labels[node])


def _add_forces(root: Xml.Element, world: Xml.Element, dynamics: Dynamics) -> None:
    """Force `load - c v + control` along each axis on the nodes that have one of them."""
    structure, members = dynamics.structure, dynamics.members
    loads = members.forces - nodal_weight(structure, members.mass, members.gravity)
    pushed = np.isin(np.arange(len(loads)), members.pushed)
    nodes = np.flatnonzero((loads.any(axis=1) | pushed | (dynamics.drag > 0)) & ~structure.pinned)
    if not nodes.size:
        return
    Xml.SubElement(world, "site", name=_FRAME)
    parent = Xml.SubElement(root, "actuator")
    for node in nodes:
        for axis, name in enumerate("xyz"):
            label = structure.node_labels[node]
            gear = _text([*np.eye(3)[axis], 0, 0, 0])
            bias = _text([loads[node, axis], 0, -dynamics.drag])
            Xml.SubElement(
                parent, "general", name=f"{label}.{name}", site=label, refsite=_FRAME, gear=gear,
                biastype="affine", biasprm=bias,
            )  # fmt: skip


def _turn(vector: Float[np.ndarray, " 3"]) -> Float[np.ndarray, " 4"]:
    """The quaternion (w, x, y, z) that turns the z axis to a vector the shortest way."""
    x, y, z = vector / np.linalg.norm(vector)
    # Near -z the shortest way is ill conditioned: half a turn about x first, then the shortest way from there.
    turn = np.array([1 + z, -y, x, 0.0]) if z > -0.5 else np.array([-y, 1 - z, 0.0, x])
    return turn / np.linalg.norm(turn)


def _since(first: Float[np.ndarray, " 4"], turn: Float[np.ndarray, " 4"]) -> Float[np.ndarray, " 4"]:
    """What turns the first quaternion into the other: conj(first) times turn."""
    w, axis = first[0], first[1:]
    rest = w * turn[1:] - turn[0] * axis - np.cross(axis, turn[1:])
    return np.array([w * turn[0] + axis @ turn[1:], *rest])


def _matrix(turn: Float[np.ndarray, " 4"]) -> Float[np.ndarray, "3 3"]:
    """The rotation matrix of a unit quaternion."""
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _text(numbers: object) -> str:
    """Numbers that read back to the last bit."""
    return " ".join(repr(float(number)) for number in np.atleast_1d(np.asarray(numbers, float)))
