"""Rules of closure, and nodal forces written for the typical element ([S] (2.1)-(2.14), (E.1)-(E.4)).

    P1: -f6_(i-1)(j-1) + f7_(i-1)(j-1) - f9_(i-1)j - f2_ij + f3_ij + w1                                      (E.3)
    P2: -f1_ij - f4_ij + f5_ij - f8_ij + f9_ij + w2
    P3: -f7_ij + f8_ij + f10_ij - f3_(i+1)j + f4_(i+1)j + w3
    P4: -f5_ij + f6_ij - f10_(i-1)j + f1_i(j+1) + f2_i(j+1) + w4

(E.3) at j = 1 is (E.1) and at j = m is (E.4), if members outside 1 <= j <= m are zero except

    f6_i0 = -f2_i1 for every i,   f2_i(m+1) = -f6_(i-1)m for every i

and the copies f9_i1 = -f1_i1 (2.2), f10_im = -f7_im (2.7) act at P1 and P4 alone: at P2 and P3 the tendon is there
already. [S] prints f6_i0 = 0 (2.3) with an exception for i = n only (2.4), and t2_i(m+1) = 0 (2.9); with these the
base ring loses n - 1 of its forces f2 and the top ring all of its forces -f6.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float

Rules = Literal["corrected", "printed"]


def closure_residuals(t: Float[np.ndarray, "11 m n 3"]) -> dict[str, np.ndarray]:
    """What is left of the rules that join two vectors, m, by equation number; all zero for any nodes.

    (2.5) and (2.8) are (2.2) and (2.7) at i = n; (2.11) and (2.12) say that i is cyclic, which an index from 1 to n
    has built in; (2.3), (2.6), (2.9), (2.10), (2.13), (2.14) are about members that do not exist.
    """
    return {
        "2.2": t[9, 0] + t[1, 0],
        "2.5": t[9, 0, -1] + t[1, 0, -1],
        "2.7": t[10, -1] + t[7, -1],
        "2.8": t[10, -1, -1] + t[7, -1, -1],
    }


def class_two_gaps(t: Float[np.ndarray, "11 m n 3"]) -> dict[str, np.ndarray]:
    """The four constraints (2.1) of a Class 2 shell, m: the first two for j = 2..m, the last two for j = 1..m-1.

    Two are independent: -t1 + t4 = -(t2 + t3) = P4_i(j-1) - P3_(i-1)j and t5 + t6 = -(t7 + t8) = P1_(i+1)(j+1) - P2_ij.
    The printed range m > j > 1 leaves the first and last rings open and closes nothing at m = 2.
    """
    return {
        "-t1 + t4": -t[1, 1:] + t[4, 1:],
        "t2 + t3": t[2, 1:] + t[3, 1:],
        "t5 + t6": t[5, :-1] + t[6, :-1],
        "t7 + t8": t[7, :-1] + t[8, :-1],
    }


def closed_forces(f: Float[np.ndarray, "11 m n 3"], rules: Rules = "corrected") -> Float[np.ndarray, "11 m2 n 3"]:
    """Forces with stages 0 and m + 1 filled in by the rules of closure, N; stage j has index j."""
    _, m, n, _ = f.shape
    closed = np.zeros((11, m + 2, n, 3))
    closed[:, 1:-1] = f
    closed[9, 1], closed[10, m] = -f[1, 0], -f[7, -1]
    if rules == "corrected":
        closed[6, 0] = -f[2, 0]
        closed[2, m + 1] = -np.roll(f[6, -1], 1, axis=0)
    else:
        closed[6, 0, n - 1] = -f[2, 0, n - 1]
    return closed


def nodal_forces(
    f: Float[np.ndarray, "11 m n 3"], w: Float[np.ndarray, "m n 4 3"] | float = 0.0, *, rules: Rules = "corrected"
) -> Float[np.ndarray, "m n 4 3"]:
    """Forces on the four nodes of every element, N ((E.1)-(E.4)), from the vectors f[alpha, j - 1, i - 1].

    Parameters
    ----------
    f : N, F t/|t| of each tendon; f9 at j = 1 and f10 at j = m are not read.
    w : N, external forces on the nodes.
    rules : "printed" takes (2.3), (2.4) and (2.9) as they stand, for comparison.
    """
    g = closed_forces(f, rules)
    here, above = g[:, 1:-1], g[:, 2:]
    left, right = np.roll(here, 1, axis=2), np.roll(here, -1, axis=2)
    left_below = np.roll(g[:, :-2], 1, axis=2)
    # At the base t9 acts on P2 as t1 already, at the top t10 on P3 as t7.
    own9, own10 = here[9].copy(), here[10].copy()
    own9[0], own10[-1] = 0.0, 0.0
    p1 = -left_below[6] + left_below[7] - left[9] - here[2] + here[3]
    p2 = -here[1] - here[4] + here[5] - here[8] + own9
    p3 = -here[7] + here[8] + own10 - right[3] + right[4]
    p4 = -here[5] + here[6] - left[10] + above[1] + above[2]
    return np.stack([p1, p2, p3, p4], axis=2) + w


def sums_and_differences(nodal: Float[np.ndarray, "m n 4 3"]) -> Float[np.ndarray, " f"]:
    """The vector f of (2.15): (f1 + f2, f1 - f2, f3 + f4, f3 - f4) of each element, N."""
    f1, f2, f3, f4 = np.moveaxis(nodal, 2, 0)
    return np.stack([f1 + f2, f1 - f2, f3 + f4, f3 - f4], axis=2).ravel()
