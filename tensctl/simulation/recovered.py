"""What `recovery` found: the largest disturbances that a structure comes back from, and every trial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.simulation.disturb import Disturbance, label_of, unit_of
from tensctl.simulation.trial import Experiment, Trial

# A verdict is checked with a tolerance smaller by this factor.
_STRICTER = 1e-2


@dataclass(frozen=True, eq=False)
class Recovery:
    """The largest disturbances found, and every trial.

    Attributes
    ----------
    experiment : Experiment
        What was asked.
    disturbances : (k,)
    cap : float, N or m/s
        The largest amplitude that was tried.
    bracket : (k, 2) N or m/s
        The largest amplitude before the first loss, and that of the first loss; 0 where nothing came back, infinite
        where nothing was lost.
    trials : (k,) tuples of Trial
        In the order of their amplitudes.
    """

    experiment: Experiment
    disturbances: tuple[Disturbance, ...]
    cap: float
    bracket: Float[np.ndarray, "k 2"]
    trials: tuple[tuple[Trial, ...], ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """What the disturbances are."""
        return tuple(label_of(d) for d in self.disturbances)

    @property
    def units(self) -> tuple[str, ...]:
        """N of a push's force, m/s of a kick's largest node speed."""
        return tuple(unit_of(d) for d in self.disturbances)

    @property
    def largest(self) -> Float[np.ndarray, " k"]:
        """Largest amplitudes before the first loss, N or m/s."""
        return self.bracket[:, 0]

    @property
    def capped(self) -> tuple[bool, ...]:
        """Whether it came back from all that was tried, up to the cap."""
        return tuple(bool(high) for high in np.isinf(self.bracket[:, 1]))

    @property
    def kept(self) -> tuple[Trial | None, ...]:
        """The trials at the lower ends; None where nothing came back."""
        return tuple(self._trial(k, 0) for k in range(len(self.trials)))

    @property
    def lost(self) -> tuple[Trial | None, ...]:
        """The trials at the upper ends; None where the cap came back."""
        return tuple(self._trial(k, 1) for k in range(len(self.trials)))

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the upper ends did not come back; empty at the cap."""
        return tuple("" if trial is None else trial.reason for trial in self.lost)

    @property
    def recovered_above(self) -> tuple[int, ...]:
        """How many larger amplitudes were tried from which it came back: > 0 shows that recovery is not monotone."""
        return tuple(
            sum(trial.recovered and trial.amplitude > high for trial in trials)
            for (_, high), trials in zip(self.bracket.tolist(), self.trials, strict=True)
        )

    def _trial(self, k: int, end: int) -> Trial | None:
        return next((trial for trial in self.trials[k] if trial.amplitude == self.bracket[k, end]), None)

    def verify(self, tol: float | None = None) -> None:
        """Run both ends of each bracket again, a hundred times as accurately unless another tolerance is given.

        Raises
        ------
        SimulationError
            With the first end whose outcome differs.
        """
        tol = _STRICTER * self.experiment.tol if tol is None else tol
        for k, disturbance in enumerate(self.disturbances):
            for trial in (self.kept[k], self.lost[k]):
                if trial is None:
                    continue
                again = self.experiment.at(disturbance, trial.amplitude, tol=tol)
                if again.recovered != trial.recovered:
                    raise SimulationError(
                        f"{self.labels[k]} of {trial.amplitude:.4g} {self.units[k]}: {trial.reason or 'it came back'} "
                        f"with tol = {self.experiment.tol:.0e}, {again.reason or 'it came back'} with {tol:.0e}; ask "
                        "for a smaller tol, or for a wider bracket."
                    )

    def __str__(self) -> str:
        """A line a disturbance."""
        return "\n".join(self._line(k) for k in range(len(self.trials)))

    def _line(self, k: int) -> str:
        unit, (low, high) = self.units[k], self.bracket[k]
        kept, above = self.kept[k], self.recovered_above[k]
        if self.capped[k]:
            said = f"from all tried, up to the cap of {self.cap:.4g} {unit}"
        else:
            said = f"from {low:.4g} {unit}; not from {high:.4g}: {self.reasons[k]}"
        if kept is not None:
            said += f" (at {kept.amplitude:.4g}: {len(kept.slack)} tendons slack, {kept.peak:.3g} m away)"
        return f"{self.labels[k]}: {said}" + (f"; but from {above} larger ones too" if above else "")
