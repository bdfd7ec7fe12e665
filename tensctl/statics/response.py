"""Static response: how nodes and tensions follow slow changes of rest lengths and loads.

    [ H      a M R ] [ xi ]   [ G du + J'dw ]
    [ a R'M    0   ] [ mu ] = [      0      ]

H is the Hessian on the rods' manifold, G the pull of a shortening, R the rigid-body motions that the energy does not
see, square in the mass metric; a = |H| balances the border. The border keeps xi clear of rigid-body motion and takes
up, as inertia does, whatever part of a load would carry a free structure away.

Errors are about `condition` * 1e-16 of the response: the influence grows without bound where the lowest stiffness goes
to zero, and is refused where nothing of it would be left.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from jaxtyping import Float

from tensctl.elements import CableTerms, PotentialPoint, length_map, unit_vectors
from tensctl.errors import EquilibriumError
from tensctl.statics.equilibrium import Equilibrium
from tensctl.statics.rigid import RigidMotions, unseen_motions

Form = Literal["dense", "sparse"]

# Dense is faster for all columns up to here and takes 70 MB; for a handful of columns sparse is, from about 700 on
# (one core, docs/prestress.md).
_SPARSE_FROM = 3000
# Beyond this condition number no digit of the response is left.
_HOPELESS = 1e15
_BALANCES = 1e-9


@dataclass(frozen=True, eq=False)
class StaticResponse:
    """The factored stiffness of an equilibrium; every question is one more column.

    Attributes
    ----------
    equilibrium : Equilibrium
    form : "dense" or "sparse"
        How the bordered matrix is factored; both give the same answer to rounding.
    """

    equilibrium: Equilibrium
    form: Form

    @cached_property
    def free_motions(self) -> RigidMotions:
        """Rigid-body motions that no stiffness holds; responses have no part of them."""
        return unseen_motions(self.equilibrium.potential, self.equilibrium.nodes)

    @cached_property
    def condition(self) -> float:
        """Estimate of the bordered matrix's condition number in the 1-norm."""
        size = self._matrix.shape[0]
        if not size:
            return 1.0
        if not np.isfinite(self._backward(np.ones(size))).all():
            return np.inf
        inverse = spla.LinearOperator((size, size), matvec=self._backward, rmatvec=self._backward, dtype=float)
        return float(spla.onenormest(inverse) * abs(self._matrix).sum(axis=0).max())

    def solve(self, forces: Float[np.ndarray, "size k"]) -> Float[np.ndarray, "size k"]:
        """Tangent coordinates, m, under forces in tangent coordinates, N.

        Raises
        ------
        EquilibriumError
            Where a motion has no stiffness.
        """
        if not self.condition < _HOPELESS:
            raise EquilibriumError(
                f"the equilibrium has a motion without stiffness (condition {self.condition:.0e}), so its static "
                "response has no bound; raise the prestress or hold the motion by a pin or a tendon."
            )
        right = np.vstack([forces, np.zeros((len(self.free_motions.names), forces.shape[1]))])
        return self._backward(right)[: len(forces)]

    @cached_property
    def _matrix(self) -> sp.csc_array:
        rest = self.equilibrium
        hessian = sp.csc_array(rest.point.hessian)
        mass = rest.potential.manifold.mass(rest.potential.members.mass)
        border = mass[:, None] * self.free_motions.basis
        size = abs(hessian).sum(axis=0).max(initial=0.0) if hessian.shape[0] else 0.0
        border *= (size or 1.0) / (np.abs(border).sum(axis=0).max(initial=0.0) or 1.0)
        if not border.shape[1]:
            return hessian
        edge = sp.csc_array(border)
        return sp.csc_array(sp.block_array([[hessian, edge], [edge.T, None]]))

    @cached_property
    def _backward(self) -> Callable[[np.ndarray], np.ndarray]:
        """Solve with the factored matrix; infinities where a pivot is zero."""
        if self.form == "sparse":
            try:
                # The order of A'A, which is the default, would fill in wherever two rows share the border's columns.
                return spla.splu(sp.csc_matrix(self._matrix), permc_spec="MMD_AT_PLUS_A").solve
            except RuntimeError:  # SuperLU's word for an exactly singular matrix
                return lambda right: np.full_like(right, np.inf)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sla.LinAlgWarning)
            factor = sla.lu_factor(self._matrix.toarray())
        if not np.diag(factor[0]).all():
            return lambda right: np.full_like(right, np.inf)
        return lambda right: sla.lu_solve(factor, right, check_finite=False)


def static_response(equilibrium: Equilibrium, form: Form | None = None) -> StaticResponse:
    """The static response of an equilibrium; `form` is chosen by size when it is not given."""
    chosen: Form = "sparse" if equilibrium.potential.manifold.size >= _SPARSE_FROM else "dense"
    return StaticResponse(equilibrium, chosen if form is None else form)


