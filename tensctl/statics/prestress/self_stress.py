"""Self-stresses and mechanisms at given nodes: the null spaces of the equilibrium matrix.

    A [T; c] = 0,   A'v = 0 with v square to the rigid-body motions R,   states - mechanisms = members - free + rigid

One singular value decomposition of Q'A gives both, Q the complement of R: rigid-body motions, which are known, neither
blur the decision nor count as mechanisms (Pellegrino and Calladine 1986, doi 10.1016/0020-7683(86)90014-4).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from tensctl.errors import EquilibriumError
from tensctl.statics.algebra.rank_decision import RankDecision
from tensctl.statics.prestress.matrix import EquilibriumMatrix, equilibrium_matrix
from tensctl.statics.prestress.rank import Subspaces, subspaces
from tensctl.statics.prestress.rigid_fields import rigid_fields
from tensctl.structure import Structure


@dataclass(frozen=True, eq=False)
class SelfStress:
    """Self-stress basis and inextensional mechanisms of a structure at given nodes.

    Members whose both ends are on the ground take no part: their rows of the bases are zero.

    Attributes
    ----------
    structure : Structure
    nodes : (N, 3) m
    tendon_basis, rod_basis : (nt, s), (nr, s)
        Self-stresses in columns, orthonormal as [T; c]: tension in tendons, compression in rods; each with the sign
        that makes its tendons pull more than they push.
    mechanisms : (k, N, 3)
        Motions that lengthen no rod and no tendon at first order, orthonormal, square to rigid-body motions.
    rigid : (r, N, 3)
        Rigid-body motions that the pins allow, orthonormal.
    spaces : Subspaces
        Singular values and rank of the matrix without rigid-body motions.
    """

    structure: Structure
    nodes: Float[np.ndarray, "nodes 3"]
    tendon_basis: Float[np.ndarray, "tendons s"]
    rod_basis: Float[np.ndarray, "rods s"]
    mechanisms: Float[np.ndarray, "k nodes 3"]
    rigid: Float[np.ndarray, "r nodes 3"]
    spaces: Subspaces

    @property
    def decision(self) -> RankDecision:
        """Rank of the equilibrium matrix, the gap it was read from, and whether double precision decides it."""
        return self.spaces.decision

    @property
    def states(self) -> int:
        """Number of independent self-stresses s."""
        return self.tendon_basis.shape[1]

    @property
    def mechanism_count(self) -> int:
        """Number of independent mechanisms k, rigid-body motions not among them."""
        return len(self.mechanisms)

    @cached_property
    def matrix(self) -> EquilibriumMatrix:
        """The equilibrium matrix, made again from structure and nodes."""
        return equilibrium_matrix(self.structure, self.nodes)

    @property
    def imbalance(self) -> float:
        """Largest nodal force that a self-stress of the basis leaves over; each has norm one."""
        left = self.matrix.tendons @ self.tendon_basis + self.matrix.rods @ self.rod_basis
        return float(np.abs(left).max(initial=0.0))

    @property
    def lengthening(self) -> float:
        """Largest first-order lengthening of a member by a mechanism or rigid-body motion of norm one."""
        motions = np.concatenate([self.mechanisms, self.rigid]).reshape(-1, self.nodes.size)
        return float(np.abs(self.matrix.full.T @ motions[:, self.matrix.free].T).max(initial=0.0))

    def verify(self, tol: float = 1e-10) -> None:
        """Check balance, inextension, orthonormality and Maxwell's count from the inputs alone.

        `tol` is the largest imbalance and lengthening allowed; a basis that was counted with a looser `rank_tol` meets
        only that.

        Raises
        ------
        EquilibriumError
            With the first check that fails and its number.
        """
        basis = np.vstack([self.tendon_basis, self.rod_basis])
        motions = np.concatenate([self.mechanisms, self.rigid]).reshape(-1, self.nodes.size)
        checks = {
            "a self-stress leaves a nodal force of": self.imbalance,
            "a mechanism lengthens a member by": self.lengthening,
            "the self-stresses are orthonormal only to": _deviation(basis.T @ basis),
            "the mechanisms are orthonormal only to": _deviation(motions @ motions.T),
            "Maxwell's count is wrong by": float(abs(self._maxwell())),
        }
        for text, value in checks.items():
            if not value <= tol:
                raise EquilibriumError(f"{text} {value:.1e}; at most {tol:.0e} is expected.")

    def _maxwell(self) -> int:
        members = int(self.matrix.acting_tendons.sum() + self.matrix.acting_rods.sum())
        return self.states - self.mechanism_count - members + self.matrix.free.size - len(self.rigid)


def self_stress(
    structure: Structure, nodes: Float[np.ndarray, "nodes 3"] | None = None, *, rank_tol: float | None = None
) -> SelfStress:
    """Self-stresses and mechanisms of a structure at given nodes.

    Dense: for more than about a thousand members ask `admissible_prestress` instead, which needs no basis.

    Parameters
    ----------
    nodes : (N, 3) m, optional
        The structure's own by default.
    rank_tol : float, optional
        Counts singular values up to this part of the largest as zero, for nodes that are themselves rounded.

    Raises
    ------
    EquilibriumError
        For nodes of the wrong shape, or a member whose ends coincide.
    """
    matrix = equilibrium_matrix(structure, nodes)
    fields = rigid_fields(matrix.nodes, structure.pinned)
    complement = np.linalg.qr(fields[matrix.free], mode="complete")[0][:, fields.shape[1] :]
    acting = np.concatenate([matrix.acting_tendons, matrix.acting_rods])
    spaces = subspaces(complement.T @ matrix.full[:, np.flatnonzero(acting)].toarray(), rank_tol=rank_tol)
    basis = np.zeros((acting.size, spaces.null.shape[1]))
    basis[acting] = spaces.null
    count = len(structure.tendons)
    basis *= np.where(basis[:count].sum(axis=0) < 0, -1.0, 1.0)
    motion = np.zeros((matrix.nodes.size, spaces.left_null.shape[1]))
    motion[matrix.free] = complement @ spaces.left_null
    return SelfStress(
        structure=structure,
        nodes=matrix.nodes,
        tendon_basis=basis[:count],
        rod_basis=basis[count:],
        mechanisms=motion.T.reshape(-1, *matrix.nodes.shape),
        rigid=fields.T.reshape(-1, *matrix.nodes.shape),
        spaces=spaces,
    )


def rod_motions(structure: Structure, nodes: Float[np.ndarray, "nodes 3"] | None = None) -> Subspaces:
    """Motions of the free node components that lengthen no rod at first order, rigid-body motions included.

    `.left_null` is an orthonormal basis of them, (free, dof); `.decision` says how surely the rods' equations are
    independent of each other. Pins on the ground and rods that share nodes are all the same to it.
    """
    return subspaces(equilibrium_matrix(structure, nodes).rods.toarray())


def _deviation(gram: np.ndarray) -> float:
    return float(np.abs(gram - np.eye(len(gram))).max(initial=0.0))
