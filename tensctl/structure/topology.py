"""Which node ends which tendon in the (n,m) shell class.

One row per tendon vector t_alpha,ij = head - tail, with node names P1..P4 of element ij and i cyclic.
Every statement of [S] about connection ((2.2)-(2.14), (4.11), Appendices C and E) follows from this table.
"""

from __future__ import annotations

from typing import NamedTuple


class End(NamedTuple):
    """One end of a tendon: node P`number` of element (i + di, j + dj)."""

    number: int
    di: int = 0
    dj: int = 0


class Tendon(NamedTuple):
    """Tendon number `alpha` of an element, from tail to head."""

    alpha: int
    head: End
    tail: End


# [S] Figs. 5-7 and rules of closure; first and last stages differ from the ones between.
_T1 = {True: Tendon(1, End(2), End(1, +1)), False: Tendon(1, End(2), End(4, 0, -1))}
_T2 = {True: Tendon(2, End(1), End(1, +1)), False: Tendon(2, End(1), End(4, 0, -1))}
_T3 = Tendon(3, End(3, -1), End(1))
_T4 = Tendon(4, End(2), End(3, -1))
_T5 = Tendon(5, End(4), End(2))
_T6 = {True: Tendon(6, End(4, +1), End(4)), False: Tendon(6, End(1, +1, +1), End(4))}
_T7 = {True: Tendon(7, End(3), End(4, +1)), False: Tendon(7, End(3), End(1, +1, +1))}
_T8 = Tendon(8, End(2), End(3))
_T9 = Tendon(9, End(1, +1), End(2))
_T10 = Tendon(10, End(4, +1), End(3))


def element_tendons(first: bool, last: bool, *, primal: bool) -> tuple[Tendon, ...]:
    """Tendons of one element, in order of alpha.

    Parameters
    ----------
    first, last : bool
        Whether the element stands in stage j = 1, in stage j = m (both when m = 1).
    primal : bool
        Leave out t9 and t10 ([S] Definition 2.6).
    """
    tendons = [_T1[first], _T2[first], _T3, _T4, _T5, _T6[last], _T7[last], _T8]
    if not primal:
        # t9 of the first stage is its t1 reversed, t10 of the last stage its t7 reversed: kept once.
        tendons += [] if first else [_T9]
        tendons += [] if last else [_T10]
    return tuple(tendons)


def node_index(number: int, i: int, j: int, n: int) -> int:
    """Index from 0 of node P_number(i, j); i is cyclic in 1..n, j counts from 1."""
    return 4 * ((j - 1) * n + (i - 1) % n) + number - 1


def class_two_joints(n: int, m: int) -> list[tuple[int, int]]:
    """Pairs of nodes that a class 2 shell closes to one, by index.

    [S] (2.1) prints the range m > j > 1, which leaves the first and last rings open; the two independent conditions are
    P4(i, j-1) = P3(i-1, j) for j = 2..m and P2(i, j) = P1(i+1, j+1) for j = 1..m-1.
    """
    pairs = []
    for j in range(1, m):
        for i in range(1, n + 1):
            pairs.append((node_index(4, i, j, n), node_index(3, i - 1, j + 1, n)))
            pairs.append((node_index(2, i, j, n), node_index(1, i + 1, j + 1, n)))
    return pairs
