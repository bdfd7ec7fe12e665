"""The equations of motion of the shell class in the letters of [S] ((5.13)-(5.16), (5.21)-(5.23)).

    q'' + (K_r(q') + K_p(q)) q = B(q) u + D(q) w                                                             (5.21)
    f = -K~ q + B~ T u + W^0 w,   K~ = B^d K^d + B^0 K^0,   B~ = [B^d P^d, B^0 P^0]                    (5.13)-(5.15)
    K_p = H K~,   B = H B~ T,   D = H W^0

Every matrix is sparse. K_p and B depend on u too, because a slack tendon has k = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.errors import StructureError
from tensctl.model.shell_equations.coordinates import P_matrix
from tensctl.model.shell_equations.dependent import R_matrix, independent_rows
from tensctl.model.shell_equations.inputs import T_matrix, absent
from tensctl.model.shell_equations.layout import all_members, input_members, original
from tensctl.model.shell_equations.node_forces import B_0, W_0, B_d
from tensctl.model.shell_equations.rods import H_matrix, K_r_matrix
from tensctl.model.shell_equations.tendon_forces import TendonForces, tendon_forces
from tensctl.structure import Members, Structure, build_members, build_structure, shell

if TYPE_CHECKING:
    from tensctl.scene import Scene


@dataclass(frozen=True, eq=False)
class ShellEquations:
    """A Class 1 shell, free in space, in the letters of [S].

    q and v stack (q1, q2, q3, q4) of each element, u the tendons in the order of `input_labels`, w the forces on
    P1..P4 of each element. q and w are in the order of the project's own model, u is not: `inputs` takes it over.

    Attributes
    ----------
    n, m : int
    primal : bool
        t9 and t10 are left out.
    mass : (2nm,) kg
    stiffness, rest_lengths : (10nm + 1,) N/m, m
        k and L0 in the order of u~ (5.16); k = 0 for tendons that a primal shell has not.
    loads : (12nm,) N
        The scene's constant loads and weights; part of w.
    """

    n: int
    m: int
    primal: bool
    mass: Float[np.ndarray, " rods"]
    stiffness: Float[np.ndarray, " members"]
    rest_lengths: Float[np.ndarray, " members"]
    loads: Float[np.ndarray, " w"]

    @classmethod
    def of(cls, scene: Scene) -> ShellEquations:
        """The equations of a scene.

        Raises
        ------
        StructureError
            A scene that [S] does not cover: no Class 1 shell, or one with pins, EA, dampers or drag.
        """
        structure = build_structure(scene)
        members = build_members(scene, structure)
        n, m, primal = _size_of(structure)
        _require_covered(structure, members)
        place = {label: t for t, label in enumerate(structure.tendon_labels)}
        # Tendons that a primal shell has not get no stiffness and any rest length.
        here = [place.get(original(member, m).label, -1) for member in all_members(n, m)]
        return cls(
            n=n,
            m=m,
            primal=primal,
            mass=members.mass,
            stiffness=np.where(absent(n, m) & primal, 0.0, members.stiffness[here]),
            rest_lengths=members.rest_lengths[here],
            loads=members.forces.ravel(),
        )

    @property
    def input_labels(self) -> tuple[str, ...]:
        """Labels of the tendons in the order of u (5.16)."""
        return tuple(member.label for member in input_members(self.n, self.m, primal=self.primal))

    def inputs(self, by_tendon: Float[np.ndarray, " tendons"]) -> Float[np.ndarray, " u"]:
        """Inputs u (5.16) from one number a tendon in the structure's order (by stage, element, number)."""
        order = input_members(self.n, self.m, primal=self.primal)
        back = {member: k for k, member in enumerate(sorted(order, key=lambda t: (t.j, t.i, t.alpha)))}
        return np.asarray(by_tendon)[[back[member] for member in order]]

    @cached_property
    def Bd(self) -> sparse.csr_array:
        """B^d (2.15)."""
        return B_d(self.n, self.m)

    @cached_property
    def B0(self) -> sparse.csr_array:
        """B^0 (2.15)."""
        return B_0(self.n, self.m)

    @cached_property
    def W0(self) -> sparse.csr_array:
        """W^0 (2.15)."""
        return W_0(self.n, self.m)

    @cached_property
    def R(self) -> sparse.csr_array:
        """R (4.17)."""
        return R_matrix(self.n, self.m)

    @cached_property
    def R_independent(self) -> sparse.csr_array:
        """t5 and t1 of each element from q: rows of Q^-1 and R_0."""
        return independent_rows(self.n, self.m)

    @cached_property
    def T(self) -> sparse.csr_array:
        """T (5.17)."""
        return T_matrix(self.n, self.m, primal=self.primal)

    @cached_property
    def P(self) -> sparse.csr_array:
        """P (4.6)."""
        return P_matrix(self.n, self.m)

    def forces_d(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"]) -> TendonForces:
        """f^d = -K^d q + P^d u^d (5.11)."""
        count = 8 * self.n * self.m + 1
        return tendon_forces(self.R, q, (self.T @ u)[:count], self.stiffness[:count], self.rest_lengths[:count])

    def forces_0(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"]) -> TendonForces:
        """f^0 = -K^0 q + P^0 u^0 (5.12)."""
        count = 8 * self.n * self.m + 1
        own, rest = self.stiffness[count:], self.rest_lengths[count:]
        return tendon_forces(self.R_independent, q, (self.T @ u)[count:], own, rest)

    def K_tilde(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"]) -> sparse.csr_array:
        """K~ = B^d K^d + B^0 K^0, (12nm, 12nm) N/m (5.15)."""
        return sparse.csr_array(self.Bd @ self.forces_d(q, u).K + self.B0 @ self.forces_0(q, u).K)

    def B_tilde(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"]) -> sparse.csr_array:
        """B~ = [B^d P^d, B^0 P^0], (12nm, 10nm + 1) N/m (5.15)."""
        parts = [self.Bd @ self.forces_d(q, u).P, self.B0 @ self.forces_0(q, u).P]
        return sparse.csr_array(sparse.hstack(parts, format="csr"))

    def nodal_forces(
        self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"], w: Float[np.ndarray, " w"]
    ) -> Float[np.ndarray, " q"]:
        """The vector f of (5.14), N: sums and differences of the end forces of each rod."""
        return self.B_tilde(q, u) @ (self.T @ u) - self.K_tilde(q, u) @ q + self.W0 @ w

    def H(self, q: Float[np.ndarray, " q"], lengths: Float[np.ndarray, " rods"] | None = None) -> sparse.csr_array:
        """H (3.4), 1/kg; `lengths` gives the nominal L of [S] in place of the actual |q2|."""
        return H_matrix(q, self.mass, lengths)

    def K_r(self, q: Float[np.ndarray, " q"], v: Float[np.ndarray, " q"], lengths=None) -> sparse.dia_array:
        """K_r (3.4), 1/s^2."""
        return K_r_matrix(q, v, lengths)

    def K_p(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"], lengths=None) -> sparse.csr_array:
        """K_p = H K~, 1/s^2 (5.21)."""
        return sparse.csr_array(self.H(q, lengths) @ self.K_tilde(q, u))

    def B(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"], lengths=None) -> sparse.csr_array:
        """B = H B~ T, 1/s^2 (5.21)."""
        return sparse.csr_array(self.H(q, lengths) @ self.B_tilde(q, u) @ self.T)

    def D(self, q: Float[np.ndarray, " q"], lengths=None) -> sparse.csr_array:
        """D = H W^0, 1/kg (5.21)."""
        return sparse.csr_array(self.H(q, lengths) @ self.W0)

    def acceleration(
        self,
        q: Float[np.ndarray, " q"],
        v: Float[np.ndarray, " q"],
        u: Float[np.ndarray, " u"],
        w: Float[np.ndarray, " w"],
        lengths: Float[np.ndarray, " rods"] | None = None,
    ) -> Float[np.ndarray, " q"]:
        """Accelerations q'' = -(K_r + K_p) q + B u + D w, m/s^2 (5.21); w holds the loads too."""
        return -(self.K_r(q, v, lengths) @ q) - self.static_residual(q, u, w, lengths)

    def static_residual(self, q, u, w, lengths=None) -> Float[np.ndarray, " q"]:
        """K_p q - B u - D w, m/s^2 (5.23): zero where the shell rests."""
        return self.K_p(q, u, lengths) @ q - self.B(q, u, lengths) @ u - self.D(q, lengths) @ w

    def y_p(self, q: Float[np.ndarray, " q"], C: sparse.csr_array | np.ndarray | None = None) -> np.ndarray:
        """C P q, m: all nodes, or the outputs that C chooses (5.22)."""
        p = self.P @ q
        return p if C is None else C @ p

    def y_l(self, q: Float[np.ndarray, " q"]) -> Float[np.ndarray, " u"]:
        """Tendon lengths in the order of u, m (after 5.22)."""
        none = np.zeros(self.T.shape[1])
        lengths = np.concatenate([self.forces_d(q, none).lengths, self.forces_0(q, none).lengths])
        return lengths[self._first_copies]

    def y_f(self, q: Float[np.ndarray, " q"], u: Float[np.ndarray, " u"]) -> Float[np.ndarray, " u"]:
        """Tensions in the order of u, N (after 5.22), never negative: the printed form leaves the slack case to k."""
        count, expanded = 8 * self.n * self.m + 1, self.T @ u
        d, o = self.forces_d(q, u), self.forces_0(q, u)
        return np.concatenate([d.tensions(expanded[:count]), o.tensions(expanded[count:])])[self._first_copies]

    @cached_property
    def _first_copies(self) -> np.ndarray:
        place = {member: row for row, member in reversed(list(enumerate(all_members(self.n, self.m))))}
        return np.array([place[t] for t in input_members(self.n, self.m, primal=self.primal)])


def _size_of(structure: Structure) -> tuple[int, int, bool]:
    """(n, m, primal) of a structure with the connection of a Class 1 shell, wherever its nodes are."""
    last = structure.node_labels[-1].split("_")
    if len(last) == 3 and last[1].isdecimal() and last[2].isdecimal():
        n, m = int(last[1]), int(last[2])
        for primal in (False, True) if n >= 3 and m >= 1 else ():
            wanted = shell(n, m, primal=primal)
            if _same_connection(structure, wanted):
                return n, m, primal
    raise StructureError(
        "the structure is no Class 1 shell with nodes, rods and tendons in the order of tc.shell(n, m); "
        "[S]'s equations hold for that: give kind = shell with class = 1, or the nodes of one."
    )


def _same_connection(structure: Structure, wanted: Structure) -> bool:
    labels = structure.node_labels == wanted.node_labels and structure.tendon_labels == wanted.tendon_labels
    ends = np.array_equal(structure.rods, wanted.rods) and np.array_equal(structure.segments, wanted.segments)
    return labels and ends


def _require_covered(structure: Structure, members: Members) -> None:
    if structure.held.any():
        raise StructureError("the shell has pins; [S]'s equations hold for a free shell: leave pins out.")
    if members.law != "k":
        raise StructureError("tendons have EA; [S] has a constant stiffness k: give stiffness instead.")
    if members.damped:
        raise StructureError("tendons or rods are damped; [S]'s equations have no damping: leave it out.")
