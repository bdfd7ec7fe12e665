"""What every integrator is: it moves rods through given times under given inputs, and records them there."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Protocol

import numpy as np

from tensctl.simulation.drive import Drive


class Integrator(Protocol):
    """Moves the rods' state through times.

    What it carries from one march to the next are numbers among its fields, so a run that is stored can go on.

    Attributes
    ----------
    name : str
    evaluations, switches : int
        Right-hand sides computed, and slack-taut switches seen to, so far.
    local_errors : float, m
        Sum of the errors that were estimated of its steps so far; nan for one that does not judge its steps.
    """

    evaluations: int
    switches: int
    local_errors: float

    @property
    def name(self) -> str:
        """Name of the method."""
        ...

    def march(
        self, q: np.ndarray, v: np.ndarray, times: np.ndarray, drive: Drive, out_q: np.ndarray, out_v: np.ndarray
    ) -> None:
        """Move q and v, (nr, 6), in place from times[0] to times[-1] and write row k of out_q and out_v at times[k].

        Row 0 is not written: the state there is known to whoever asks.

        Raises
        ------
        SimulationError
            When the motion cannot be followed, with what to try.
        """
        ...


def carried_by(integrator: Integrator) -> list[tuple[str, int | float]]:
    """Numbers among an integrator's fields, with their names."""
    held = [(f.name, getattr(integrator, f.name)) for f in fields(integrator)] if is_dataclass(integrator) else []
    return [(name, value) for name, value in held if isinstance(value, int | float)]
