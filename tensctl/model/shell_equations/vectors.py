"""Rod and tendon vectors of a shell from its nodes, formula by formula ([S] (4.1)-(4.4), (4.10), (4.11)).

    p1 = rho,   p2 = rho + r1,   p3 = rhohat,   p4 = rhohat + r2                                             (4.3)
    rhohat = rho + r1 + t5 - r2                                                                              (4.2)

Typed as printed and not taken from the topology table, so each checks the other. The second form of t8 in (4.11),
-r1 - t5 + r2, is wrong: p2 - p3 = r2 - t5.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from tensctl.model.shell_equations.layout import check_size


def by_element(nodes: Float[np.ndarray, "nodes 3"], n: int, m: int) -> tuple[np.ndarray, ...]:
    """(rho, r1, rhohat, r2) of every element, each (m, n, 3) m, from nodes in the project's order (4.3)."""
    check_size(n, m)
    p1, p2, p3, p4 = np.moveaxis(np.asarray(nodes, float).reshape(m, n, 4, 3), 2, 0)
    return p1, p2 - p1, p3, p4 - p3


def tendon_vectors(nodes: Float[np.ndarray, "nodes 3"], n: int, m: int) -> Float[np.ndarray, "11 m n 3"]:
    """All vectors t[alpha, j - 1, i - 1] m, by (4.10) and (4.11); t[0] is empty.

    t9 of the first stage and t10 of the last are there too, as (4.11) gives them.
    """
    rho, r1, rhohat, r2 = by_element(nodes, n, m)
    t = np.zeros((11, m, n, 3))
    t[3] = _previous(rhohat) - rho
    t[4] = -t[3] + r1
    t[5] = rhohat - rho - r1 + r2
    t[8] = rho + r1 - rhohat
    t[9] = _next(rho) - (rho + r1)
    t[10] = _next(rhohat) + _next(r2) - rhohat
    # The node below t1 and t2: P4 of the stage below, P1 of the next element at the base ((4.10) for i = n).
    below = np.concatenate([_next(rho)[:1], (rhohat + r2)[:-1]])
    t[1], t[2] = rho + r1 - below, rho - below
    # The node above t6 and t7: P1 of the next element of the stage above, P4 of the next element at the top.
    above = np.concatenate([_next(rho)[1:], _next(rhohat + r2)[-1:]])
    t[6], t[7] = above - (rhohat + r2), rhohat - above
    return t


def base_points(rho_11: np.ndarray, r1: np.ndarray, t1: np.ndarray, t5: np.ndarray) -> Float[np.ndarray, "m n 3"]:
    """Points rho_ij, m, from the independent vectors (4.1); r1, t1, t5 are (m, n, 3) and t1_n1 is not used."""
    around = rho_11 + np.cumsum(r1[0], axis=0)
    around[1:] -= np.cumsum(t1[0, :-1], axis=0)
    up = np.zeros_like(r1)
    up[1:] = np.cumsum(t1[1:] + t5[:-1], axis=0)
    return around + up - r1


def independent_vectors(nodes: Float[np.ndarray, "nodes 3"], n: int, m: int) -> Float[np.ndarray, " l"]:
    """The vector l of (4.8), 12nm entries in m.

    l_11 = (rho_11, r1, r2, t5), l_i1 = (t1_(i-1)1, r1, r2, t5), and above the base l_ij = (r1, r2, t5, t1).
    """
    rho, r1, _, r2 = by_element(nodes, n, m)
    t = tendon_vectors(nodes, n, m)
    lead = np.concatenate([rho[0, :1], t[1, 0, :-1]])
    base = np.stack([lead, r1[0], r2[0], t[5, 0]], axis=1)
    above = np.stack([r1[1:], r2[1:], t[5, 1:], t[1, 1:]], axis=2)
    return np.concatenate([base.ravel(), above.ravel()])


def _next(x: np.ndarray) -> np.ndarray:
    return np.roll(x, -1, axis=1)


def _previous(x: np.ndarray) -> np.ndarray:
    return np.roll(x, 1, axis=1)
