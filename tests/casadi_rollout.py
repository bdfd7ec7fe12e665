"""A plan rolled out by CasADi: the symbolic model's own Runge-Kutta steps, differentiated by algorithm, state by state.

x_(k+1) = F(x_k, u_k, u_(k+1)),   dx_(k+1) = F_x dx_k + F_0 du_k + F_1 du_(k+1)

Where actuators lag, u are commands and the rest-length changes that follow them are the last of x.
"""

import casadi as ca
import numpy as np

from tensctl.synthesis.rollout import Rollout

# Of Newton's method on joints that a step has left open by less than 1e-5 m.
_ROUNDS = 3


def rolled_out(dynamics, dt, steps, nodes, velocities, now, plan, *, lag=0.0, commands=None):
    """What `tensctl.synthesis.rollout` gives of the same plan, in as many steps a period."""
    (N, nu), x = plan.shape, dynamics.pack(nodes, velocities)
    period, stretch, place = _period(dynamics, dt, steps, lag), _stretch(dynamics), _shown(dynamics)
    motion, asked = x.size, now if commands is None else commands
    if lag:
        x = np.concatenate([x, now])
    dx, before, found = np.zeros((x.size, plan.size)), np.zeros((nu, plan.size)), []
    for u, last, now_by in zip(plan, [asked, *plan[:-1]], np.eye(plan.size).reshape(N, nu, -1), strict=True):
        x, *by = (np.array(part) for part in period(x, last, u))
        dx = by[0] @ dx + by[1] @ before + by[2] @ now_by
        there, there_by = (x[motion:].ravel(), dx[motion:]) if lag else (u, now_by)
        stretches, *by = (np.array(part) for part in stretch(x[:motion], there))
        nodes, velocities = dynamics.unpack(x[:motion].ravel())
        both = np.array([place @ half for half in np.split(dx[:motion], 2)]).reshape(2, -1, 3, plan.size)
        stretch_by = by[0] @ dx[:motion] + by[1] @ there_by
        found.append((nodes, velocities, stretches.ravel(), both, stretch_by, there, there_by[0, ::nu]))
        before = now_by
    found = [np.array(part) for part in zip(*found, strict=True)]
    return Rollout(*(found if lag else found[:5]))


def _symbols(dynamics):
    return [ca.MX.sym(name, dynamics.f.size1_in(k)) for k, name in enumerate("xu")]


def _period(dynamics, dt, steps, lag):
    """One period's end and its derivatives by the state and by the inputs at both its ends."""
    x, first = _symbols(dynamics)
    motion, nu, h, none = x.shape[0], first.shape[0], dt / steps, np.zeros(dynamics.f.size1_in(2))
    y, last = ca.MX.sym("y", motion + nu if lag else motion), ca.MX.sym("last", nu)
    at, begun = y[:motion], y[motion:]

    def inputs(part):
        """tau u' = c - u, c straight: behind it by tau c' but for what dies out."""
        asked = first + (last - first) * part
        if not lag:
            return asked
        behind = lag / dt * (last - first)
        return asked - behind + ca.exp(-part * dt / lag) * (begun - first + behind)

    for n in range(steps):
        u = [inputs((n + part) / steps) for part in (0, 0.5, 0.5, 1)]
        k = [dynamics.f(at, u[0], none)]
        for part, between in zip((0.5, 0.5, 1), u[1:], strict=True):
            k.append(dynamics.f(at + part * h * k[-1], between, none))
        at = _closed(dynamics, _tidy(dynamics, at + h / 6 * (k[0] + 2 * k[1] + 2 * k[2] + k[3])))
    at = ca.vertcat(at, inputs(1)) if lag else at
    return ca.Function("period", [y, first, last], [at, *(ca.jacobian(at, by) for by in (y, first, last))])


