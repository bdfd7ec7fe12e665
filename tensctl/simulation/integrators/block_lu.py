"""Sparse factors of a matrix of 5 x 5 blocks, one row of blocks a rod: where they fill is planned once.

    for each rod k in order:   D_k <- A_kk^-1,   L_ik = A_ik D_k,   A_ij <- A_ij - L_ik A_kj

Order: minimum degree on the graph of rods. Pivots are chosen within a rod's own block only. The matrices here are
M/(h g)^2 + C/(h g) + K, whose symmetric part is positive for all but long steps, so that is enough; a block that
cannot be inverted fails the step, and a shorter one is taken.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from tensctl.jit import bare, jit


class Elimination(NamedTuple):
    """Where everything goes; all arrays of ints.

    Attributes
    ----------
    order : (n,) rods as they are eliminated
    size : number of blocks with fill; the first n are the diagonal
    place : (blocks,) where each block of the matrix goes
    start : (n + 1,) where each rod's neighbours begin, in order of elimination
    rows, lower, upper : neighbours i of rod k, and the blocks (i, k) and (k, i)
    target_start : (n + 1,)
    targets : blocks (i, j) for all pairs of neighbours of k, row by row
    """

    order: np.ndarray
    size: int
    place: np.ndarray
    start: np.ndarray
    rows: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    target_start: np.ndarray
    targets: np.ndarray


def plan(rows: np.ndarray, columns: np.ndarray, count: int) -> Elimination:
    """Plan the elimination of a symmetric pattern whose first `count` blocks are the diagonal."""
    near: list[set[int]] = [set() for _ in range(count)]
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        if i != j:
            near[i].add(j)
            near[j].add(i)
    slots = {(k, k): k for k in range(count)}
    order, later = [], []
    heap = [(len(near[k]), k) for k in range(count)]
    heapq.heapify(heap)
    done = np.zeros(count, bool)
    while heap:
        degree, k = heapq.heappop(heap)
        if done[k] or degree != len(near[k]):
            continue
        done[k] = True
        order.append(k)
        neighbours = sorted(near[k])
        later.append(neighbours)
        for i in neighbours:
            slots[i, k], slots[k, i] = len(slots), len(slots) + 1
            near[i].discard(k)
            near[i].update(j for j in neighbours if j != i)
            heapq.heappush(heap, (len(near[i]), i))
    lengths = np.array([len(group) for group in later], np.int64)
    return Elimination(
        np.array(order, np.int64),
        len(slots),
        np.array([slots[i, j] for i, j in zip(rows.tolist(), columns.tolist(), strict=True)], np.int64),
        np.concatenate([[0], np.cumsum(lengths)]),
        np.array([i for group in later for i in group], np.int64),
        np.array([slots[i, k] for k, group in zip(order, later, strict=True) for i in group], np.int64),
        np.array([slots[k, i] for k, group in zip(order, later, strict=True) for i in group], np.int64),
        np.concatenate([[0], np.cumsum(lengths**2)]),
        np.array([slots[i, j] for group in later for i in group for j in group], np.int64),
    )


@bare
def _invert(A, T):
    """Replace the block A (5, 5) by its inverse, by Gauss and Jordan with row pivots in T; False when singular."""
    for i in range(5):
        for j in range(5):
            T[i, j], T[i, 5 + j] = A[i, j], 1.0 if i == j else 0.0
    for k in range(5):
        row = k
        for i in range(k + 1, 5):
            if abs(T[i, k]) > abs(T[row, k]):
                row = i
        if not 0.0 < abs(T[row, k]) < np.inf:
            return False
        if row != k:
            for j in range(10):
                T[k, j], T[row, j] = T[row, j], T[k, j]
        over = 1.0 / T[k, k]
        for j in range(10):
            T[k, j] *= over
        for i in range(5):
            share = T[i, k]
            if i != k and share != 0.0:
                for j in range(10):
                    T[i, j] -= share * T[k, j]
    for i in range(5):
        for j in range(5):
            A[i, j] = T[i, 5 + j]
    return True


@jit
def factor_blocks(order, start, lower, upper, target_start, targets, A):
    """Factor blocks A (size, 5, 5) in place; False when a diagonal block is singular."""
    T, L = np.empty((5, 10)), np.empty((5, 5))
    for n in range(order.size):
        k = order[n]
        D = A[k]
        if not _invert(D, T):
            return False
        first, count = start[n], start[n + 1] - start[n]
        for i in range(count):
            X = A[lower[first + i]]
            for a in range(5):
                for b in range(5):
                    L[a, b] = 0.0
                for c in range(5):
                    x = X[a, c]
                    for b in range(5):
                        L[a, b] += x * D[c, b]
            for a in range(5):
                for b in range(5):
                    X[a, b] = L[a, b]
            at = target_start[n] + i * count
            for j in range(count):
                U, Y = A[upper[first + j]], A[targets[at + j]]
                for a in range(5):
                    for c in range(5):
                        x = L[a, c]
                        for b in range(5):
                            Y[a, b] -= x * U[c, b]
    return True


@jit
def solve_blocks(order, start, rows, lower, upper, A, x):
    """Replace x (n, 5) by the solution."""
    y = np.empty(5)
    for n in range(order.size):
        k = order[n]
        for e in range(start[n], start[n + 1]):
            L, i = A[lower[e]], rows[e]
            for a in range(5):
                total = x[i, a]
                for b in range(5):
                    total -= L[a, b] * x[k, b]
                x[i, a] = total
    for n in range(order.size - 1, -1, -1):
        k = order[n]
        for e in range(start[n], start[n + 1]):
            U, i = A[upper[e]], rows[e]
            for a in range(5):
                total = x[k, a]
                for b in range(5):
                    total -= U[a, b] * x[i, b]
                x[k, a] = total
        D = A[k]
        for a in range(5):
            y[a] = 0.0
            for b in range(5):
                y[a] += D[a, b] * x[k, b]
        for a in range(5):
            x[k, a] = y[a]
