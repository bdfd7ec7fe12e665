"""Tendons on the slack boundary, l = L: the structure has two linear models there, one on each side.

A tendon stands there when double precision cannot tell its side: k |l - L| is not above what tensions may be wrong by,
as rounding of the nodes and the residual of the rest leave it. A stiff tendon of moderate tension is taut, however
small its stretch is beside its length.

A tendon taken as taut or as slack has its rest length moved off the boundary, L = l (1 -+ 2e-14): far enough to be told
from rounding, and too little to change a force by more than that part of k l. Its stiffness, damper and input are then
those of the side that was asked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Literal

import numpy as np

from tensctl.errors import LinearizationError
from tensctl.statics import Equilibrium
from tensctl.statics.stability import unknown_force
from tensctl.structure import matches

Side = Literal["refuse", "taut", "slack"]
_SIDES = ("refuse", "taut", "slack")

# A stretch above this part of the length is certain, whatever forces elsewhere are wrong by.
_CERTAIN = 1e-9
# A stretch below this part of the length is its rounding.
_ROUNDING = 1e-14
# Above the 1e-14 below which a stretch is rounding, and too small for the tension to show as stiffness.
_ASIDE = 2e-14


def one_sided(equilibrium: Equilibrium, on_boundary: Side | Mapping[str, Side]) -> Equilibrium:
    """The equilibrium with every tendon of the boundary on the side asked for; itself where none stands there.

    Parameters
    ----------
    on_boundary : "refuse", "taut", "slack", or a table of these by label pattern
        A later pattern wins; tendons that no pattern names are refused.

    Raises
    ------
    LinearizationError
        A tendon on the boundary that is to be refused, or an unknown side.
    """
    labels = equilibrium.structure.tendon_labels
    sides = _sides(labels, on_boundary)
    stretch = equilibrium.lengths - equilibrium.rest_lengths
    edge = _on_edge(equilibrium, np.abs(stretch)) & ~equilibrium.structure.grounded_tendons
    # Where nothing pulls at all and no side is asked for, that itself is what is said.
    refused = edge & (sides == "refuse") & (not equilibrium.point.at_ease)
    if refused.any():
        first = int(refused.argmax())
        raise LinearizationError(
            f"tendon {labels[first]} is {stretch[first]:.1e} m from slack, so the structure has two linear models "
            'here; change its rest length a little, or choose a side with on_boundary="taut" or "slack".'
        )
    rest = equilibrium.rest_lengths.copy()
    taut, slack = edge & (sides == "taut"), edge & (sides == "slack")
    rest[taut] = np.minimum(rest, equilibrium.lengths * (1 - _ASIDE))[taut]
    rest[slack] = np.maximum(rest, equilibrium.lengths * (1 + _ASIDE))[slack]
    return equilibrium if (rest == equilibrium.rest_lengths).all() else replace(equilibrium, rest_lengths=rest)


def _on_edge(equilibrium: Equilibrium, stretch: np.ndarray) -> np.ndarray:
    """Tendons whose side is not known."""
    near, rounding = (stretch <= part * equilibrium.lengths for part in (_CERTAIN, _ROUNDING))
    if not near.any():
        return near
    members = equilibrium.potential.members
    stiffness = members.stiffness if members.law == "k" else members.stiffness / equilibrium.rest_lengths
    return near & (rounding | (stiffness * stretch <= unknown_force(equilibrium.point)))


def _sides(labels: tuple[str, ...], asked: str | Mapping[str, str]) -> np.ndarray:
    table = {"*": asked} if isinstance(asked, str) else asked
    sides = np.full(len(labels), "refuse")
    for pattern, side in table.items():
        if side not in _SIDES:
            raise LinearizationError(f'on_boundary is "{side}"; expected one of {", ".join(_SIDES)}.')
        sides[matches(labels, pattern, "on_boundary")] = side
    return sides