def _tidy(dynamics, x):
    """Rods back to their lengths, no velocity along them."""
    q, v = ca.vertsplit(x, x.shape[0] // 2)
    axes, at, places, speeds = dynamics.structure.dimension, 0, [], []
    for hold, length in zip(dynamics.potential.manifold.hold, dynamics.potential.manifold.lengths, strict=True):
        if hold == 0:
            places.append(q[at : at + axes])
            speeds.append(v[at : at + axes])
            at += axes
        if hold != 3:
            turn, rate = q[at : at + axes], v[at : at + axes]
            places.append(length * turn / ca.norm_2(turn))
            speeds.append(rate - ca.dot(turn, rate) / ca.dot(turn, turn) * turn)
            at += axes
    return ca.vertcat(*places, *speeds)


def _closed(dynamics, x):
    """Joints and guides closed square to them in the mass metric, no velocity across them."""
    if not dynamics.tied:
        return x
    tie, half = _tie(dynamics), x.shape[0] // 2
    for _ in range(_ROUNDS):
        gap, rows, mobility = tie(x[:half])
        back = mobility @ rows.T @ ca.solve(rows @ mobility @ rows.T, -gap)
        x = _tidy(dynamics, ca.vertcat(x[:half] + back, x[half:]))
    _, rows, mobility = tie(x[:half])
    across = mobility @ rows.T @ ca.solve(rows @ mobility @ rows.T, rows @ x[half:])
    return ca.vertcat(x[:half], x[half:] - across)


def _tie(dynamics):
    """By q: how far joints and guides are open, how that follows q, and the rate of q by forces on it.

    Kinetic energy of a rod: m/8 |q1'|^2 + m/24 |q2'|^2, held at one end m/6 |q2'|^2; no rate along it.
    """
    q, axes, at, ends, mobility = ca.SX.sym("q", dynamics.f.size1_in(0) // 2), dynamics.structure.dimension, 0, [], []
    masses, holds = dynamics.members.mass, dynamics.potential.manifold.hold
    for mass, hold, anchors in zip(masses, holds, dynamics.layout.anchor[dynamics.layout.rods], strict=True):
        tail, head = (ca.SX(ca.DM(p[:axes])) for p in anchors)
        middle = q[at : at + axes] / 2
        if hold == 0:
            at += axes
            mobility.append(4 / mass * ca.SX.eye(axes))
        if hold != 3:
            turn, at = q[at : at + axes], at + axes
            mobility.append((12 if hold == 0 else 3) / mass * (ca.SX.eye(axes) - turn @ turn.T / ca.dot(turn, turn)))
            if hold == 0:
                tail, head = middle - turn / 2, middle + turn / 2
            elif hold == 1:
                head = tail + turn
            else:
                tail = head - turn
        none = ca.SX.zeros(3 - axes)
        ends += [tail, none, head, none]
    gap = (
        ca.DM(dynamics.constraints.matrix(2 * len(masses)).toarray()) @ ca.vertcat(*ends) - dynamics.constraints.target
    )
    return ca.Function("tie", [q], [gap, ca.jacobian(gap, q), ca.diagcat(*mobility)])


def _stretch(dynamics):
    """Every tendon's tension as it would be were it taut, over k or EA/L0, and its derivatives."""
    (x, u), members = _symbols(dynamics), dynamics.members
    gear = np.zeros((members.rest_lengths.size, u.shape[0]))
    gear[members.inputs] = members.gearing.matrix.toarray()
    length, rest = dynamics.y_l(x), members.rest_lengths - gear @ u
    half = x.shape[0] // 2
    growing = ca.jtimes(length, x, ca.vertcat(x[half:], np.zeros(half)))
    stiffness = members.stiffness / (members.rest_lengths if members.law == "EA" else 1.0)
    stretch = length - rest if members.law == "k" else members.rest_lengths / rest * (length - rest)
    stretch += ca.if_else(length > rest, dynamics.damping / stiffness * growing, 0.0)
    return ca.Function("stretch", [x, u], [stretch, *(ca.jacobian(stretch, by) for by in (x, u))])


def _shown(dynamics):
    """How nodes follow rod coordinates, (3N, nq): the same everywhere."""
    x, _ = _symbols(dynamics)
    return np.array(ca.DM(ca.Function("shown", [x], [ca.jacobian(dynamics.y_p(x), x)])(0)))[:, : x.shape[0] // 2]
