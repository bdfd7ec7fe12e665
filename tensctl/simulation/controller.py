"""What a controller is shown, and what it must answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.synthesis import Sensors


@dataclass(frozen=True, eq=False)
class Measurement:
    """What a controller is shown.

    Attributes
    ----------
    nodes, velocities : (N, 3) m, m/s
    lengths, tensions : (nt,) m, N
    inputs : (nu,) m
        Rest-length changes u as they are now.
    commands : (nu,) m, optional
        Those that were asked for until now; `inputs` without lag.
    """

    nodes: Float[np.ndarray, "nodes 3"]
    velocities: Float[np.ndarray, "nodes 3"]
    lengths: Float[np.ndarray, " tendons"]
    tensions: Float[np.ndarray, " tendons"]
    inputs: Float[np.ndarray, " inputs"]
    commands: Float[np.ndarray, " inputs"] | None = None


class Controller(Protocol):
    """Anything that turns measurements into the total rest-length change u.

    One that has `sensors` is shown what they read at each sample, with their noise, in place of the measurement.
    """

    def step(self, t: float, measurement: Any) -> np.ndarray:
        """Total rest-length change u from L0, (nu,) m, to be reached at the end of the period."""
        ...

    def reset(self) -> None:
        """Forget what earlier runs left behind."""
        ...


@runtime_checkable
class Remembering(Protocol):
    """A controller whose memory can be stored, so that a run under it can be resumed."""

    def state(self) -> dict[str, np.ndarray]:
        """All that it remembers of earlier steps, as arrays."""
        ...

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Remember this."""
        ...


def ask(controller: Controller, t: float, period: float, measurement: Measurement) -> np.ndarray:
    """The controller's answer at a sample, from all of the measurement or from what its sensors read."""
    sensors = getattr(controller, "sensors", None)
    if isinstance(sensors, Sensors):
        return controller.step(t, sensors.read(measurement, round(t / period)))
    return controller.step(t, measurement)


def memory_of(controller: Controller | None) -> dict[str, np.ndarray]:
    """What a controller remembers, when it says."""
    held = controller.state() if isinstance(controller, Remembering) else {}
    return {f"controller.{name}": np.asarray(value) for name, value in held.items()}


def remember(controller: Controller, state: dict[str, np.ndarray]) -> None:
    """Let a controller remember what `memory_of` gave.

    Raises
    ------
    SimulationError
        For a controller that cannot.
    """
    if not isinstance(controller, Remembering):
        raise SimulationError(
            "the controller has no state() and restore(), so its memory is not in the file; start the run again."
        )
    controller.reset()
    mine = {name: value for name, value in state.items() if name.startswith("controller.")}
    controller.restore({name.removeprefix("controller."): value for name, value in mine.items()})
