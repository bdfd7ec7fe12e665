"""The construction of equilibria in five steps, as one call ([W] section 5).

    1  P, V_B1, S1, S2 from the network alone                       Theorem 11, Lemma 17
    2  X, Y from gamma and lambda, det Y = 0 unless loaded          Lemmas 18, 19
    3  q1 = V_Y2 z_d + Y^+ G w,   b = V_B1 q1                       (72), Theorem 22
    4  q2 = L q1 + U1 Sigma11^-1 V1' Gamma^-1 G1 w + U2 z_e,   p = P' [q1; q2]                       (75)
    5  t = V2 M^-1 V2' S1' q1 + G1 w,   s = Gamma^-1 t,   b = C_b' p,   f = Lambda b                 (77), (84)

[W] leaves the load terms of steps 3 and 4 out. Step 5 takes s from the forces and b from the nodes, so that (19), (23)
and b = V_B1 q1 are tests of the result, not identities. Dense in nodes and strings: some thousand of each.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from tensctl.errors import EquilibriumError, StructureError
from tensctl.statics.algebra.bars import BarCondition, lemma19
from tensctl.statics.algebra.configuration import Configuration, check_bar_lengths
from tensctl.statics.algebra.loads import LoadTerms, require_balance, require_reach, theorem22
from tensctl.statics.algebra.network import Network
from tensctl.statics.algebra.shape import Shapes, theorem21
from tensctl.statics.algebra.steps import FiveSteps
from tensctl.statics.algebra.strings import StringForces, lemma17, lemma18
from tensctl.statics.algebra.transformation import Transformation, theorem11


def five_steps(
    network: Network,
    gamma: Float[np.ndarray, " strings"] | float,
    lam: Float[np.ndarray, " bars"] | float,
    *,
    z_d: np.ndarray | None = None,
    z_e: np.ndarray | None = None,
    near: Float[np.ndarray, "nodes d"] | None = None,
    loads: Float[np.ndarray, "loads d"] | None = None,
    load_nodes: Int[np.ndarray, " loads"] | None = None,
    transformation: Transformation | None = None,
    rank_tol: float | None = None,
    d: int | None = None,
) -> FiveSteps:
    """Construct a structure in equilibrium from its network and force coefficients.

    Parameters
    ----------
    network : Network
    gamma, lam : (n_s,), (n_b,) or numbers, N/m
        Tension over length of each string, compression over length of each bar.
    z_d, z_e : m, optional
        Free vectors. By default z_d is the unit matrix without load and zero with it, z_e is zero.
    near : (n_p, d) m, optional
        Wanted nodes: z_d and z_e are then those of the nearest shape.
    loads : (n_w, d) N, optional
        Forces applied to nodes.
    load_nodes : (n_w,), optional
        Where they act; by default there is one load for every node.
    transformation : Transformation, optional
        Theorem 11's by default.
    rank_tol : float, optional
        Relative size below which an eigenvalue of Y counts as zero, for coefficients rounded on paper; the force
        residual of the result then grows to that size.
    d : 1, 2 or 3, optional
        Dimensions; those of the arrays given, else 3.

    Raises
    ------
    StructureError
        A network that is not covered, arrays that do not fit, or wanted nodes with a bar of zero length.
    EquilibriumError
        Coefficients that hold no shape, or loads that these coefficients cannot balance.
    """
    network.verify()
    d = _dimensions(d, z_d, z_e, near, loads)
    transformation = theorem11(network) if transformation is None else transformation
    forces = lemma18(lemma17(network, transformation), gamma)
    condition = lemma19(forces, transformation, lam, rank_tol=rank_tol)
    terms = None if loads is None else theorem22(forces, transformation, loads, load_nodes)
    _require_solution(forces, condition, terms)
    shapes = theorem21(transformation, forces, condition, terms, d=d)
    z_d, z_e = _free_vectors(shapes, z_d, z_e, near, loaded=terms is not None)
    if near is not None:
        check_bar_lengths(network, np.asarray(near, float))
    q = shapes.coordinates(z_d, z_e)
    configuration = _configuration(network, forces, condition, terms, transformation, q)
    return FiveSteps(transformation, forces, condition, terms, shapes, z_d, z_e, q, configuration)


def _dimensions(d: int | None, *arrays: np.ndarray | None) -> int:
    widths = {np.shape(a)[-1] for a in arrays if a is not None and np.ndim(a) == 2} | ({d} if d else set())
    if len(widths) > 1 or not widths <= {1, 2, 3}:
        raise StructureError(f"arrays of {sorted(widths)} components were given; give all of them 1, 2 or 3.")
    return widths.pop() if widths else 3


def _require_solution(forces: StringForces, condition: BarCondition, terms: LoadTerms | None) -> None:
    if terms is not None:
        require_balance(forces, terms)
        require_reach(condition, terms)
    elif condition.case == "i":
        raise EquilibriumError(
            f"these coefficients hold no shape: X - V_B1' Lambda V_B1 is regular ({condition.rank}), so all bars would "
            "have length zero; take lambda from admissible_ratios, or give rank_tol if the coefficients were rounded."
        )


def _free_vectors(shapes: Shapes, z_d, z_e, near, *, loaded: bool) -> tuple[np.ndarray, np.ndarray]:
    d = shapes.q_w.shape[1]
    if near is not None:
        if z_d is not None or z_e is not None:
            raise StructureError("near and z_d or z_e were given; near chooses both, so give one or the other.")
        return shapes.nearest(near)
    # Without load z_d = 0 would put all nodes into one point; with load zero is the shape of least norm.
    default = np.zeros((shapes.free_bars, d)) if loaded else np.eye(shapes.free_bars, d)
    z_d = default if z_d is None else np.asarray(z_d, float)
    z_e = np.zeros((shapes.free_places, d)) if z_e is None else np.asarray(z_e, float)
    return z_d, z_e


def _configuration(network, forces, condition, terms, transformation, q) -> Configuration:
    q1 = q[: transformation.rho_B]
    t = forces.T @ q1
    w, load_nodes = np.zeros((0, q.shape[1])), np.zeros(0, int)
    if terms is not None:
        t = t + terms.G1 @ terms.w
        w, load_nodes = terms.w, terms.load_nodes
    p = transformation.nodes(q)
    b = network.C_b.T @ p
    s, f = t / forces.gamma[:, None], condition.lam[:, None] * b
    return Configuration(network, forces.gamma, condition.lam, p, s, b, t, f, w, load_nodes)
