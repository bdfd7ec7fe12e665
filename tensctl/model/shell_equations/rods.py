"""Rods without angles: H, Omega and K_r ([S] Theorem 3.1, section 3, (3.1)-(3.4), (A.11)).

    q'' + K_r q = H f,   H = BlockDiag[(2/m) I, (6/(m L^2)) q2~^2],   K_r = BlockDiag[0, |q2'|^2/L^2 I]
    q2~^2 = q2 q2' - |q2|^2 I

Theorem 3.1 prints K without the dots; the element equation has Omega q' for Omega q. Where L stands the actual |q2| is
taken, as in the project's own model: with a nominal L, a rod of length (1 + eps) L is turned (1 + 2 eps) times too
fast. Give `lengths` for [S] to the letter; on the manifold |q2| = L both agree.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import sparse

from tensctl.model.shell_equations.blocks import diagonal


def skew(r: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix r~ with r~ x = r x x (after Theorem 3.1)."""
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def skew_square(r: Float[np.ndarray, "rods d"]) -> Float[np.ndarray, "rods d d"]:
    """r~^2 = r r' - |r|^2 I for each vector, in space or in the plane."""
    return r[:, :, None] * r[:, None, :] - (r * r).sum(axis=1)[:, None, None] * np.eye(r.shape[1])


def rod_halves(q: Float[np.ndarray, " q"], d: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """(q1, q2) of every rod, (rods, d): q_ij holds q1, q2 of its first rod and q3, q4 of its second (section 3)."""
    pairs = np.asarray(q, float).reshape(-1, 2, d)
    return pairs[:, 0], pairs[:, 1]


def H_matrix(
    q: Float[np.ndarray, " q"],
    mass: Float[np.ndarray, " rods"],
    lengths: Float[np.ndarray, " rods"] | None = None,
    *,
    d: int = 3,
) -> sparse.csr_array:
    """H of (3.4), (q, q) 1/kg, one block (2/m) BlockDiag[I, (3/L^2) q2~^2] a rod.

    Parameters
    ----------
    q : m
    mass : kg
    lengths : m
        Nominal L as in [S]; the actual |q2| by default.
    d : dimensions, 3, or 2 for Appendix A's examples.
    """
    _, q2 = rod_halves(q, d)
    square = _squares(q2, lengths)
    blocks = np.zeros((len(q2), 2, d, d))
    blocks[:, 0] = np.eye(d)
    blocks[:, 1] = (3 / square)[:, None, None] * skew_square(q2)
    blocks *= (2 / np.asarray(mass, float))[:, None, None, None]
    return diagonal(blocks.reshape(-1, d, d))


def K_r_matrix(
    q: Float[np.ndarray, " q"],
    v: Float[np.ndarray, " q"],
    lengths: Float[np.ndarray, " rods"] | None = None,
    *,
    d: int = 3,
) -> sparse.dia_array:
    """K_r of (3.4), (q, q) 1/s^2, diagonal: BlockDiag of Omega_ij = BlockDiag[0, |q2'|^2/L^2 I].

    Parameters
    ----------
    q, v : m, m/s
    lengths, d : as for `H_matrix`
    """
    _, q2 = rod_halves(q, d)
    _, v2 = rod_halves(v, d)
    spin = (v2 * v2).sum(axis=1) / _squares(q2, lengths)
    entries = np.zeros((len(q2), 2, d))
    entries[:, 1] = spin[:, None]
    return sparse.diags_array(entries.ravel())


def newton_euler_residual(
    q: Float[np.ndarray, " q"],
    v: Float[np.ndarray, " q"],
    acceleration: Float[np.ndarray, " q"],
    f: Float[np.ndarray, " q"],
    mass: Float[np.ndarray, " rods"],
) -> dict[str, np.ndarray]:
    """What is left of the equations (3.2), (3.3) that (3.1) solves.

    Parameters
    ----------
    q, v, acceleration : m, m/s, m/s^2
    f : N, sums and differences of end forces (2.15)
    mass : kg

    Returns
    -------
    dict
        translation (m/2) q1'' - (f1 + f2), N; rotation (m/6) q2 x q2'' - q2 x (f2 - f1), N m;
        length q2'.q2' + q2.q2'', m^2/s^2. Each (rods, 3) or (rods,).
    """
    _, q2 = rod_halves(q)
    _, v2 = rod_halves(v)
    a1, a2 = rod_halves(acceleration)
    total, difference = rod_halves(f)
    m = np.asarray(mass, float)[:, None]
    return {
        "translation": m / 2 * a1 - total,
        "rotation": m / 6 * np.cross(q2, a2) + np.cross(q2, difference),
        "length": (v2 * v2).sum(axis=1) + (q2 * a2).sum(axis=1),
    }


def _squares(q2: np.ndarray, lengths: np.ndarray | None) -> np.ndarray:
    return (q2 * q2).sum(axis=1) if lengths is None else np.asarray(lengths, float) ** 2
