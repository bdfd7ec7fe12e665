"""The whole model as CasADi functions, assembled from the rod and tendon elements ([S] 5.21, 5.22).

    x = (q, q'),   x' = f(x, u, w),   q stacks (q1, q2) of each free rod and q2 of each rod held at one end

u shortens the acting tendons, L = L0 - u; w is the force on the pushed nodes. For structures of control size: the
expression grows with the number of tendons. Joints and guides add multipliers: one sparse solve. What a structure does
not have (dampers, drag, loads, pushes, pinned ends, a third dimension) is not in the expression: in a plane q and w
have two components where they have three in space.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import casadi as ca
import numpy as np

from tensctl.elements import Hold, Potential, rod_acceleration, tendon_tension
from tensctl.model.constraints import Constraints
from tensctl.model.layout import Layout


@dataclass(frozen=True, eq=False)
class SymbolicModel:
    """CasADi functions of a structure.

    Attributes
    ----------
    f : (x, u, w) -> dx/dt
    y_p : x -> nodes (3N) m, [S] (5.22); z = 0 in a plane
    y_l : x -> tendon lengths (nt) m
    y_f : (x, u) -> tendon tensions (nt) N
    """

    f: ca.Function
    y_p: ca.Function
    y_l: ca.Function
    y_f: ca.Function


@dataclass(frozen=True, eq=False)
class _Symbols:
    """The model's own symbols, and what they are in space."""

    own_q: ca.SX
    own_v: ca.SX
    u: ca.SX
    own_w: ca.SX
    dimension: int

    @property
    def x(self) -> ca.SX:
        return ca.vertcat(self.own_q, self.own_v)

    @property
    def q(self) -> ca.SX:
        return self.in_space(self.own_q)

    @property
    def v(self) -> ca.SX:
        return self.in_space(self.own_v)

    @property
    def w(self) -> ca.SX:
        return self.in_space(self.own_w)

    def in_space(self, own: ca.SX) -> ca.SX:
        """Vectors of two components with a third one, 0, from which nothing follows that stays in an expression."""
        if self.dimension == 3:
            return own
        full = ca.SX.zeros(3 * own.shape[0] // 2)
        full[_in_plane(full)] = own
        return full

    def own(self, full: ca.SX) -> ca.SX:
        """The components that there are."""
        return full if self.dimension == 3 else full[_in_plane(full)]


def _in_plane(full: ca.SX) -> list[int]:
    return [k for k in range(full.shape[0]) if k % 3 < 2]


def coordinate_count(potential: Potential) -> int:
    """Length of q: 6 for a free rod, 3 for one held at one end, 0 for one held at both; in a plane 4, 2 and 0."""
    vectors = np.select([potential.manifold.hold == 0, potential.manifold.hold == 3], [2, 0], 1)
    return int(potential.structure.dimension * vectors.sum())


def symbolic_model(
    potential: Potential,
    damping: np.ndarray,
    drag: float,
    layout: Layout,
    constraints: Constraints,
    *,
    clamped: bool = True,
) -> SymbolicModel:
    """Assemble the model.

    Parameters
    ----------
    damping : (nt,) N s/m
    drag : float, N s/m on each rod end
    layout, constraints
        Where rods share nodes, each has two ends of its own, tied together by multipliers.
    clamped : bool
        Whether a damped tendon is held at T >= 0.
    """
    members, dimension = potential.members, potential.structure.dimension
    size = coordinate_count(potential)
    symbols = _Symbols(
        ca.SX.sym("q", size),
        ca.SX.sym("v", size),
        ca.SX.sym("u", members.gearing.size),
        ca.SX.sym("w", dimension * len(members.pushed)),
        dimension,
    )
    anchors = [ca.SX(ca.DM(p)) for p in layout.anchor]
    nodes = _ends(potential, layout, symbols.q, anchors)
    velocities = _ends(potential, layout, symbols.v, [ca.SX.zeros(3)] * len(nodes))
    paths = [layout.place[list(path)] for path in potential.structure.paths]
    tensions, forces = _forces(potential, layout, paths, symbols, nodes, velocities, damping, drag, clamped)
    acceleration = symbols.own(ca.vertcat(*_accelerations(potential, layout, symbols, forces)))
    lengths = [sum(ca.norm_2(nodes[b] - nodes[a]) for a, b in pairwise(path)) for path in paths]
    x, names = symbols.x, (["x", "u", "w"], ["dx"])
    rate = ca.Function("f", [x, symbols.u, symbols.own_w], [ca.vertcat(symbols.own_v, acceleration)], *names)
    if constraints.first.size:
        rate = _tied(potential, layout, constraints, rate, symbols)
    return SymbolicModel(
        f=rate,
        y_p=ca.Function("y_p", [x], [ca.vertcat(*(nodes[k] for k in layout.place))], ["x"], ["p"]),
        y_l=ca.Function("y_l", [x], [ca.vertcat(*lengths)], ["x"], ["l"]),
        y_f=ca.Function("y_f", [x, symbols.u], [ca.vertcat(*tensions)], ["x", "u"], ["T"]),
    )


def _tied(
    potential: Potential, layout: Layout, constraints: Constraints, free: ca.Function, symbols: _Symbols
) -> ca.Function:
    """Add the forces of joints and guides, S mu = -C p'': S is linear in the rods' own answer to end forces."""
    C, ends = constraints.matrix(2 * len(layout.rods)), 2 * len(layout.rods)
    rows = ca.DM(C.toarray())
    mu = ca.SX.sym("mu", C.shape[0])
    at_ends = ca.vertsplit(rows.T @ mu, 3) + [ca.SX.zeros(3)] * (len(layout.anchor) - ends)
    still = replace(symbols, own_v=ca.SX.zeros(symbols.own_v.shape))
    answer = ca.vertcat(*_accelerations(potential, layout, still, at_ends))
    still_anchors = [ca.SX.zeros(3)] * len(layout.anchor)
    across = rows @ ca.vertcat(*_ends(potential, layout, answer, still_anchors)[:ends])
    size = symbols.own_q.shape[0]
    acceleration = ca.SX.sym("a", size)
    opening = rows @ ca.vertcat(*_ends(potential, layout, symbols.in_space(acceleration), still_anchors)[:ends])
    S = ca.Function("S", [symbols.own_q], [ca.jacobian(across, mu)])
    open_up = ca.Function("open_up", [acceleration], [opening])
    answer_to = ca.Function("answer_to", [symbols.own_q, mu], [symbols.own(answer)])
    x, u, w = (ca.MX.sym(name, k.shape[0]) for name, k in (("x", symbols.x), ("u", symbols.u), ("w", symbols.own_w)))
    rate = free(x, u, w)
    forces = ca.solve(S(x[:size]), -open_up(rate[size:]))
    rate = ca.vertcat(rate[:size], rate[size:] + answer_to(x[:size], forces))
    return ca.Function("f", [x, u, w], [rate], ["x", "u", "w"], ["dx"])


def _ends(potential: Potential, layout: Layout, q: ca.SX, anchors: list) -> list:
    """Node positions from q, or velocities from v with anchors at rest."""
    nodes, at = list(anchors), 0
    for (a, b), hold in zip(layout.rods, potential.manifold.hold, strict=True):
        if hold == Hold.FREE:
            nodes[a] = (q[at : at + 3] - q[at + 3 : at + 6]) / 2
            nodes[b] = (q[at : at + 3] + q[at + 3 : at + 6]) / 2
            at += 6
        elif hold == Hold.TAIL:
            nodes[b] = anchors[a] + q[at : at + 3]
            at += 3
        elif hold == Hold.HEAD:
            nodes[a] = anchors[b] - q[at : at + 3]
            at += 3
    return nodes


def _forces(potential, layout, paths, symbols, nodes, velocities, damping, drag, clamped) -> tuple[list, list]:
    members = potential.members
    forces = [ca.SX(ca.DM(f)) for f in layout.spread(members.forces)]
    for k, node in enumerate(layout.place[members.pushed]):
        forces[node] = forces[node] + symbols.w[3 * k : 3 * k + 3]
    if drag > 0:
        forces = [f - drag * v for f, v in zip(forces, velocities, strict=True)]
    gearing = members.gearing
    shortening = {
        int(t): ratio * symbols.u[int(motor)]
        for t, motor, ratio in zip(members.inputs, gearing.motor, gearing.ratio, strict=True)
    }
    tensions = []
    for t, path in enumerate(paths):
        pieces = [nodes[b] - nodes[a] for a, b in pairwise(path)]
        d, rest = _straight(pieces), members.rest_lengths[t] - shortening.get(t, 0.0)
        if damping[t] > 0:
            rate = _stretching(pieces, [velocities[b] - velocities[a] for a, b in pairwise(path)])
            law = tendon_tension(members.law, damped=True, clamped=clamped)
            T = law(d, rate, rest, members.stiffness[t], damping[t])
        else:
            T = tendon_tension(members.law, damped=False)(d, rest, members.stiffness[t])
        for (a, b), piece in zip(pairwise(path), pieces, strict=True):
            pull = T / _length(piece) * piece
            forces[a], forces[b] = forces[a] + pull, forces[b] - pull
        tensions.append(T)
    return tensions, forces


def _length(piece: ca.SX) -> ca.SX:
    """|d|, or 1 where both ends meet, so that there is no 0/0."""
    square = ca.dot(piece, piece)
    return ca.sqrt(ca.if_else(square > 0, square, 1.0))


def _straight(pieces: list) -> ca.SX:
    """From tail to head of a tendon; a cable is laid out along one axis, as long as its pieces together."""
    if len(pieces) == 1:
        return pieces[0]
    return ca.SX([1, 0, 0]) * sum(ca.norm_2(piece) for piece in pieces)


def _stretching(pieces: list, rates: list) -> ca.SX:
    """The rate of `_straight`."""
    if len(pieces) == 1:
        return rates[0]
    each = [ca.dot(piece, rate) / _length(piece) for piece, rate in zip(pieces, rates, strict=True)]
    return ca.SX([1, 0, 0]) * sum(each)


def _accelerations(potential: Potential, layout: Layout, symbols: _Symbols, forces: list) -> list:
    result, at = [], 0
    q, v, mass = symbols.q, symbols.v, potential.members.mass
    for r, ((a, b), hold) in enumerate(zip(layout.rods, potential.manifold.hold, strict=True)):
        if hold == Hold.FREE:
            turn = slice(at + 3, at + 6)
            result += rod_acceleration(Hold.FREE)(q[turn], v[turn], forces[a], forces[b], mass[r])
            at += 6
        elif hold != Hold.FIXED:
            turn, end = slice(at, at + 3), forces[b] if hold == Hold.TAIL else forces[a]
            result.append(rod_acceleration(Hold(hold))(q[turn], v[turn], end, mass[r]))
            at += 3
    return result
