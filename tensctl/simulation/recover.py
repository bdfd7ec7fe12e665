"""How large a disturbance a structure, or a closed loop, comes back from: bisection on the nonlinear plant.

    lo = the largest amplitude of a doubling climb from which it comes back, hi = the next one, from which it does not
    (lo, hi) <- the half of it whose ends differ, split at sqrt(lo hi), until hi <= (1 + width) lo

Amplitudes from which a nonlinear structure comes back need not form an interval: it may be caught elsewhere at one
amplitude and be thrown over and back at a larger one. What is looked for is the first loss. So amplitudes below lo are
sampled, and the search starts again from one that failed. A loss between two samples stays unseen.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tensctl.errors import SimulationError
from tensctl.linear.modes import Modes
from tensctl.model import Dynamics
from tensctl.scene.given import argument, check_kind
from tensctl.scene.values import Choice, Number
from tensctl.simulation.checked import check_each
from tensctl.simulation.controller import Controller
from tensctl.simulation.disturb import Disturbance, over_at
from tensctl.simulation.recovered import Recovery
from tensctl.simulation.simulate import period_of
from tensctl.simulation.trial import Experiment, Trial
from tensctl.statics import Equilibrium

# The climb starts at the cap halved so often. Nothing below the cap halved twice as often is looked at.
_CLIMB = 6
# Periods of the lowest flexible mode for which a structure has to stay in its place: one might be a slow return's turn.
_PERIODS = 2.0


def recovery(
    dynamics: Dynamics,
    equilibrium: Equilibrium,
    controller: Controller | None = None,
    *,
    disturbances: Sequence[Disturbance],
    cap: float,
    t_end: float,
    within: float = 0.01,
    hold: float | None = None,
    dt: float | None = None,
    rate_max: float | None = None,
    collide: bool = True,
    width: float = 0.05,
    below: int = 4,
    tol: float = 1e-6,
) -> Recovery:
    """Find the largest disturbances from which a structure comes back to its equilibrium.

    It has come back when every node has stayed near its place for a while; a free structure is seen from its co-moving
    frame. Recovery is not monotone in general: the result is the first loss that samples show, and larger amplitudes
    from which it came back all the same are counted.

    Parameters
    ----------
    dynamics : Dynamics
    equilibrium : Equilibrium
        Where it starts, and has to come back to.
    controller : optional
        An object with `step` and `reset`; without one, rest lengths stay as they are.
    disturbances : sequence of Push or Kick
        Each of its shape; the amplitude is the size of a push's force, N, or a kick's largest node speed, m/s.
    cap : float, N or m/s
        Largest amplitude to try.
    t_end : float, s
        By then it must have come back.
    within : float
        How near is near, over the largest extent of the structure at rest.
    hold : float, s, optional
        For how long; two periods of the lowest flexible mode by default.
    dt, rate_max : optional
        As `simulate` has them.
    collide : bool
        Whether rods that touch end a trial. The equations know no contact: without this, rods pass through each other
        on the way, and the result is that of the equations alone.
    width : float
        Relative width of the brackets, > 0.
    below : int
        Amplitudes below the largest that are tried, evenly spaced.
    tol : float
        Tolerance of the runs.

    Raises
    ------
    SimulationError
        An argument that does not fit, a push without a direction, or no flexible mode to take `hold` from.
    """
    check_kind(Dynamics, error=SimulationError, dynamics=dynamics)
    check_kind(Equilibrium, error=SimulationError, equilibrium=equilibrium)
    check_each("disturbances", disturbances, Disturbance, 'tc.Kick("mode 7", linear.modes[6].shape)')
    if not disturbances:
        raise SimulationError("no disturbance is given; give pushes, or kicks of modes.")
    for name, value in (("cap", cap), ("t_end", t_end), ("within", within), ("width", width)):
        argument(name, value, Number(above=0), SimulationError)
    stay: float = _hold(equilibrium) if hold is None else argument("hold", hold, Number("s", least=0), SimulationError)
    collide = argument("collide", collide, Choice(True, False), SimulationError)
    below = argument("below", below, Number("amplitudes", least=0, whole=True), SimulationError)
    late = max(map(over_at, disturbances)) + stay
    if not late <= t_end:
        raise SimulationError(
            f"t_end is {t_end:g} s; the disturbances and the {stay:g} s for which the structure has to stay in place "
            f"take {late:g} s, so give a later one."
        )
    size = float(np.ptp(equilibrium.nodes, axis=0).max())
    experiment = Experiment(
        dynamics, equilibrium, controller, t_end, within * size, stay, period_of(controller, dt),
        dynamics.members.rate_max if rate_max is None else rate_max, collide, tol,
    )  # fmt: skip
    found = [_search(experiment, disturbance, cap, width, below) for disturbance in disturbances]
    return Recovery(
        experiment, tuple(disturbances), float(cap), np.array([b for b, _ in found]), tuple(t for _, t in found)
    )  # fmt: skip


def _search(
    experiment: Experiment, disturbance: Disturbance, cap: float, width: float, below: int
) -> tuple[tuple[float, float], tuple[Trial, ...]]:
    """Climb to the first failure, close in on it, look below, and start again from a failure found there."""
    trials: dict[float, Trial] = {}

    def comes_back(amplitude: float) -> bool:
        if amplitude not in trials:
            trials[amplitude] = experiment.at(disturbance, amplitude)
        return trials[amplitude].recovered

    climb = (cap / 2**halvings for halvings in range(_CLIMB, -1, -1))
    high = next((amplitude for amplitude in climb if not comes_back(amplitude)), np.inf)
    while True:
        low = max((a for a, trial in trials.items() if trial.recovered and a < high), default=0.0)
        while np.isfinite(high) and high > (1 + width) * low and high > cap / 4**_CLIMB:
            middle = float(np.sqrt(low * high)) if low else high / 2
            low, high = (middle, high) if comes_back(middle) else (low, middle)
        lower = (low * k / (below + 1) for k in range(1, below + 1)) if low else ()
        failed = next((amplitude for amplitude in lower if not comes_back(amplitude)), None)
        if failed is None:
            return (low, high), tuple(trials[amplitude] for amplitude in sorted(trials))
        high = failed


def _hold(equilibrium: Equilibrium) -> float:
    """Two periods of the lowest flexible mode, s."""
    flexible = [mode.frequency for mode in Modes(equilibrium) if mode.kind == "flexible"]
    if not flexible:
        raise SimulationError("no mode is flexible, so none says for how long to look; give hold in s.")
    return _PERIODS / min(flexible)
