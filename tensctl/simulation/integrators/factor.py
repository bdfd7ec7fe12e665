"""A = L U of a matrix whose rows end somewhere: Gaussian elimination within the rows' own reach.

    A (n, n), row i is zero left of left[i] and from right[i] on

A pivot is taken from below only when it is ten times the diagonal: rows of masses and stiffness have the larger part of
it on their diagonal, and a swap lets rows reach further. A dense matrix is the case left = 0, right = n.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tensctl.jit import jit

# Part of the largest entry of a column from which the diagonal is kept as the pivot; elements grow at most by
# 1 + 1/_KEEP a step, and hardly ever do.
_KEEP = 0.1


class Envelope(NamedTuple):
    """Where the entries of a matrix are.

    Attributes
    ----------
    left, right : (n,) int
        First column of each row, and the one behind its last.
    low : (n,) int
        Row behind the last that has an entry in a column, or in one before it.
    """

    left: np.ndarray
    right: np.ndarray
    low: np.ndarray


@jit
def factor(A, envelope, left, right, order):
    """Replace A by L and U, rows swapped as `order` says; left and right tell how far they reach then."""
    n = A.shape[0]
    for i in range(n):
        left[i], right[i], order[i] = envelope.left[i], envelope.right[i], i
    for k in range(n):
        low = envelope.low[k]
        best, at = abs(A[k, k]), k
        for i in range(k + 1, low):
            if _KEEP * abs(A[i, k]) > best:
                best, at = _KEEP * abs(A[i, k]), i
        if at != k:
            # The largest of the column, not the first that is large enough.
            for i in range(k + 1, low):
                if abs(A[i, k]) > abs(A[at, k]):
                    at = i
            for j in range(min(left[k], left[at]), max(right[k], right[at])):
                A[k, j], A[at, j] = A[at, j], A[k, j]
            left[k], left[at] = left[at], left[k]
            right[k], right[at] = right[at], right[k]
            order[k], order[at] = order[at], order[k]
        end, inverse = right[k], 1.0 / A[k, k]
        pivot = A[k]
        for i in range(k + 1, low):
            if A[i, k] != 0.0:
                row = A[i]
                share = row[k] * inverse
                row[k] = share
                for j in range(k + 1, end):
                    row[j] -= share * pivot[j]
                right[i] = max(right[i], end)


@jit
def dot(row, x, start, end):
    """Sum of row[j] x[j] from start to end, in four parts that need not wait for each other."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    j = start
    while j + 4 <= end:
        a += row[j] * x[j]
        b += row[j + 1] * x[j + 1]
        c += row[j + 2] * x[j + 2]
        d += row[j + 3] * x[j + 3]
        j += 4
    while j < end:
        a += row[j] * x[j]
        j += 1
    return (a + b) + (c + d)


@jit
def solve(A, left, right, order, b, x):
    """Fill x with the solution of A x = b from the factors."""
    n = A.shape[0]
    for i in range(n):
        x[i] = b[order[i]] - dot(A[i], x, left[i], i)
    for i in range(n - 1, -1, -1):
        x[i] = (x[i] - dot(A[i], x, i + 1, right[i])) / A[i, i]
