"""Members by label: patterns with `*` choose them, tables by pattern give them values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np
from jaxtyping import Bool, Float

from tensctl.errors import StructureError


def matches(labels: Sequence[str], pattern: str, key: str) -> list[int]:
    """Indices of the labels that a pattern names.

    Raises
    ------
    StructureError
        When none does; the sentence names the key, the pattern and the nearest label.
    """
    found = [i for i, label in enumerate(labels) if fnmatchcase(label, pattern)]
    if not found:
        near = difflib.get_close_matches(pattern, labels, n=1, cutoff=0.0)
        hint = f"; the nearest label is {near[0]}" if near else ""
        raise StructureError(f'{key}: "{pattern}" names nothing in this structure{hint}.')
    return found


def select(labels: Sequence[str], patterns: Iterable[str], key: str) -> Bool[np.ndarray, " labels"]:
    """Mask of the labels that any of the patterns names."""
    chosen = np.zeros(len(labels), bool)
    for pattern in patterns:
        chosen[matches(labels, pattern, key)] = True
    return chosen


def by_label(
    labels: Sequence[str], values: float | Mapping[str, float], key: str, default: float | None = None
) -> Float[np.ndarray, " labels"]:
    """One value a label, from a number or a table by pattern; later patterns win.

    Parameters
    ----------
    default : float, optional
        Value of the labels that no pattern names; without one they are an error.
    """
    if not isinstance(values, Mapping):
        return np.full(len(labels), float(values))
    result = np.full(len(labels), np.nan if default is None else default)
    for pattern, value in values.items():
        result[matches(labels, pattern, key)] = value
    missing = np.isnan(result)
    if missing.any():
        raise StructureError(
            f'{key}: no entry for {labels[int(missing.argmax())]}; add it, or a first line "*" = value for all others.'
        )
    return result
