"""Undamped motion: kicks between exact flights, with slack-taut switches located or, for many rods, passed over.

    v += b h a(q),   q flies for a h;   orders 2, 4 and 6, with a table for short steps and one for long

Symplectic, rod lengths and momenta to rounding, however long. The step follows from the tolerance and a bound on the
frequencies at rest, and is halved while rods turn or pass faster than that; a probe at the start, after each switch of
loads and every 64 steps compares one step with two halves, and shortens it for motions that are faster than that bound
(spinning rods, far from rest). Splitting tables lose their order, and their negative sub-steps anti-damp, when kicks
depend on velocity: damped scenes are refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.drive import Drive
from tensctl.simulation.integrators.kept import Kept
from tensctl.simulation.integrators.leap import moment, scenes
from tensctl.simulation.integrators.marching import DONE, LOST, STUCK, TOO_LONG, Journey, march
from tensctl.simulation.integrators.rows import Rows, rows_of
from tensctl.simulation.integrators.tables import LONG, TABLES, Order

# Step times omega_max over tol^(1/order): the (3,1) and (4,2) shells, released at rest, then err by a fifth of tol in
# 1 s. Long steps err no more than short ones in the kicked shells of `benchmarks/motions.py`.
_REACH: dict[Order, float] = {2: 2.0, 4: 15.0, 6: 10.0}
_STRIDE: dict[Order, float] = {2: 0.0, 4: 40.0, 6: 20.0}
# Longest step times omega_max. The compositions of order 4 and 6 stay stable to 3.16 and 3.14, Verlet to 2; the bound
# is found to 1 %, and at 3.1 order 6 still gives the phase of an oscillation to 3e-4.
_LONGEST: dict[Order, float] = {2: 1.0, 4: 2.0, 6: 3.1}
# The tables for long steps are stable to 6.2, and up to 4.2 they follow oscillations as closely as anything; shells
# swing no faster than 0.8 of the bound.
_FARTHEST = 5.2
# Rounding of a position over the size, below which no probe can see.
_ROUNDING = 4e-15


@dataclass(eq=False)
class Splitting:
    """A splitting of one order for one structure.

    Attributes
    ----------
    dynamics : Dynamics
    order : 2, 4 or 6
    step : float, s
        Longest step by the table for short ones.
    tol : float
        Error that a step may make, over the size of the structure and per second of the step; infinite: no probes.
    locate : bool
        Whether to land on slack-taut switches; without, a switch costs the step its order.
    rate : float, rad/s
        The rate that the step was made for; infinite: it is never halved for fast rods.
    stop : bool
        Whether steps end at every time to record, which is cheaper where times are as far apart as steps are long.
    stride : float, s
        Longest step by the table for long ones; zero: it is not used.
    """

    dynamics: Dynamics
    order: Order
    step: float
    tol: float = np.inf
    locate: bool = True
    rate: float = np.inf
    stop: bool = False
    stride: float = 0.0
    evaluations: int = 0
    switches: int = 0
    local_errors: float = np.nan
    _kept: tuple[Kept, tuple[Kept, Kept]] | None = field(default=None, init=False, repr=False)

    @classmethod
    def fitted(
        cls, dynamics: Dynamics, order: Order, tol: float, rate: float, *, locate: bool = True, stop: bool = False
    ) -> Splitting:
        """The step that a tolerance asks for when no frequency is above `rate`, rad/s."""
        step = min(_REACH[order] * tol ** (1 / order), _LONGEST[order]) / rate
        stride = min(_STRIDE[order] * tol ** (1 / order), _FARTHEST) / rate
        return cls(dynamics, order, step, tol, locate, rate, stop, stride)

    @cached_property
    def _rows(self) -> Rows:
        return rows_of(self.dynamics)

    @property
    def name(self) -> str:
        """Name of the method."""
        return f"splitting{self.order}"

    def march(self, q, v, times, drive: Drive, out_q, out_v) -> None:
        """Move q and v in place through the times, and record them at each but the first.

        Raises
        ------
        SimulationError
            When the motion cannot be followed.
        """
        self._limits[1] = _ROUNDING * max(self._size, float(np.abs(q).max()))
        status, t, step, evaluations, switches = march(
            *self._scenes(drive), self._journey, q, v, times, self.step, self.stride, self.order, self.locate,
            self.stop, out_q, out_v,
        )  # fmt: skip
        self.evaluations += evaluations
        self.switches += switches
        if status != DONE:
            raise SimulationError(_TROUBLE[status].format(t=t, step=step))

    @cached_property
    def _journey(self) -> Kept:
        return Kept(Journey(moment(self._rows), moment(self._rows), moment(self._rows), self._limits))

    @cached_property
    def _limits(self) -> np.ndarray:
        """What a probe may show over a second, what is rounding (it grows with the way from the origin), the rate."""
        return np.array([self.tol * self._size, _ROUNDING * self._size, self.rate])

    @cached_property
    def _size(self) -> float:
        return float(np.ptp(self.dynamics.structure.nodes, axis=0).max())

    def _scenes(self, drive: Drive) -> tuple[Kept, Kept]:
        """Scenes with this drive and room to work in, made once for all drives of one form."""
        if self._kept is None or not self._kept[0].renew(drive):
            anchor, kept, tables = self.dynamics.layout.anchor, Kept(drive), (TABLES[self.order], LONG[self.order])
            self._kept = kept, scenes(self._rows, anchor, kept, tables, frozen=self.locate)
        return self._kept[1]


_TROUBLE = {
    STUCK: "tendons go slack and taut without end at {t:g} s; use a smaller tol, or method = dopri5.",
    TOO_LONG: "the step of the splitting fell to {step:.1e} s at {t:g} s without reaching tol; use a larger tol.",
    LOST: "the motion was lost at {t:g} s: the step of {step:.1e} s is too long for it; use a smaller tol.",
}
