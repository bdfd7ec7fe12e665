"""Disturbances of one shape and any amplitude: pushes by their force, kicks by their largest node speed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.scene.given import argument, real
from tensctl.scene.values import Text
from tensctl.simulation.loads import Push


@dataclass(frozen=True, eq=False)
class Kick:
    """Velocities at the start: those of a mode, `Kick("mode 7", linear.modes[6].shape)`, or any that no rod resists.

    Attributes
    ----------
    label : str
    velocities : (N, 3)
        Their directions and ratios; the amplitude is the largest node speed, m/s.
    """

    label: str
    velocities: Float[np.ndarray, "nodes 3"]

    def __post_init__(self) -> None:
        """Check that something moves.

        Raises
        ------
        SimulationError
            Velocities that are not finite (N, 3), or all zero.
        """
        argument("label", self.label, Text(), SimulationError)
        given = real(f"velocities of kick {self.label}", self.velocities, "an (N, 3) array", SimulationError)
        if given.ndim != 2 or given.shape[1] != 3 or not np.isfinite(given).all() or not given.any():
            raise SimulationError(
                f'the velocities of kick "{self.label}" have shape {given.shape}; finite (N, 3), not all zero, are '
                "expected."
            )


Disturbance = Push | Kick


def label_of(disturbance: Disturbance) -> str:
    """What it is, without its amplitude: `P4_1_1 (1, 0, 0) 0.1 s`, or the label of a kick."""
    if isinstance(disturbance, Kick):
        return disturbance.label
    way = ", ".join(f"{part:.3g}" for part in _direction(disturbance.force))
    return f"{disturbance.node} ({way}) {disturbance.stop - disturbance.start:g} s"


def unit_of(disturbance: Disturbance) -> str:
    """Unit of the amplitude."""
    return "m/s" if isinstance(disturbance, Kick) else "N"


def pushes_of(disturbance: Disturbance, amplitude: float) -> tuple[Push, ...]:
    """The forces of a disturbance of this amplitude; none of a kick."""
    if isinstance(disturbance, Kick):
        return ()
    return (replace(disturbance, force=(amplitude * _direction(disturbance.force)).tolist()),)


def velocities_of(
    disturbance: Disturbance, amplitude: float, nodes: Float[np.ndarray, "nodes 3"]
) -> Float[np.ndarray, "nodes 3"]:
    """Node velocities at the start, m/s; none under a push."""
    if not isinstance(disturbance, Kick):
        return np.zeros_like(nodes)
    given = np.asarray(disturbance.velocities, float)
    return amplitude / np.linalg.norm(given, axis=1).max() * given


def over_at(disturbance: Disturbance) -> float:
    """When it has ended, s."""
    return 0.0 if isinstance(disturbance, Kick) else float(disturbance.stop)


def _direction(force) -> np.ndarray:
    force = np.asarray(force, float)
    size = np.linalg.norm(force)
    if not size > 0:
        raise SimulationError("a push without a force has no direction; give force = (1, 0, 0) or another direction.")
    return force / size
