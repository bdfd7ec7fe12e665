"""Members by label: patterns with `*` choose them, tables by pattern give them values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase

import numpy as np
from jaxtyping import Bool, Float

from tensctl.errors import StructureError


def names_of(label: str) -> tuple[str, ...]:
    """The label itself, and the labels of its parts when it was merged from several (`t1_2_2+t4_2_2`)."""
    return (label, *label.split("+")) if "+" in label else (label,)


def matches(labels: Sequence[str], pattern: str, key: str) -> list[int]:
    """Indices of the labels that a pattern names.

    Raises
    ------
    StructureError
        When none does; the sentence names the key, the pattern and the nearest label. "*" may name nothing.
    """
    found = [i for i, label in enumerate(labels) if any(fnmatchcase(name, pattern) for name in names_of(label))]
    if not found and pattern != "*":
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


def by_part(
    labels: Sequence[str], values: float | Mapping[str, float], key: str, default: float | None = None
) -> list[Float[np.ndarray, " parts"]]:
    """The values of `by_label`, one array a label with one entry for each of its parts."""
    parts = [label.split("+") for label in labels]
    flat = by_label([name for names in parts for name in names], _spread(values, labels), key, default)
    last = np.cumsum([len(names) for names in parts])
    return [flat[end - len(names) : end] for end, names in zip(last, parts, strict=True)]


def _spread(values: float | Mapping[str, float], labels: Sequence[str]) -> float | Mapping[str, float]:
    """A table whose whole labels of merged members are spelled out as their parts."""
    if not isinstance(values, Mapping):
        return values
    whole = {label for label in labels if "+" in label}
    return {name: value for key, value in values.items() for name in (key.split("+") if key in whole else (key,))}
