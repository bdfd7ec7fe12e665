"""Tendons between two pinned nodes: nothing moves or steers them, so they must not set the scale of what does move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tensctl.report.numbers import number, plural

if TYPE_CHECKING:
    from tensctl.structure import Structure


_MOST_NAMED = 6


def tension_scale(structure: Structure, tensions: np.ndarray) -> float:
    """Tension (N) of the last colour: the largest of the tendons that can move, or of all when none can."""
    moving = tensions[..., ~structure.grounded_tendons]
    return float(np.max(moving, initial=0.0)) or float(np.max(tensions, initial=0.0)) or 1.0


def beyond_scale(structure: Structure, tensions: np.ndarray) -> str:
    """A sentence about the tendons that the scale of colours does not reach; empty when it reaches all."""
    above = (tensions > tension_scale(structure, tensions)).any(axis=0)
    if not above.any():
        return ""
    most = number(float(np.max(tensions)), 3)
    return f"{plural(int(above.sum()), 'tendon')} between pinned nodes, up to {most} N, in the last colour."


def left_out(structure: Structure) -> str:
    """A sentence naming the tendons that plots over time leave out; empty when there are none."""
    labels = [
        label for label, is_out in zip(structure.tendon_labels, structure.grounded_tendons, strict=True) if is_out
    ]
    if not labels:
        return ""
    more = f" and {len(labels) - _MOST_NAMED} more" if len(labels) > _MOST_NAMED else ""
    return f"Left out, constant between pinned nodes: {', '.join(labels[:_MOST_NAMED])}{more}."
