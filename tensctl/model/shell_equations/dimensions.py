"""Sizes of all matrices of the model for any (n, m); Appendix D of [S] prints those of (3, 1)."""

from __future__ import annotations

from tensctl.model.shell_equations.layout import check_size


def dimensions(n: int, m: int, *, primal: bool = False) -> dict[str, tuple[int, int]]:
    """Shape (rows, columns) of each matrix by its name in [S]; a primal shell has fewer columns in T and B alone."""
    check_size(n, m)
    q, d, o = 12 * n * m, 24 * n * m + 3, 6 * n * m
    members, inputs = 10 * n * m + 1, 8 * n * m if primal else n * (10 * m - 2)
    return {
        "Q": (q, q),
        "R": (d, q),
        "H": (q, q),
        "K_r": (q, q),
        "B^d": (q, d),
        "K^d": (d, q),
        "P^d": (d, d // 3),
        "B^0": (q, o),
        "K^0": (o, q),
        "P^0": (o, o // 3),
        "W^0": (q, q),
        "K~": (q, q),
        "B~": (q, members),
        "T": (members, inputs),
        "K_p": (q, q),
        "B": (q, inputs),
        "D": (q, q),
        "P": (q, q),
    }
