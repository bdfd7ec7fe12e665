"""Which integrator fits a scene, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from tensctl.errors import SimulationError
from tensctl.model import Dynamics
from tensctl.simulation.integrators.base import Integrator
from tensctl.simulation.integrators.tables import Order

Method = Literal["auto", "splitting2", "splitting4", "splitting6", "dopri5", "rosenbrock", "cvodes", "idas"]

_ORDERS: dict[str, Order] = {"splitting2": 2, "splitting4": 4, "splitting6": 6}
# Above this tolerance a step of order 4 is as long as one of order 6, for half the forces.
_LOOSE = 1e-4
# Landing on a switch costs two or three steps of the whole structure, and the number of switches grows with it: with
# more tendons than this, switches are passed over unless the tolerance asks for more than order 2 can give.
_MANY, _MODEST = 1000, 1e-6
# Fastest decay over fastest frequency, both bounds, from which Rosenbrock steps win: at 1e-8, dopri5 takes 0.7 of their
# time at 50 and 1.2 at 200 on the pinned (3,1) mast, 0.8 at 118 and 1.5 at 236 on the (4,2) shell. With joints, 0.01 s
# of the Class 2 (3,2) shell takes dopri5 1.3 times as long as CVODES at 275, 14 times at 2750.
_STIFF = 200.0


@dataclass(frozen=True, eq=False)
class Choice:
    """An integrator, and the sentence that says why it was taken."""

    integrator: Integrator
    why: str


def choose_integrator(dynamics: Dynamics, method: Method, tol: float, *, stop: bool = False) -> Choice:
    """The integrator asked for, or for "auto" the one that fits the scene's damping, size and tolerance.

    Splittings end their steps at the times to record with `stop`; without, recording does not change the motion.

    Raises
    ------
    SimulationError
        A method asked for that cannot move the scene.
    """
    why = "asked for"
    if method == "auto":
        method, why = fitting(dynamics, tol)
    rate = dynamics.fastest_rate
    if method in _ORDERS:
        return Choice(_splitting(dynamics, _ORDERS[method], tol, rate, stop), why)
    return Choice(_adaptive(dynamics, method, tol, rate), why)


def applicable(dynamics: Dynamics) -> tuple[Method, ...]:
    """The methods that can move a scene: splittings only without dampers, drag, joints and guides."""
    if dynamics.tied:
        return "dopri5", "cvodes", "idas"
    if dynamics.damped:
        plain = not dynamics.structure.has_cables
        return ("dopri5", "rosenbrock", "cvodes", "idas") if plain else ("dopri5", "cvodes", "idas")
    return "splitting6", "splitting4", "splitting2", "dopri5", "cvodes", "idas"


def _adaptive(dynamics: Dynamics, method: Method, tol: float, rate: float) -> Integrator:
    if method == "cvodes":
        from tensctl.simulation.integrators.cvodes import Cvodes

        return Cvodes(dynamics, tol)
    if method == "idas":
        from tensctl.simulation.integrators.idas import Idas

        return Idas(dynamics, tol)
    if method == "rosenbrock":
        return _rosenbrock(dynamics, tol, rate)
    from tensctl.simulation.integrators.dormand_prince import DormandPrince

    return DormandPrince(dynamics, tol, rate)


def fitting(dynamics: Dynamics, tol: float) -> tuple[Method, str]:
    """The method that "auto" takes, and why."""
    ratio = dynamics.fastest_decay / dynamics.fastest_rate if dynamics.damped else 0.0
    if ratio > _STIFF:
        why = f"dampers decay up to {ratio:.0f} times faster than the structure swings: stiff"
        if not (dynamics.tied or dynamics.structure.has_cables):
            return "rosenbrock", why
        from tensctl.simulation.integrators.judge import MOST

        if len(dynamics.structure.tendons) <= MOST:
            return "cvodes", f"{why}, and rosenbrock knows no joints, guides or cables"
        return "dopri5", f"{why}, but rosenbrock knows no joints, guides or cables, and cvodes is for {MOST} tendons"
    if dynamics.tied:
        return "dopri5", "joints or guides: accelerations with multipliers, projected after each step"
    if dynamics.damped:
        return "dopri5", "dampers or drag take energy out, so nothing is gained by a symplectic method"
    if tol >= _LOOSE:
        return "splitting4", f"nothing takes energy out, and tol = {tol:g} is loose"
    return "splitting6", "nothing takes energy out: symplectic steps, exact for rods between forces"


def _splitting(dynamics: Dynamics, order: Order, tol: float, rate: float, stop: bool) -> Integrator:
    from tensctl.simulation.integrators.splitting import Splitting

    if dynamics.damped:
        raise SimulationError(
            f"splitting{order} moves undamped scenes only, and this one has dampers or drag; use dopri5."
        )
    if dynamics.tied:
        raise SimulationError(f"splitting{order} moves rods that share no node and no guide; use dopri5.")
    locate = len(dynamics.structure.tendons) <= _MANY or tol < _MODEST
    return Splitting.fitted(dynamics, order, tol, rate, locate=locate, stop=stop)


def _rosenbrock(dynamics: Dynamics, tol: float, rate: float) -> Integrator:
    from tensctl.simulation.integrators.rosenbrock import Rosenbrock

    if dynamics.tied or dynamics.structure.has_cables:
        raise SimulationError(
            "rosenbrock moves rods that share no node, have no guide and no cable between them; use dopri5, or cvodes "
            "where dampers are stiff."
        )
    return Rosenbrock(dynamics, tol, rate)
