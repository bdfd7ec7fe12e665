"""Every shape that given coefficients hold, as a linear function of free vectors ([W] Theorem 21, (75), (76)).

    p = P' Q [z_d; z_e] + p_w,   Q = [[V_Y2, 0], [L V_Y2, U2]]

z_d has rho_B - rank Y rows and z_e n_p - rho_B - rho_2 (one a connected piece: a translation); the print gives rho_B
and n_p - rho_B. (76) prints I_3 where V_Y2 belongs, and P for P'. p_w is the load's own part, absent in [W].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import StructureError
from tensctl.statics.algebra.bars import BarCondition
from tensctl.statics.algebra.loads import LoadTerms
from tensctl.statics.algebra.strings import StringForces
from tensctl.statics.algebra.transformation import Transformation


@dataclass(frozen=True, eq=False)
class Shapes:
    """q = Q [z_d; z_e] + q_w and p = P' q.

    Attributes
    ----------
    transformation : Transformation
    Q : (n_p, free)
    q_w : (n_p, d) m
        Particular solution under load; zero without.
    free_bars, free_places : int
        Rows of z_d and of z_e.
    """

    transformation: Transformation
    Q: np.ndarray
    q_w: Float[np.ndarray, "nodes d"]
    free_bars: int
    free_places: int

    def coordinates(self, z_d: np.ndarray, z_e: np.ndarray) -> Float[np.ndarray, "nodes d"]:
        """Transformed nodes q = [q1; q2], m.

        Raises
        ------
        StructureError
            Free vectors of another shape.
        """
        d = self.q_w.shape[1]
        for name, z, rows in (("z_d", z_d, self.free_bars), ("z_e", z_e, self.free_places)):
            if z.shape != (rows, d):
                raise StructureError(f"{name} has shape {z.shape}; these coefficients leave {(rows, d)} free, in m.")
        return self.Q @ np.vstack([z_d, z_e]) + self.q_w

    def nearest(self, nodes: Float[np.ndarray, "nodes d"]) -> tuple[np.ndarray, np.ndarray]:
        """The z_d and z_e whose shape is nearest to wanted nodes, m, in the sum of squares.

        Raises
        ------
        StructureError
            Nodes of another shape.
        """
        nodes = np.asarray(nodes, float)
        if nodes.shape != self.q_w.shape:
            raise StructureError(f"the wanted nodes have shape {nodes.shape}; {self.q_w.shape} is expected, in m.")
        basis = self.transformation.nodes(self.Q)
        z = np.linalg.lstsq(basis, nodes - self.transformation.nodes(self.q_w), rcond=None)[0]
        return z[: self.free_bars], z[self.free_bars :]


def theorem21(
    transformation: Transformation,
    forces: StringForces,
    condition: BarCondition,
    terms: LoadTerms | None = None,
    *,
    d: int = 3,
) -> Shapes:
    """All shapes at given coefficients in d dimensions, under the loads of `terms` if there are any."""
    V_Y2, U2 = condition.V_Y2, forces.space.U2
    free_bars, free_places = V_Y2.shape[1], U2.shape[1]
    Q = np.block([[V_Y2, np.zeros((len(V_Y2), free_places))], [forces.L @ V_Y2, U2]])
    q_w = np.zeros((len(transformation.P), d))
    if terms is not None:
        q1 = condition.pinv(terms.G @ terms.w)
        q_w = np.vstack([q1, forces.L @ q1 + terms.places @ terms.w])
    return Shapes(transformation, Q, q_w, free_bars, free_places)
