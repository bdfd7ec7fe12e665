"""A controller that carries an estimate from sample to sample, and is shown what its sensors read."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.synthesis.seen import numbers, sampled_at
from tensctl.synthesis.sensors import Reading


class Estimating:
    """Memory and manners of LQG; the memory holds real arrays, so that runs under it can be stored and resumed."""

    linear: Any
    sensors: Any
    # What designs it.
    design: ClassVar[str] = "lqg"

    def step(self, t: float, measurement: Reading | None) -> Float[np.ndarray, " nu"]:
        """Total rest-length change u from L0, m, kept above the rest-length floors.

        A reading that is None, or has an entry that is no number, tells nothing: the last command goes on, before the
        first one that of the equilibrium, and the estimate begins anew.

        Raises
        ------
        SynthesisError
            For a design in continuous time, a time that is no finite number, or when anything but a reading of these
            sensors is shown.
        """
        sampled_at(t)
        self._check_shown(measurement)
        if measurement is None or not self._tells(measurement):
            last: np.ndarray = self.state().get("command", np.asarray(self.linear.equilibrium.inputs))
            self.restore({"command": last})
            return last
        command, memory = self._answer(measurement, self.state())
        self.restore(memory | {"command": command})
        return command

    def reset(self) -> None:
        """Forget the estimate: the structure is at its equilibrium."""
        self.restore({})

    def state(self) -> dict[str, np.ndarray]:
        """The estimate, the inputs at the last sample and the last command; nothing before the first."""
        return dict(vars(self).get("_memory", {}))

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from this estimate."""
        vars(self)["_memory"] = dict(state)

    @property
    def dt(self) -> float | None:
        """Control period, s; None in continuous time."""
        raise NotImplementedError

    def _answer(
        self, reading: Reading, last: dict[str, np.ndarray]
    ) -> tuple[Float[np.ndarray, " nu"], dict[str, np.ndarray]]:
        """The command, and the estimate and inputs to remember."""
        raise NotImplementedError

    def _check_shown(self, measurement: object) -> None:
        if self.dt is None:
            raise SynthesisError(
                f"this LQG was designed in continuous time; give {self.design} a control period dt to run it."
            )
        if measurement is None:
            return
        shapes = self.sensors.noise.shape, self.linear.equilibrium.inputs.shape
        if not isinstance(measurement, Reading) or shapes != (
            np.shape(measurement.values),
            np.shape(measurement.inputs),
        ):
            raise SynthesisError(
                f"LQG is shown what its {shapes[0][0]} sensors read, and {shapes[1][0]} inputs; give "
                "step(t, lqg.sensors.read(measurement, sample))."
            )

    def _tells(self, reading: Reading) -> bool:
        commands = reading.commands if self.linear.lag else None
        parts = (reading.values, reading.inputs if commands is None else commands)
        return all(numbers(part).all() for part in parts)
