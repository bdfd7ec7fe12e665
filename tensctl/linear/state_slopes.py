"""The linear model's state at many points of a motion, and how it changes with nodes and velocities, exactly.

What `LinearModel.state_of` says of one point, and its derivative. A rod's direction e seen from e0, with c = e0 . e and
f(c) = acos(c)/sqrt(1 - c^2), has the coordinates

    y_i  = rho f (f_i . e)
    y_i' = rho [f (f_i . e') + f_c (f_i . e)(e0 . e')]

and each is differentiated by e and e'. A free structure is seen from its co-moving frame (`linear.frame_slopes`).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from jaxtyping import Float

from tensctl.elements import JointedManifold, RodManifold
from tensctl.linear.frame_slopes import seen_from_frames, still
from tensctl.linear.model import LinearModel

# Above this cosine f and its derivatives are sums of powers of 1 - c, whose terms fall at least as 0.15^k.
_NEAR = 0.7
_TERMS = 20


def states_and_slopes(
    linear: LinearModel, nodes: Float[np.ndarray, "points nodes 3"], velocities: Float[np.ndarray, "points nodes 3"]
) -> tuple[Float[np.ndarray, "points nx"], Float[np.ndarray, "points nx columns"]]:
    """States x and their derivatives by (nodes, velocities), 6K columns."""
    equilibrium = linear.equilibrium
    manifold, at = equilibrium.potential.manifold, equilibrium.nodes
    carried = linear.dynamics.structure.held.any() or any(m.kind == "rigid-body" for m in linear.modes)
    view = still if carried else seen_from_frames
    view = view(equilibrium.potential, at, nodes, velocities)
    weight = manifold.mass(linear.dynamics.members.mass)[:, None]
    shapes, scales = (linear.shapes * weight).T, linear.scales[:, None]
    y, rate, by_place, bend = _chart_of(manifold, at, view.nodes, view.velocities)
    moved = by_place @ view.by_nodes
    states, slopes = [y @ (scales * shapes).T, rate @ shapes.T], [(scales * shapes) @ moved]
    slopes.append(shapes @ (bend @ view.by_nodes + by_place @ view.by_velocities))
    if linear.drifting:
        rigid = (equilibrium.spectrum.shapes[:, [mode.index for mode in linear.drifting]] * weight).T
        _, rate, _, bend = _chart_of(manifold, at, view.nodes, view.drift)
        states.append(rate @ rigid.T)
        slopes.append(rigid @ (bend @ view.by_nodes + by_place @ view.by_drift))
    return np.concatenate(states, axis=1)[:, linear.order], np.concatenate(slopes, axis=1)[:, linear.order]


def _chart_of(
    manifold: RodManifold | JointedManifold, at: np.ndarray, nodes: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """`_chart`; where joints or guides tie rods, projected square to the mass metric as their own chart is."""
    if isinstance(manifold, RodManifold):
        return _chart(manifold, at, nodes, rates)
    ends, count = manifold.end_node, 3 * len(at)
    values = _chart(manifold.ends, at[ends], nodes[:, ends], rates[:, ends])
    down, columns = manifold.chart(at).down, (3 * ends[:, None] + np.arange(3)).ravel()
    fold = sp.csr_array((np.ones(columns.size), (columns, np.arange(columns.size))), (count, columns.size))
    y, rate = ((down @ part.T).T for part in values[:2])
    place, bend = (np.array([(fold @ (down @ part).T).T for part in slopes]) for slopes in values[2:])
    return y, rate, place, bend


def _chart(
    manifold: RodManifold, at: np.ndarray, nodes: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Great-circle coordinates and their rates, (points, size), and derivatives of both by nodes, (points, size, 3K).

    That of the rates by velocities is the first of the two.
    """
    points, count = nodes.shape[:2]
    y, rate = (np.zeros((points, manifold.size)) for _ in range(2))
    place, bend = (np.zeros((points, manifold.size, count, 3)) for _ in range(2))
    free, centres = manifold.rods[manifold.free], manifold.centre_columns
    axes = np.arange(manifold.dimension)
    y[:, centres] = (0.5 * (nodes - at)[:, free].sum(axis=2))[:, :, axes]
    rate[:, centres] = (0.5 * rates[:, free].sum(axis=2))[:, :, axes]
    place[:, centres[:, None], free[:, :, None], axes] = 0.5
    moving, turns = manifold.moving, manifold.direction_columns
    tail, head = manifold.rods[moving].T
    length, lever = manifold.lengths[moving, None], manifold.lever[moving, None]
    e0, across = manifold.directions(at)[moving], manifold.frames(at)[moving]
    e, spin = ((part[:, head] - part[:, tail]) / length for part in (nodes, rates))
    f, f1, f2 = (value[:, :, None] for value in _angle_over_sine(np.einsum("ri,sri->sr", e0, e)))
    part, speed = (np.einsum("rki,sri->srk", across, way) for way in (e, spin))
    forward = np.einsum("ri,sri->sr", e0, spin)[:, :, None]
    y[:, turns], rate[:, turns] = lever * f * part, lever * (f * speed + f1 * part * forward)
    ratio, start = (lever / length)[:, :, None], e0[:, None]
    slope = ratio * (f[..., None] * across + (f1 * part)[..., None] * start)
    curve = (f1 * speed + f2 * part * forward)[..., None] * start + (f1 * forward)[..., None] * across
    for values, target in ((slope, place), (ratio * curve, bend)):
        target[:, turns, head[:, None]] += values
        target[:, turns, tail[:, None]] -= values
    return y, rate, place.reshape(points, manifold.size, -1), bend.reshape(points, manifold.size, -1)


def _angle_over_sine(c: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """f(c) = acos(c)/sqrt(1 - c^2) = sum k!/(2k+1)!! (1-c)^k and its first two derivatives."""
    y = 1.0 - np.maximum(c, _NEAR)
    near, coefficient, power = np.zeros((3, *c.shape)), 1.0, np.zeros((3, *c.shape))
    power[0] = 1.0
    for k in range(_TERMS):
        near += coefficient * power
        coefficient *= (k + 1) / (2 * k + 3)
        power = np.stack([power[0] * y, power[1] * y - power[0], power[2] * y - 2 * power[1]])
    square = np.where(c > _NEAR, 1.0, 1.0 - c**2)
    far = np.arccos(np.clip(c, -1.0, 1.0)) / np.sqrt(square)
    first = (c * far - 1) / square
    beyond = far, first, (far + 3 * c * first) / square
    f, f1, f2 = (np.where(c > _NEAR, n, b) for n, b in zip(near, beyond, strict=True))
    return f, f1, f2
