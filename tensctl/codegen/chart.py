"""What C needs to see the state of the linear model in measured nodes and velocities.

    x = (s Phi' M xi, Phi' M xi'),   xi = log(reference, nodes) rod by rod

the great-circle chart of `RodManifold`. Where rods share nodes its coordinates are projected square to the mass metric;
a free structure is first turned back by the best fit of its mass. Both are linear maps and rods' tables here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tensctl.codegen.literals import Table, number
from tensctl.elements import Hold, JointedManifold, RodManifold
from tensctl.errors import OutputError
from tensctl.linear import LinearModel
from tensctl.statics import mass_centre


@dataclass(frozen=True, eq=False)
class ChartTables:
    """Tables of the chart about an equilibrium.

    Attributes
    ----------
    suffix : str
        Of the names of its tables.
    nodes : int
    size : int
        Coordinates of all rods.
    states : int
        Of the motion.
    dimension : int
        3, or 2 in a plane.
    rods : tuple of str
        One C initialiser a moving rod: ends, whether it is free, direction, frames, centre, lever, length.
    pieces : tuple of str
        One C initialiser a rod of a free structure: ends, mass, centre and vector at the reference.
    tables : tuple of Table
    """

    suffix: str
    nodes: int
    size: int
    states: int
    dimension: int
    rods: tuple[str, ...]
    pieces: tuple[str, ...]
    tables: tuple[Table, ...]


def chart_tables(linear: LinearModel, suffix: str = "") -> ChartTables:
    """Tables of a flexible model's chart, with names that end in the suffix.

    Raises
    ------
    OutputError
        For a free structure with drag, whose rigid-body rates are states too.
    """
    if linear.drifting:
        raise OutputError(
            "a free structure with drag has rigid-body rates among its states, which the C source does not measure; "
            "pin the structure or leave drag out of the model that the controller is designed on."
        )
    nodes, structure = linear.equilibrium.nodes, linear.dynamics.structure
    manifold = linear.equilibrium.potential.manifold
    ends, end_node = _ends(manifold)
    position, rate = _maps(linear)
    tables = (
        Table(f"chart_position{suffix}", position, "positions s eta of the modes from the rods' coordinates, 1/s"),
        Table(f"chart_rate{suffix}", rate, "rates eta' of the modes from the rates of the rods' coordinates"),
    )
    pieces: tuple[str, ...] = ()
    if not structure.held.any():
        centre = mass_centre(linear.equilibrium.potential, nodes)
        tables += (Table(f"reference_centre{suffix}", centre, "centre of mass at the reference, m"),)
        pieces = _pieces(linear, nodes - centre)
    rods = tuple(_rod(ends, end_node, nodes[end_node], r) for r in ends.moving.tolist())
    return ChartTables(
        suffix, len(nodes), ends.size, len(linear.mechanics.states), ends.dimension, rods, pieces, tables
    )


def _ends(manifold: RodManifold | JointedManifold) -> tuple[RodManifold, np.ndarray]:
    """Rods with two ends of their own, and the node of each end."""
    if isinstance(manifold, RodManifold):
        return manifold, np.arange(manifold.node_count)
    return manifold.ends, manifold.end_node


def _maps(linear: LinearModel) -> tuple[np.ndarray, np.ndarray]:
    """From the rods' coordinates to s eta and from their rates to eta', (modes, size) each."""
    manifold, nodes = linear.equilibrium.potential.manifold, linear.equilibrium.nodes
    rate = linear.shapes.T * manifold.mass(linear.dynamics.members.mass)
    if isinstance(manifold, JointedManifold):
        rate = rate @ (manifold.basis(nodes).toarray().T / manifold.weights)
    return linear.scales[:, None] * rate, rate


def _rod(ends: RodManifold, end_node: np.ndarray, nodes: np.ndarray, r: int) -> str:
    """Initialiser of `struct rod`."""
    tail, head = ends.rods[r].tolist()
    free = ends.hold[r] == Hold.FREE
    middle = 0.5 * (nodes[tail] + nodes[head])
    across = ", ".join(_vector(axis) for axis in ends.frames(nodes)[r])
    return (
        f"{{{end_node[tail]}, {end_node[head]}, {int(free)}, {_vector(ends.directions(nodes)[r])}, {{{across}}}, "
        f"{_vector(middle)}, {number(ends.lever[r])}, {number(ends.lengths[r])}}}"
    )


def _pieces(linear: LinearModel, reference: np.ndarray) -> tuple[str, ...]:
    """Initialisers of `struct piece`: what the best fit of the mass needs of each rod."""
    found = []
    for (tail, head), mass in zip(linear.dynamics.structure.rods.tolist(), linear.dynamics.members.mass, strict=True):
        middle, vector = 0.5 * (reference[tail] + reference[head]), reference[head] - reference[tail]
        found.append(f"{{{tail}, {head}, {number(mass)}, {_vector(middle)}, {_vector(vector)}}}")
    return tuple(found)


def _vector(values: np.ndarray) -> str:
    return "{" + ", ".join(number(value) for value in values) + "}"
