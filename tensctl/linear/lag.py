"""Lag of actuators: when it is part of a model, by the phase omega tau that rest lengths are behind; the model then."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, TypeVar

from tensctl.model import Dynamics

# Least phase in rad at the fastest frequency. Without it 1e-10 of a model would change, and a model that has the lag
# all the same is stiff: a filter's states at rest then move by 4e-9 of themselves.
_FELT = 1e-9


T = TypeVar("T")


def lag_felt(dynamics: Dynamics, fastest: float) -> bool:
    """Whether the scene's actuators lag by a phase worth a state, at the fastest frequency, rad/s."""
    return dynamics.members.lag * fastest > _FELT


def recast(model: Any, kind: type[T]) -> T:
    """The same model as another kind of it: with actuators, or without."""
    return kind(*(getattr(model, field.name) for field in fields(model)))
