"""When the lag of actuators is part of a model: omega tau, the phase by which rest lengths are behind."""

from __future__ import annotations

from tensctl.model import Dynamics

# Least phase in rad at the fastest frequency. Without it 1e-10 of a model would change, and a model that has the lag
# all the same is stiff: a filter's states at rest then move by 4e-9 of themselves.
_FELT = 1e-9


def lag_felt(dynamics: Dynamics, fastest: float) -> bool:
    """Whether the scene's actuators lag by a phase worth a state, at the fastest frequency, rad/s."""
    return dynamics.members.lag * fastest > _FELT
