"""The two planar examples of [S] Appendix A: one rod, and a tensegrity of two rods and four tendons.

Example 1   [q1''; q2''] = BlockDiag[0, -|q2'|^2/L^2 I] q + BlockDiag[I, -q2~^2] [g1; g2]
            g1 = (2/m) (f1 + f2),   g2 = (6/(m L^2)) (f2 - f1)
Example 2   t1 = P2 - P3, t2 = P1 - P3, t3 = P4 - P1, t5 = P4 - P2;   l^0 = (rho, r1, r2, t5),   l^d = (t1, t2, t3)

In Example 1 the dots of q2' are lost in the scan; its g2 is the negative of (A.14)'s, and so is its matrix.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.model.shell_equations.blocks import times_identity
from tensctl.model.shell_equations.coordinates import NODES_FROM_Q
from tensctl.model.shell_equations.element_blocks import SUM_DIFFERENCE
from tensctl.model.shell_equations.rods import H_matrix, K_r_matrix, skew_square
from tensctl.model.shell_equations.tendon_forces import TendonForces, tendon_forces

# Heads (+1) and tails (-1) of t1, t2, t3 and of t5 among P1..P4, by inspection of Fig. 14.
_DEPENDENT_ENDS = np.array([[0, 1, -1, 0], [1, 0, -1, 0], [-1, 0, 0, 1]])
_INDEPENDENT_ENDS = np.array([[0, -1, 0, 1]])


def example1(
    q: Float[np.ndarray, " 4"],
    v: Float[np.ndarray, " 4"],
    f1: Float[np.ndarray, " 2"],
    f2: Float[np.ndarray, " 2"],
    mass: float,
    length: float,
) -> Float[np.ndarray, " 4"]:
    """Acceleration (q1'', q2''), m/s^2, of one rod in the plane with forces f1, f2 (N) on its ends (Example 1)."""
    q2, v2 = q[2:], v[2:]
    g1, g2 = 2 / mass * (f1 + f2), 6 / (mass * length**2) * (f2 - f1)
    across = -skew_square(q2[None])[0]
    return np.concatenate([g1, -(v2 @ v2) / length**2 * q2 + across @ g2])


@dataclass(frozen=True, eq=False)
class PlanarTensegrity:
    """Example 2: q = (q1, q2, q3, q4) in the plane, u = (u1, u2, u3, u5), w the forces on P1..P4.

    Attributes
    ----------
    mass : (2,) kg
        [S] prints one m for both rods.
    stiffness, rest_lengths : (4,) N/m, m
        Of t1, t2, t3, t5.
    """

    mass: Float[np.ndarray, " 2"]
    stiffness: Float[np.ndarray, " 4"]
    rest_lengths: Float[np.ndarray, " 4"]

    @cached_property
    def Bd(self) -> Float[np.ndarray, "8 6"]:
        """B^d of (A.20)."""
        return times_identity(-SUM_DIFFERENCE @ _DEPENDENT_ENDS.T, 2)

    @cached_property
    def B0(self) -> Float[np.ndarray, "8 2"]:
        """B^0 of (A.20)."""
        return times_identity(-SUM_DIFFERENCE @ _INDEPENDENT_ENDS.T, 2)

    @cached_property
    def W_1(self) -> Float[np.ndarray, "8 8"]:
        """W_1 of (A.20)."""
        return times_identity(SUM_DIFFERENCE, 2)

    @cached_property
    def Q(self) -> Float[np.ndarray, "8 8"]:
        """Q of (A.21): q = Q l^0."""
        return times_identity(np.array([[2, 1, 0, 0], [0, 1, 0, 0], [2, 2, -1, 2], [0, 0, 1, 0]]), 2)

    @cached_property
    def Q_inverse(self) -> Float[np.ndarray, "8 8"]:
        """Q^-1, printed after (A.22)."""
        return times_identity(np.array([[1, -1, 0, 0], [0, 2, 0, 0], [0, 0, 0, 2], [-1, -1, 1, 1]]) / 2, 2)

    @cached_property
    def R(self) -> Float[np.ndarray, "6 8"]:
        """R of l^d = R q, after (A.22)."""
        return times_identity(_DEPENDENT_ENDS @ NODES_FROM_Q, 2)

    def forces_d(self, q: Float[np.ndarray, " 8"], u: Float[np.ndarray, " 4"]) -> TendonForces:
        """f^d = -K^d q + P^d u^d."""
        return tendon_forces(sparse.csr_array(self.R), q, u[:3], self.stiffness[:3], self.rest_lengths[:3])

    def forces_0(self, q: Float[np.ndarray, " 8"], u: Float[np.ndarray, " 4"]) -> TendonForces:
        """f^0 = -K^0 q + P^0 u^0; t5 is the last vector of l^0."""
        return tendon_forces(sparse.csr_array(self.Q_inverse[-2:]), q, u[3:], self.stiffness[3:], self.rest_lengths[3:])

    def acceleration(
        self,
        q: Float[np.ndarray, " 8"],
        v: Float[np.ndarray, " 8"],
        u: Float[np.ndarray, " 4"],
        w: Float[np.ndarray, " 8"],
    ) -> Float[np.ndarray, " 8"]:
        """Accelerations q'' = -(K_r + K_p) q + B u + D w, m/s^2, with actual |q2| (Example 2)."""
        d, o = self.forces_d(q, u), self.forces_0(q, u)
        K_tilde = self.Bd @ d.K + self.B0 @ o.K
        B_tilde = np.hstack([self.Bd @ d.P, self.B0 @ o.P])
        f = -K_tilde @ q + B_tilde @ u + self.W_1 @ w
        return H_matrix(q, self.mass, d=2) @ f - K_r_matrix(q, v, d=2) @ q
