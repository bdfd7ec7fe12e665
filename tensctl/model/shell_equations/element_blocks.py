"""Blocks of nodal forces for one element ([S] (E.5)-(E.16), (C.2)-(C.4)), derived from the topology.

    block = -W S',   S = ends of the source's tendons among the target's nodes (+1 head, -1 tail)
    W = [1 1 0 0; 1 -1 0 0; 0 0 1 1; 0 0 1 -1] x I_3

Rows are (f1 + f2, f1 - f2, f3 + f4, f3 - f4) of the target, columns f2 f3 f4 f6 f7 f8 f9 f10 (d) or f5 f1 (0) of the
source. Each tendon acts once: f9 of the first stage and f10 of the last have columns of zeros, and so has f1 in
B0_n1, since f_1n1 comes first in f^d. (E.6)-(E.8) and (E.11)-(E.15) are lost in the scan; their blocks are rebuilt
here. The printed Bd_n1 of (E.5) leaves f10 out, and the printed B_1n1 of (C.2) is [I; 0; 0] for [I; I; 0; 0].
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from tensctl.errors import StructureError
from tensctl.model.shell_equations.blocks import times_identity
from tensctl.model.shell_equations.layout import DEPENDENT, INDEPENDENT, absent_numbers, ends_at

SUM_DIFFERENCE = np.array([[1, 1, 0, 0], [1, -1, 0, 0], [0, 0, 1, 1], [0, 0, 1, -1]])


class Source(NamedTuple):
    """Where the forces of a block come from: tendons, offset of their end in the target, kind of their stage."""

    numbers: tuple[int, ...]
    end: tuple[int, int]
    first: bool
    last: bool


_D, _O, _ONE = DEPENDENT, INDEPENDENT, (1,)
# An end at offset (+1, 0) of the source lies in the next element, so the source is element i - 1 of the target.
_SOURCES = {
    "Bd_01": Source(_D, (1, 0), True, False),
    "Bd_n1": Source(_D, (1, 0), True, False),
    "Bd_11": Source(_D, (0, 0), True, False),
    "Bd_21": Source(_D, (-1, 0), False, False),
    "Bd_12": Source(_D, (0, -1), False, False),
    "Bd_n1_bar": Source(_D, (1, 1), True, False),
    "Bd_n2": Source(_D, (1, 0), False, False),
    "Bd_12_bar": Source(_D, (0, 0), False, False),
    "Bd_nm": Source(_D, (1, 0), False, True),
    "Bd_1m": Source(_D, (0, 0), False, True),
    "B0_11": Source(_O, (0, 0), True, False),
    "B0_01": Source(_O, (1, 0), True, False),
    "B0_n1": Source(_O, (0, 0), True, False),
    "B0_12": Source(_O, (0, -1), False, False),
    "B_1n1": Source(_ONE, (1, 0), True, False),
    "B_1n1_bar": Source(_ONE, (0, 0), True, False),
    # One stage, base and top at once: Appendix C.
    "Bd_01_hat": Source(_D, (1, 0), True, True),
    "Bd_n1_hat": Source(_D, (1, 0), True, True),
    "Bd_11_hat": Source(_D, (0, 0), True, True),
}

BLOCK_NAMES = (*_SOURCES, "W")


@cache
def force_block(name: str) -> Float[np.ndarray, "12 columns"]:
    """One block by its name in [S], (12, 24), (12, 6), (12, 3), or W (12, 12).

    Parameters
    ----------
    name : B with superscript d or 0, then the subscript, then `bar` or `hat`: "Bd_n1_bar", "B0_12", "B_1n1", "W".
        "Bd_11_hat" is the B^d_11 of Appendix C.

    Raises
    ------
    StructureError
        A name that is none of them.
    """
    if name == "W":
        return _frozen(times_identity(SUM_DIFFERENCE))
    if name not in _SOURCES:
        raise StructureError(f"{name} is no block of Appendix C or E; give one of {', '.join(BLOCK_NAMES)}.")
    source = _SOURCES[name]
    ends = ends_at(source.numbers, source.end, source.first, source.last)
    once = absent_numbers(source.first, source.last, primal=False)
    twice = [alpha in once or (name == "B0_n1" and alpha == 1) for alpha in source.numbers]
    ends[twice] = 0
    return _frozen(times_identity(-SUM_DIFFERENCE @ ends.T))


def _frozen(block: np.ndarray) -> np.ndarray:
    """The block, kept for every later call, so nobody may change it."""
    block.flags.writeable = False
    return block
