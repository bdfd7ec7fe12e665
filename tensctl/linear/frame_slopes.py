"""What the co-moving frame shows of many points of a motion, and how that changes with nodes and velocities.

The best fit of `linear.frame` makes S = R'M symmetric, M the moments of the mass about both centres, so its turn
dR = R [theta]x obeys

    (tr(S) I - S) theta = vee(R'dM - dM'R)

and the mean spin omega = I^-1 h changes by I^-1 (dh - dI omega).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.elements import Potential
from tensctl.linear.frame import fitted


@dataclass(frozen=True, eq=False)
class View:
    """Nodes and velocities as they are measured at each point, with derivatives by the true ones, 6K columns.

    Attributes
    ----------
    nodes, velocities, drift : (points, K, 3)
        Drift is velocities turned into the frame's axes, its own motion not taken away.
    by_nodes, by_velocities, by_drift : (points, 3K, 6K), or one for all
        Derivative of each of them.
    """

    nodes: Float[np.ndarray, "points K 3"]
    velocities: Float[np.ndarray, "points K 3"]
    drift: Float[np.ndarray, "points K 3"]
    by_nodes: Float[np.ndarray, "points_or_1 rows columns"]
    by_velocities: Float[np.ndarray, "points_or_1 rows columns"]
    by_drift: Float[np.ndarray, "points_or_1 rows columns"]


def still(potential: Potential, reference: np.ndarray, nodes: np.ndarray, velocities: np.ndarray) -> View:
    """The world's own view."""
    size = reference.size
    moved, faster = np.eye(size, 2 * size)[None], np.eye(size, 2 * size, size)[None]
    return View(nodes, velocities, velocities, moved, faster, faster)


def seen_from_frames(potential: Potential, reference: np.ndarray, nodes: np.ndarray, velocities: np.ndarray) -> View:
    """The view of a free structure's frame at each point."""
    form, count, flat = _mass_form(potential), len(reference), potential.structure.planar
    weights = form.sum(axis=1) / form.sum()
    here, fast = (part - (weights @ part)[:, None] for part in (nodes, velocities))
    changes = np.eye(6 * count).reshape(2, count, 3, -1)
    place, speed = (change - np.einsum("k,kic->ic", weights, change) for change in changes)
    centre = weights @ reference
    heavy = form @ (reference - centre)
    R, spin = _fits(form, flat, heavy, here, fast)
    turn = _turn(flat, R, here, heavy, place)
    rate = _spin(form, flat, spin, here, fast, place, speed)
    left = fast - np.cross(spin[:, None], here)
    slower = speed - _cross(rate[:, None], here[..., None]) - _cross(spin[:, None, :, None], place)
    values, slopes = [], []
    for along, change in ((here, place), (left, slower), (velocities, changes[1])):
        values.append(along @ R)
        turned = np.swapaxes(R, 1, 2)[:, None] @ change + _cross(values[-1][..., None], turn[:, None])
        slopes.append(turned.reshape(len(R), 3 * count, -1))
    return View(values[0] + centre, values[1], values[2], slopes[0], slopes[1], slopes[2])


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products over the axis before the last, (..., 3, c)."""
    (x, y, z), (u, v, w) = (np.moveaxis(part, -2, 0) for part in (a, b))
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-2)


def _vee(matrix: np.ndarray) -> np.ndarray:
    """The vector of the skew part, twice, (s, 3, c)."""
    bent = matrix - np.swapaxes(matrix, 1, 2)
    return np.stack([bent[:, 2, 1], bent[:, 0, 2], bent[:, 1, 0]], axis=1)


def _fits(
    form: np.ndarray, flat: bool, heavy: np.ndarray, here: np.ndarray, fast: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and spins of the frames at all points, as `linear.frame` has them; `heavy` is form @ reference."""
    moments, shape = np.swapaxes(here, 1, 2) @ heavy, np.swapaxes(here, 1, 2) @ (form @ here)
    R = fitted(moments, flat)
    momentum = -_vee((np.swapaxes(here, 1, 2) @ (form @ fast))[..., None])
    return R, _over(flat, _inertia(shape), momentum)[..., 0]


def _turn(flat: bool, R: np.ndarray, here: np.ndarray, heavy: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Turn of each frame about its own axes, (s, 3, c)."""
    S = np.swapaxes(R, 1, 2) @ np.swapaxes(here, 1, 2) @ heavy
    bent = np.einsum("sji,jkc->sikc", R, _moments(heavy, place))
    return _over(flat, _inertia(S), _vee(bent))


def _spin(
    form: np.ndarray, flat: bool, spin: np.ndarray, here: np.ndarray, fast: np.ndarray, place: np.ndarray,
    speed: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Change of each mean spin, (s, 3, c)."""
    shape = np.swapaxes(here, 1, 2) @ (form @ here)
    bent = _moments(form @ here, place)
    bent = bent + np.swapaxes(bent, 1, 2)
    heavier = np.einsum("skkc,si->sic", bent, spin) - np.einsum("sijc,sj->sic", bent, spin)
    momentum = _vee(_moments(form @ here, speed)) - _vee(_moments(form @ fast, place))
    return _over(flat, _inertia(shape), momentum - heavier)


def _inertia(shape: np.ndarray) -> np.ndarray:
    """tr(S) I - S of each S."""
    return np.trace(shape, axis1=1, axis2=2)[:, None, None] * np.eye(3) - shape


def _over(flat: bool, matrix: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Solve for turns, about the third axis alone in a plane."""
    if not flat:
        return np.linalg.solve(matrix, vectors)
    turns = np.zeros_like(vectors)
    turns[:, 2] = vectors[:, 2] / matrix[:, 2, 2, None]
    return turns


def _moments(weighted: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """Integral of a b' over the mass, (..., 3, 3, c), for changes a (K, 3, c) and b times the mass form (..., K, 3)."""
    count, _, columns = changes.shape
    product = np.swapaxes(weighted, -1, -2) @ changes.reshape(count, -1)
    return np.swapaxes(product.reshape(*product.shape[:-1], 3, columns), -3, -2)


def _mass_form(potential: Potential) -> np.ndarray:
    """The matrix G of int a b' dm = a' G b over uniform rods, (K, K) kg."""
    rods, mass = potential.structure.rods, potential.members.mass
    form = np.zeros((len(potential.structure.nodes),) * 2)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        np.add.at(form, (rods[:, i], rods[:, j]), mass / 3 if i == j else mass / 6)
    return form
