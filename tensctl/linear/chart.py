"""The full nonlinear model in the coordinates of the linear one, as CasADi functions with exact derivatives.

Positions are y = Phi eta in the great-circle chart about the equilibrium, each rod by itself,

    e(a) = cos|a| e0 + (sin|a|/|a|) sum a_i f_i,   a = tau/rho
    q = g(xi),   q' = g_xi xi',   q'' = g_xi xi'' + g_xixi xi' xi'

and rates are eta', so that x = (s eta, eta') is what `LinearModel.state_of` measures. Where rods share nodes or are
guided, xi is the point over y at which joints are closed and guides kept, C p(xi) = b with Z'W xi = y, and its rate
follows from the same rows. The chart holds while no rod has turned by half a turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from jaxtyping import Float

from tensctl.elements import Hold, JointedManifold, RodManifold
from tensctl.linear.model import LinearModel
from tensctl.model import Dynamics

# Below this |a|^2 sines and cosines are series of twelve terms, exact there and smooth at 0.
_NEAR = 1.0
_TERMS = 12
_NEWTON = {"abstol": 1e-14, "abstolStep": 1e-14, "max_iter": 30, "error_on_fail": False}


@dataclass(frozen=True, eq=False)
class ChartedModel:
    """CasADi functions of the whole model; x and u as the linear model has them, u and y in total.

    Attributes
    ----------
    rate : (x, u) -> dx/dt
    outputs : (x, u) -> y
    jacobians : (x, u) -> (A, B, C, D)
    """

    rate: ca.Function
    outputs: ca.Function
    jacobians: ca.Function


def charted(linear: LinearModel) -> ChartedModel:
    """The nonlinear model behind a linear one that holds all of its modes."""
    dynamics, manifold = linear.dynamics, linear.equilibrium.potential.manifold
    place, turn = _rods(dynamics, linear.equilibrium.nodes)
    count, order = len(linear.modes), linear.order
    x, u = ca.MX.sym("x", 2 * count), ca.MX.sym("u", dynamics.members.gearing.size)
    unsorted = x[np.argsort(order).tolist()]
    eta, speed = unsorted[:count] / linear.scales, unsorted[count:]
    shapes, mass = ca.DM(linear.shapes), manifold.mass(dynamics.members.mass)
    xi, moving, down = _over(dynamics, manifold, linear.equilibrium.nodes, place, shapes @ eta, shapes @ speed)
    q, rates = place(xi), _along(place, xi, moving)
    state = ca.vertcat(q, rates)
    w = np.zeros(dynamics.f.size1_in(2))
    forced = dynamics.f(state, u, w)[q.shape[0] :]
    bent = down @ turn(xi, moving, forced)
    full = ca.vertcat(ca.DM(linear.scales) * speed, shapes.T @ (ca.DM(mass) * bent))
    dx = full[order.tolist()]
    still = np.zeros(rates.shape[0])
    moved = dynamics.y_p(ca.vertcat(rates, still)) - dynamics.y_p(np.zeros(2 * still.size))
    raw = ca.vertcat(dynamics.y_p(state), moved, dynamics.y_l(state), dynamics.y_f(state, u))
    y = ca.DM(linear.outputs_map.weights.tocsc()) @ raw
    blocks = [ca.jacobian(part, of) for part in (dx, y) for of in (x, u)]
    return ChartedModel(
        ca.Function("rate", [x, u], [dx], ["x", "u"], ["dx"]),
        ca.Function("outputs", [x, u], [y], ["x", "u"], ["y"]),
        ca.Function("jacobians", [x, u], blocks, ["x", "u"], ["A", "B", "C", "D"]),
    )


def _along(place: ca.Function, xi: ca.MX, rate: ca.MX) -> ca.MX:
    """Q' from xi'."""
    at = ca.SX.sym("xi", xi.shape[0])
    way = ca.SX.sym("rate", xi.shape[0])
    return ca.Function("along", [at, way], [ca.jtimes(place(at), at, way)])(xi, rate)


def _rods(dynamics: Dynamics, nodes: Float[np.ndarray, "nodes 3"]) -> tuple[ca.Function, ca.Function]:
    """Rod coordinates q(xi), and xi''(xi, xi', q''), rod by rod."""
    ends, at = _ends(dynamics.potential.manifold, nodes)
    e0, frames, axes = ends.directions(at), ends.frames(at), dynamics.structure.dimension
    xi, rate = ca.SX.sym("xi", ends.size), ca.SX.sym("rate", ends.size)
    centre = dict(zip(ends.free.tolist(), ends.centre_columns.tolist(), strict=True))
    turned = dict(zip(ends.moving.tolist(), ends.direction_columns.tolist(), strict=True))
    q, answer, forced = [], ca.SX.zeros(ends.size), []
    for r in ends.moving.tolist():
        tau, tau_rate = xi[turned[r]], rate[turned[r]]
        q2 = (ends.lengths[r] * _direction(tau / ends.lever[r], e0[r], frames[r]))[:axes]
        if ends.hold[r] == Hold.FREE:
            middle = at[ends.rods[r]].sum(axis=0)[:axes]
            q.append(middle + 2 * xi[centre[r]])
            q1_force = ca.SX.sym("a", axes)
            forced.append(q1_force)
            answer[centre[r]] = q1_force / 2
        force = ca.SX.sym("a", axes)
        forced.append(force)
        q.append(q2)
        J = ca.jacobian(q2, tau)
        bend = ca.jtimes(ca.jtimes(q2, tau, tau_rate), tau, tau_rate)
        answer[turned[r]] = ca.solve(J.T @ J, J.T @ (force - bend))
    place = ca.Function("place", [xi], [ca.vertcat(*q)], ["xi"], ["q"])
    return place, ca.Function("turn", [xi, rate, ca.vertcat(*forced)], [answer], ["xi", "rate", "a"], ["bent"])


def _ends(manifold: RodManifold | JointedManifold, nodes: np.ndarray) -> tuple[RodManifold, np.ndarray]:
    """Rods with two ends of their own, and where the ends are."""
    return (manifold, nodes) if isinstance(manifold, RodManifold) else (manifold.ends, nodes[manifold.end_node])


def _direction(a: ca.SX, e0: np.ndarray, frames: np.ndarray) -> ca.SX:
    """e(a)."""
    z = ca.dot(a, a)
    far = ca.sqrt(ca.if_else(z < _NEAR, _NEAR, z))
    cosine, sine, term = 0, 0, 1.0
    for k in range(_TERMS):
        cosine, sine = cosine + term, sine + term / (2 * k + 1)
        term = -term * ca.if_else(z < _NEAR, z, 0) / ((2 * k + 1) * (2 * k + 2))
    cosine, sine = (ca.if_else(z < _NEAR, near, of) for near, of in ((cosine, ca.cos(far)), (sine, ca.sin(far) / far)))
    return cosine * e0 + sine * (ca.DM(frames.T) @ a)


def _over(dynamics, manifold, nodes, place, y: ca.MX, rate: ca.MX) -> tuple[ca.MX, ca.MX, ca.DM]:
    """Rods' coordinates xi and xi' over y and y', and the map from xi'' back to y''."""
    if isinstance(manifold, RodManifold):
        return y, rate, ca.DM.eye(manifold.size)
    basis = manifold.basis(nodes).toarray()
    down, start = ca.DM(basis.T / manifold.weights), ca.DM(basis) @ y
    xi, at = ca.SX.sym("xi", manifold.ends.size), ca.SX.sym("y", manifold.size)
    rows = dynamics.constraints
    gaps = ca.DM(rows.matrix(manifold.end_node.size).tocsc()) @ _points(dynamics, manifold, nodes, place(xi))
    stacked = ca.vertcat(gaps - rows.target, down @ xi - at)
    solve = ca.rootfinder("over", "newton", {"x": xi, "p": at, "g": stacked}, _NEWTON)
    found = solve(start, y)
    jacobian = ca.Function("rows", [xi], [ca.jacobian(stacked, xi)])(found)
    return found, ca.solve(jacobian, ca.vertcat(ca.DM.zeros(rows.first.size), rate)), down


def _points(dynamics, manifold: JointedManifold, nodes: np.ndarray, q: ca.SX) -> ca.SX:
    """All rod ends from q, (3 ends)."""
    ends, at, axes, first = manifold.ends, nodes[manifold.end_node], dynamics.structure.dimension, 0
    points = ca.SX(ca.DM(at.ravel()))

    def vector() -> ca.SX:
        nonlocal first
        first += axes
        return q[first - axes : first]

    for r in ends.moving.tolist():
        tail, head = (slice(3 * k, 3 * k + axes) for k in ends.rods[r].tolist())
        if ends.hold[r] == Hold.FREE:
            total, apart = vector(), vector()
            points[tail], points[head] = (total - apart) / 2, (total + apart) / 2
        elif ends.hold[r] == Hold.TAIL:
            points[head] = points[tail] + vector()
        else:
            points[tail] = points[head] - vector()
    return points
