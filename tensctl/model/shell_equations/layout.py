"""In which order [S] stacks its vectors, and which node ends which tendon of an element.

    f^d, l^d   t1_n1 first, then t2 t3 t4 t6 t7 t8 t9 t10 of each element   8nm + 1     (2.15), (4.17)
    f^0        t5 t1 of each element                                        2nm         (2.15)
    u~         f^d's members, then f^0's                                    10nm + 1    (5.16)
    u          the tendons that exist, each once                            n(10m - 2)  (5.16), (5.19), (5.20)

Elements go by stage j, then i. u~ holds copies: t1_n1 twice, t9_i1 = -t1_i1 and t10_im = -t7_im.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Int

from tensctl.errors import StructureError
from tensctl.structure.topology import Tendon, element_tendons

DEPENDENT = (2, 3, 4, 6, 7, 8, 9, 10)
"""Numbers alpha of f_ij^d and t_ij^d, in their order (2.15), (4.12)."""

INDEPENDENT = (5, 1)
"""Numbers alpha of f_ij^0, in their order (2.15)."""


class Member(NamedTuple):
    """Tendon t_alpha,ij; i and j count from 1, as in [S]."""

    alpha: int
    i: int
    j: int

    @property
    def label(self) -> str:
        """The label that the project's structure gives to it."""
        return f"t{self.alpha}_{self.i}_{self.j}"


def check_size(n: int, m: int) -> None:
    """Refuse sizes that make no shell.

    Raises
    ------
    StructureError
        For n < 3 or m < 1.
    """
    if n < 3 or m < 1:
        raise StructureError(f"(n, m) = ({n}, {m}): the shell class has n >= 3 elements around and m >= 1 stages.")


def elements(n: int, m: int) -> list[tuple[int, int]]:
    """Pairs (i, j) in the order of q, f and w."""
    return [(i, j) for j in range(1, m + 1) for i in range(1, n + 1)]


def dependent_members(n: int, m: int) -> list[Member]:
    """Members of f^d and l^d, t_1n1 first (2.15), (4.17)."""
    return [Member(1, n, 1), *(Member(alpha, i, j) for i, j in elements(n, m) for alpha in DEPENDENT)]


def independent_members(n: int, m: int) -> list[Member]:
    """Members of f^0 (2.15)."""
    return [Member(alpha, i, j) for i, j in elements(n, m) for alpha in INDEPENDENT]


def all_members(n: int, m: int) -> list[Member]:
    """Members of u~, 10nm + 1 of them (5.16)."""
    return dependent_members(n, m) + independent_members(n, m)


def input_members(n: int, m: int, *, primal: bool = False) -> list[Member]:
    """Members of u (5.16), (5.19), (5.20): t9 is left out at j = 1, t10 at j = m, both everywhere in a primal shell."""
    dependent = dependent_members(n, m)[1:]
    kept = [t for t in dependent if t.alpha not in absent_numbers(t.j == 1, t.j == m, primal=primal)]
    return kept + independent_members(n, m)


def absent_numbers(first: bool, last: bool, *, primal: bool) -> tuple[int, ...]:
    """Numbers that name no tendon of their own in a stage: copies ((2.2), (2.7)) or left out (Definition 2.6)."""
    return (9,) * (first or primal) + (10,) * (last or primal)


def original(member: Member, m: int) -> Member:
    """The tendon that a member of u~ is, or is the reversed copy of ((2.2), (2.7))."""
    if member.alpha == 9 and member.j == 1:
        return member._replace(alpha=1)
    if member.alpha == 10 and member.j == m:
        return member._replace(alpha=7)
    return member


def ten_tendons(first: bool, last: bool) -> dict[int, Tendon]:
    """All ten vectors of an element by number, the reversed copies of (2.2) and (2.7) among them."""
    ten = {tendon.alpha: tendon for tendon in element_tendons(first, last, primal=False)}
    if first:
        ten[9] = Tendon(9, head=ten[1].tail, tail=ten[1].head)
    if last:
        ten[10] = Tendon(10, head=ten[7].tail, tail=ten[7].head)
    return ten


def ends_at(numbers: tuple[int, ...], offset: tuple[int, int], first: bool, last: bool) -> Int[np.ndarray, "numbers 4"]:
    """Ends of an element's tendons among the four nodes of the element at (i, j) + offset: +1 head, -1 tail.

    Every constant matrix of [S] about connection is made of these: t_ij = sum over offsets of ends_at @ p (4.11), and
    a tendon's force f acts with -ends_at' on the nodes, + on its tail ((E.1)-(E.4)).
    """
    ten, result = ten_tendons(first, last), np.zeros((len(numbers), 4), int)
    for row, alpha in enumerate(numbers):
        for end, sign in ((ten[alpha].head, 1), (ten[alpha].tail, -1)):
            if (end.di, end.dj) == offset:
                result[row, end.number - 1] += sign
    return result
