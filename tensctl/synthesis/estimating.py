"""A controller that carries an estimate from sample to sample, and is shown what its sensors read."""

from __future__ import annotations

import numpy as np

from tensctl.errors import SynthesisError
from tensctl.synthesis.sensors import Reading


class Estimating:
    """Memory and manners of LQG; the memory holds real arrays, so that runs under it can be stored and resumed."""

    def reset(self) -> None:
        """Forget the estimate: the structure is at its equilibrium."""
        self.restore({})

    def state(self) -> dict[str, np.ndarray]:
        """The estimate and the inputs at the last sample; nothing before the first."""
        return dict(vars(self).get("_memory", {}))

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from this estimate."""
        vars(self)["_memory"] = dict(state)

    @staticmethod
    def _check_shown(measurement: object, dt: float | None, design: str) -> None:
        if dt is None:
            raise SynthesisError(
                f"this LQG was designed in continuous time; give {design} a control period dt to run it."
            )
        if not isinstance(measurement, Reading):
            raise SynthesisError(
                "LQG is shown what its sensors read; give step(t, lqg.sensors.read(measurement, sample))."
            )
