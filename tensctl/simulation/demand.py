"""What a motion asks of its actuators: force, speed, power and work of each motor, and the peaks to choose it by.

    F = sum_t g_t T_t,   speed = dv/dt,   P = F dv/dt,   W = integral of P dt;   v > 0 takes in, so P > 0 drives

Where nothing else does work, that of all motors is the change of energy:  sum W = E(end) - E(start).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from tensctl.errors import SimulationError
from tensctl.simulation.demand_table import table

# Part of a stall limit by which a tension may pass it and still count as at it.
_AT_LIMIT = 1e-6
Kind = Literal["run", "path", "slow path"]


class Peak(NamedTuple):
    """Largest value of each motor, (nu,), and when it first occurs, (nu,) s."""

    value: Float[np.ndarray, " nu"]
    time: Float[np.ndarray, " nu"]


class Work(NamedTuple):
    """Work of each motor, (nu,) J: what it gives, what it takes back as generator or brake (<= 0), and their sum."""

    positive: Float[np.ndarray, " nu"]
    regenerated: Float[np.ndarray, " nu"]
    net: Float[np.ndarray, " nu"]


@dataclass(frozen=True, eq=False)
class ActuatorDemand:
    """Force, speed, power and work of each actuator over a motion.

    Attributes
    ----------
    of : "run", "path" or "slow path"
        The last counts as infinitely slow, without inertia.
    labels : tuple of str, one an input
        Tendons, or gangs.
    time : (t,) s
    force : (t, nu) N
        Tension; of a gang the sum over its tendons times their ratios.
    speed : (t, nu) m/s
        Of the input, > 0 takes in: the mean over the interval that ends at each time, 0 at the first. Exact where the
        input goes straight from time to time, as under a controller recorded at its samples.
    power, power_after : (t, nu) W
        Just before and just after each time, between which speeds jump; > 0 where the motor drives the structure.
    work : Work
    work_error : (nu,) J
        How much the net work changes when every second time is left out; its error is smaller.
    load : Peak
        Largest tension over `actuators.force_max` among the tendons of each motor; 0 where there is no limit.
    energy_change : float, J
        Of the structure, from first to last time.
    energy_error : float, J
        What lengths off by 1e-10 of themselves make of energies, the default tolerance of a run.
    closed : bool
        Whether nothing but actuators does work: no damper, no drag, no push, no feedback that a path leaves to others.
    """

    of: Kind
    labels: tuple[str, ...]
    time: Float[np.ndarray, " t"]
    force: Float[np.ndarray, "t nu"]
    speed: Float[np.ndarray, "t nu"]
    power: Float[np.ndarray, "t nu"]
    power_after: Float[np.ndarray, "t nu"]
    work: Work
    work_error: Float[np.ndarray, " nu"]
    load: Peak
    energy_change: float
    energy_error: float
    closed: bool

    @cached_property
    def peak_force(self) -> Peak:
        """Largest force without sign, N."""
        return self._peak(np.abs(self.force))

    @cached_property
    def peak_speed(self) -> Peak:
        """Largest speed without sign, m/s."""
        return self._peak(np.abs(self.speed))

    @cached_property
    def peak_power(self) -> Peak:
        """Largest power that drives the structure, W; 0 where a motor only brakes."""
        return self._peak(np.maximum(np.maximum(self.power, self.power_after), 0.0))

    @cached_property
    def peak_braking(self) -> Peak:
        """Largest power that the structure drives the motor with, W."""
        return self._peak(np.maximum(-np.minimum(self.power, self.power_after), 0.0))

    @cached_property
    def peak_supply(self) -> tuple[float, float]:
        """Largest power that all motors take together, W, none fed by another, and when, s."""
        before, after = (np.maximum(side, 0.0).sum(axis=1) for side in (self.power, self.power_after))
        taken = np.maximum(before, after)
        return float(taken.max()), float(self.time[taken.argmax()])

    @cached_property
    def rms_force(self) -> Float[np.ndarray, " nu"]:
        """Root mean square of the force over time, N: what heats a motor."""
        if len(self.time) == 1:
            return np.abs(self.force[0])
        return np.sqrt(np.trapezoid(self.force**2, self.time, axis=0) / (self.time[-1] - self.time[0]))

    @property
    def holding_force(self) -> Float[np.ndarray, " nu"]:
        """Force at the end, N: what the motor goes on holding."""
        return self.force[-1]

    @cached_property
    def most_powerful(self) -> tuple[int, ...]:
        """Actuators by their largest power, driving or braking; those that differ by rounding keep their order."""
        largest = np.maximum(self.peak_power.value, self.peak_braking.value)
        return tuple(sorted(range(len(largest)), key=lambda k: -float(f"{largest[k]:.6g}")))

    @property
    def balance(self) -> float:
        """Net work less the change of energy, J: rounding and sampling where `closed`, else what others took."""
        return float(self.work.net.sum()) - self.energy_change

    @property
    def stalls(self) -> str | None:
        """Which actuators are beyond their stall limits, in words; None when none is."""
        over = np.flatnonzero(self.load.value > 1 + _AT_LIMIT)
        if not over.size:
            return None
        worst = int(over[self.load.value[over].argmax()])
        others = f" and {over.size - 1} more" if over.size > 1 else ""
        return (
            f"actuator {self.labels[worst]}{others} beyond force_max: "
            f"{100 * self.load.value[worst]:.4g} % of it at {self.load.time[worst]:.4g} s"
        )

    def beyond(self, power_max: float) -> str | None:
        """Which actuators give or take more than so much power, W, in words; None when none does."""
        peaks = (self.peak_power, self.peak_braking)
        kind = int(np.argmax([peak.value.max() for peak in peaks]))
        over = int((np.maximum(*(peak.value for peak in peaks)) > power_max * (1 + _AT_LIMIT)).sum())
        if not over:
            return None
        worst = int(peaks[kind].value.argmax())
        others = f" and {over - 1} more" if over > 1 else ""
        return (
            f"actuator {self.labels[worst]}{others} beyond power_max = {power_max:g} W: {('gives', 'takes')[kind]} "
            f"{peaks[kind].value[worst]:.4g} W at {peaks[kind].time[worst]:.4g} s"
        )

    def allowed(self, tol: float = 1e-6) -> float:
        """Largest imbalance of energy that counts as none, J: a part of the work in both directions, and its errors."""
        both_ways = float((self.work.positive - self.work.regenerated).sum())
        return tol * both_ways + float(self.work_error.sum()) + self.energy_error

    def verify(self, tol: float = 1e-6) -> None:
        """Check the balance of energy, where nothing but actuators does work.

        Parameters
        ----------
        tol : float
            Over the work in both directions; errors of sampling and of the run are allowed for beside it.

        Raises
        ------
        SimulationError
            With the misfit.
        """
        if self.closed and not abs(self.balance) <= self.allowed(tol):
            raise SimulationError(
                f"the actuators' work differs from the change of energy by {self.balance:.3g} J, and at most "
                f"{self.allowed(tol):.1g} J is expected; record more times, or run with a smaller tol."
            )

    def __str__(self) -> str:
        """A table of all actuators, most powerful first."""
        return table(self)

    def _peak(self, values: np.ndarray) -> Peak:
        return Peak(values.max(axis=0), self.time[values.argmax(axis=0)])
