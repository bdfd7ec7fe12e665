"""The linear model in second-order form, sparse, with no modes.

    M xi'' + C xi' + K xi = G u + W w,    y = P xi + V xi' + F u

xi are tangent coordinates of the rods' manifold (metres), M is diagonal and positive, K the Riemannian Hessian with the
rods' compression, C the taut dampers and drag. All of it has a few entries a row however large the structure is; where
rods share nodes or slide along guides, coordinates belong to chains of rods and rows have entries for whole chains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from tensctl.errors import LinearizationError
from tensctl.linear.outputs import OutputMap, safe_label
from tensctl.model import Dynamics, damping_matrix
from tensctl.statics import Equilibrium

# Second differences of the energy over this part of the rods' mean length are exact to about 1e-6 of themselves.
_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Sparse linear model about an equilibrium.

    Attributes
    ----------
    equilibrium : Equilibrium
    M, C, K : (size, size), kg, N s/m, N/m
    G : (size, nu), N/m
        Force per rest-length shortening u.
    W : (size, nw)
        Force per load on the chosen nodes, N.
    P, V, F : (ny, size), (ny, size), (ny, nu)
        Outputs from xi, xi' and u.
    inputs, disturbances, outputs : tuples of str
    """

    equilibrium: Equilibrium
    M: sp.csr_array
    C: sp.csr_array
    K: sp.csr_array
    G: sp.csr_array
    W: sp.csr_array
    P: sp.csr_array
    V: sp.csr_array
    F: sp.csr_array
    inputs: tuple[str, ...]
    disturbances: tuple[str, ...]
    outputs: tuple[str, ...]

    @property
    def size(self) -> int:
        """Degrees of freedom."""
        return self.M.shape[0]

    def verify(self, tol: float = 1e-5) -> None:
        """Check K against second differences of the energy along a step on the manifold.

        Raises
        ------
        LinearizationError
            With the misfit found.
        """
        potential, rest = self.equilibrium.potential, self.equilibrium.rest_lengths
        way = np.random.default_rng(0).standard_normal(self.size)
        step = _STEP * potential.structure.rod_lengths.mean() / max(np.abs(way).max(initial=0.0), 1e-300) * way
        moved = [potential.manifold.retract(self.equilibrium.nodes, sign * step) for sign in (1, -1)]
        bent = sum(potential.at(nodes, rest).energy for nodes in moved) - 2 * self.equilibrium.energy
        scale = abs(step) @ (abs(self.K) @ abs(step))
        misfit = abs(step @ (self.K @ step) - bent) / max(scale, 1e-300)
        if not misfit <= tol:
            raise LinearizationError(f"K misses the energy by {misfit:.1e} of its size; {tol:.0e} is expected.")


def second_order(dynamics: Dynamics, equilibrium: Equilibrium, outputs: OutputMap, loaded: np.ndarray) -> SecondOrder:
    """Assemble the sparse model.

    Parameters
    ----------
    loaded : node indices
        Nodes whose loads are disturbance inputs.
    """
    point, members, structure = equilibrium.point, dynamics.members, dynamics.structure
    size, axes = equilibrium.potential.manifold.size, np.arange(structure.dimension)
    damped = dynamics.damped
    C = damping_matrix(point, dynamics.damping, dynamics.drag) if damped else sp.csr_array((size, size))
    rows = (3 * np.asarray(loaded, int)[:, None] + axes).ravel()
    return SecondOrder(
        equilibrium=equilibrium,
        M=sp.csr_array(sp.diags_array(equilibrium.potential.manifold.mass(members.mass))),
        C=C,
        K=point.hessian,
        G=sp.csr_array(point.input_map[:, members.inputs] @ members.gearing.matrix),
        W=sp.csr_array(point.tangent[rows].T),
        P=outputs.position,
        V=outputs.rate,
        F=sp.csr_array(outputs.feedthrough[:, members.inputs] @ members.gearing.matrix),
        inputs=tuple(f"u_{safe_label(label)}" for label in dynamics.input_labels),
        disturbances=tuple(f"w_{safe_label(structure.node_labels[k])}_{'xyz'[i]}" for k in loaded for i in axes),
        outputs=outputs.labels,
    )
