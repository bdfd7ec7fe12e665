"""Block matrices as [S] prints them: small tables of numbers times I_3, placed on diagonals or around a ring."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from jaxtyping import Float
from scipy import sparse

Block = np.ndarray | sparse.csr_array


def times_identity(table: np.ndarray, d: int = 3) -> Float[np.ndarray, "rows columns"]:
    """Each entry times I_d, as every printed block reads."""
    return np.kron(np.asarray(table, float), np.eye(d))


def shift(n: int, s: int, *, cyclic: bool) -> sparse.csr_array:
    """(n, n) with ones where column = row + s, around the ring when cyclic."""
    row = np.arange(n)
    column = (row + s) % n if cyclic else row + s
    inside = (column >= 0) & (column < n)
    return sparse.csr_array((np.ones(inside.sum()), (row[inside], column[inside])), shape=(n, n))


def kron(places: Block, block: Block) -> sparse.csr_array:
    """The block at every one of `places`."""
    return sparse.csr_array(sparse.kron(sparse.csr_array(places), sparse.csr_array(block), format="csr"))


def ring(n: int, blocks: Mapping[int, Block]) -> sparse.csr_array:
    """Blocks n x n, block[s] in column i + s of row i, i cyclic: the form of B_3, B_5bar, B_6, B_8, R_11, R_12."""
    return total(kron(shift(n, s, cyclic=True), block) for s, block in blocks.items())


def band(count: int, blocks: Mapping[int, Block]) -> sparse.csr_array:
    """The same without the closing corners: BlockDiag is band(count, {0: block})."""
    return total(kron(shift(count, s, cyclic=False), block) for s, block in blocks.items())


def stack(rows: list[list[Block | None]]) -> sparse.csr_array:
    """Blocks side by side and below each other; None is a block of zeros."""
    held = [[None if block is None else sparse.csr_array(block) for block in row] for row in rows]
    return sparse.csr_array(sparse.block_array(held, format="csr"))


def diagonal(blocks: np.ndarray) -> sparse.csr_array:
    """BlockDiag of (count, a, b) dense blocks."""
    count, a, b = blocks.shape
    bsr = sparse.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=(count * a, count * b))
    return sparse.csr_array(bsr)


def total(terms: Iterable[sparse.csr_array]) -> sparse.csr_array:
    """Sum of sparse matrices, without stored zeros."""
    first, *others = terms
    for other in others:
        first = first + other
    first.eliminate_zeros()
    return first