def static_influence(
    equilibrium: Equilibrium, tendons: np.ndarray | None = None, *, form: Form | None = None
) -> Float[np.ndarray, "size inputs"]:
    """Tangent coordinates per unit of rest-length shortening, m/m.

    Parameters
    ----------
    tendons : indices, optional
        Each by itself; by default one column for each input u, which is a tendon or a gang.
    form : "dense" or "sparse", optional

    Raises
    ------
    EquilibriumError
        Where a motion has no stiffness.
    """
    members, pulls = equilibrium.potential.members, equilibrium.point.input_map
    asked = pulls[:, members.inputs] @ members.gearing.matrix if tendons is None else pulls[:, np.asarray(tendons, int)]
    return static_response(equilibrium, form).solve(asked.toarray())


def rest_length_influence(
    equilibrium: Equilibrium, tendons: np.ndarray | None = None, *, form: Form | None = None
) -> Float[np.ndarray, "nodes 3 inputs"]:
    """d(nodes)/d(rest length), m/m: for constant k and constant EA alike, the law is the scene's.

    A longer rest length is a negative shortening: this is -J times `static_influence`.
    """
    moved = -(equilibrium.point.tangent @ static_influence(equilibrium, tendons, form=form))
    return moved.reshape(len(equilibrium.nodes), 3, -1)


def tension_influence(
    equilibrium: Equilibrium, reach: Float[np.ndarray, "size inputs"] | None = None
) -> Float[np.ndarray, "tendons inputs"]:
    """Tension of every tendon per unit of rest-length shortening of the acting ones, N/m, at rest.

    At an unloaded equilibrium one direction of u changes the prestress only: it is in this map, not in the motion.
    """
    reach = static_influence(equilibrium) if reach is None else reach
    slope, through = _slopes(equilibrium.point)
    result = slope[:, None] * (stretch_map(equilibrium) @ reach)
    members = equilibrium.potential.members
    result[members.inputs, members.gearing.motor] += members.gearing.ratio * through[members.inputs]
    return result


def stretch_map(equilibrium: Equilibrium) -> sp.csr_array:
    """Growth of each tendon's length per tangent coordinate, (nt, size)."""
    return sp.csr_array(length_map(equilibrium.structure, equilibrium.nodes) @ equilibrium.point.tangent)


def _slopes(point: PotentialPoint) -> tuple[Float[np.ndarray, " tendons"], Float[np.ndarray, " tendons"]]:
    """Growth of each tension with its length and with the shortening of its rest length, N/m."""
    terms = point.terms
    if isinstance(terms, CableTerms):
        return terms.slopes, terms.through
    unit, _ = unit_vectors(point.potential.structure, point.nodes)
    return np.einsum("ti,tij,tj->t", unit, terms.blocks, unit), np.einsum("ti,ti->t", unit, terms.shortening)


def compliance(
    equilibrium: Equilibrium, components: np.ndarray | None = None, *, form: Form | None = None
) -> Float[np.ndarray, "coordinates columns"]:
    """Static compliance d(nodes)/d(load), (3N, columns), m/N.

    Symmetric over all components. On a free structure a single nodal force is balanced by the inertia of the rods, so
    the columns tell how the shape gives way, not where the structure goes.

    Parameters
    ----------
    components : indices into the 3N node components, optional
        Loaded components, all by default; a sparse factor answers a few columns of a large structure cheaply.
    """
    tangent = equilibrium.point.tangent
    at = np.arange(tangent.shape[0]) if components is None else np.asarray(components, int)
    return tangent @ static_response(equilibrium, form).solve(tangent[at].toarray().T)


def displacement_under(
    equilibrium: Equilibrium, loads: Float[np.ndarray, "nodes 3"], *, form: Form | None = None
) -> Float[np.ndarray, "nodes 3"]:
    """First-order displacement of the nodes under a small additional load, m.

    Raises
    ------
    EquilibriumError
        For a load that does not balance on a free structure, or where a motion has no stiffness.
    """
    loads = np.asarray(loads, float)
    if loads.shape != equilibrium.nodes.shape:
        raise EquilibriumError(
            f"loads have shape {loads.shape}; one force a node is expected, {equilibrium.nodes.shape}."
        )
    response, tangent = static_response(equilibrium, form), equilibrium.point.tangent
    force = tangent.T @ loads.ravel()
    motions = response.free_motions
    size = np.linalg.norm(motions.basis, axis=0) * np.linalg.norm(force)
    work = np.abs(motions.basis.T @ force)
    if (work > _BALANCES * size).any():
        name = motions.names[int(np.argmax(work / np.where(size > 0, size, 1.0)))]
        raise EquilibriumError(
            f"the load moves the free structure along {name}, which nothing holds; balance the load or pin nodes."
        )
    return (tangent @ response.solve(force[:, None])).reshape(-1, 3)
