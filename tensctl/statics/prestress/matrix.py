"""The equilibrium matrix: what the axial force of each member does to each free node component ([W] section 3).

    A_t T + A_r c + w = 0

T is tension in tendons, c compression in rods, w the load on the node, all in N. A tendon with unit vector u from tail
to head pulls its tail with +T u and its head with -T u; a rod with unit vector e pushes its tail with -c e and its head
with +c e. By virtual work, a motion v lengthens tendons by -A_t'v and rods by A_r'v. Pins remove rows.

Entries are parts of unit vectors, each accurate to a few units in the last place of the nodes' own doubles, however
near or far the nodes are: coordinates are subtracted first, and a difference of doubles is rounded once.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int

from tensctl.errors import EquilibriumError
from tensctl.structure import Structure, refuse_cables, refuse_partial


@dataclass(frozen=True, eq=False)
class EquilibriumMatrix:
    """Equilibrium matrix of a structure at given nodes.

    Attributes
    ----------
    structure : Structure
    nodes : (N, 3) m
    """

    structure: Structure
    nodes: Float[np.ndarray, "nodes 3"]

    @cached_property
    def free(self) -> Int[np.ndarray, " free"]:
        """Node components that no pin holds, as indices into the 3N components."""
        return np.flatnonzero(np.repeat(~self.structure.pinned, 3))

    @cached_property
    def tendons(self) -> sp.csr_array:
        """A_t, (free, nt): forces on the nodes per unit of tension."""
        return self._columns(self.structure.tendons, self.tendon_directions)

    @cached_property
    def rods(self) -> sp.csr_array:
        """A_r, (free, nr): forces on the nodes per unit of compression."""
        return self._columns(self.structure.rods, -self.rod_directions)

    @cached_property
    def full(self) -> sp.csr_array:
        """[A_t, A_r], (free, nt + nr)."""
        return sp.csr_array(sp.hstack([self.tendons, self.rods]))

    @cached_property
    def tendon_directions(self) -> Float[np.ndarray, "tendons 3"]:
        """Unit vectors u from tail to head."""
        return self._directions(self.structure.tendons, self.structure.tendon_labels, "tendon")

    @cached_property
    def rod_directions(self) -> Float[np.ndarray, "rods 3"]:
        """Unit vectors e from tail to head."""
        return self._directions(self.structure.rods, self.structure.rod_labels, "rod")

    @cached_property
    def acting_tendons(self) -> Bool[np.ndarray, " tendons"]:
        """Tendons with at least one free end; the others may carry anything and move nothing."""
        return ~self.structure.grounded_tendons

    @cached_property
    def acting_rods(self) -> Bool[np.ndarray, " rods"]:
        """Rods with at least one free end."""
        return np.asarray(~self.structure.pinned[self.structure.rods].all(axis=1))

    def left_over(
        self,
        tensions: Float[np.ndarray, " tendons"],
        rod_forces: Float[np.ndarray, " rods"],
        loads: Float[np.ndarray, "nodes 3"],
    ) -> Float[np.ndarray, "nodes 3"]:
        """Force that is not balanced at each node, N; zero where the ground takes it."""
        left = np.zeros(self.nodes.size)
        left[self.free] = self.tendons @ tensions + self.rods @ rod_forces + loads.ravel()[self.free]
        return left.reshape(-1, 3)

    def _directions(self, members: np.ndarray, labels: tuple[str, ...], noun: str) -> np.ndarray:
        d = self.nodes[members[:, 1]] - self.nodes[members[:, 0]]
        length = np.linalg.norm(d, axis=1)
        if not (length > 0).all():
            label = labels[int((~(length > 0)).argmax())]
            raise EquilibriumError(
                f"{noun} {label} has length 0 m at these nodes, so its force has no direction; "
                "move its ends apart or leave it out."
            )
        return d / length[:, None]

    def _columns(self, members: np.ndarray, direction: np.ndarray) -> sp.csr_array:
        rows = 3 * members[:, :, None] + np.arange(3)
        columns = np.broadcast_to(np.arange(len(members))[:, None, None], rows.shape)
        values = np.stack([direction, -direction], axis=1)
        entries = (values.ravel(), (rows.ravel(), columns.ravel()))
        matrix = sp.coo_array(entries, shape=(self.nodes.size, len(members)))
        return sp.csr_array(sp.csr_array(matrix)[self.free])


def equilibrium_matrix(structure: Structure, nodes: Float[np.ndarray, "nodes 3"] | None = None) -> EquilibriumMatrix:
    """Equilibrium matrix at given nodes, or at the structure's own.

    Raises
    ------
    EquilibriumError
        For nodes of the wrong shape, or a member whose ends coincide.
    StructureError
        For a structure with cables or guides, or in a plane.
    """
    refuse_cables(structure, "prestress is found for tendons of two nodes only", "give each piece its own tendon")
    refuse_partial(structure, "prestress is found for whole pins in space only", "pin whole nodes of a network")
    nodes = structure.nodes if nodes is None else np.asarray(nodes, float)
    if nodes.shape != structure.nodes.shape or not np.isfinite(nodes).all():
        raise EquilibriumError(
            f"nodes of shape {nodes.shape} were given; finite coordinates of shape {structure.nodes.shape} are "
            "expected."
        )
    return EquilibriumMatrix(structure, nodes)
