"""Hard limits of the inputs, which no command passes, whatever a solver says.

lower <= u <= upper   rest lengths keep their floors and change by at most u_max
|u - u_now| <= reach  no rest length is faster than rate_max within a period, and no motor than power_max / F_max

F_max is the force of a motor whose tendons all pull with their stall limits: as long as those hold, force times speed
stays below power_max. A motor without a stall limit has no such bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.model import Dynamics
from tensctl.scene.given import argument
from tensctl.scene.values import Number
from tensctl.structure import Members, Structure
from tensctl.structure.labels import by_label
from tensctl.synthesis.weights import Size


@dataclass(frozen=True, eq=False)
class InputLimits:
    """Limits of total inputs.

    Attributes
    ----------
    lower, upper : (nu,) m
    reach : (nu,) m
        How far each input may go in a period: its fastest tendon keeps the rate limit, its motor the power.
    """

    lower: Float[np.ndarray, " nu"]
    upper: Float[np.ndarray, " nu"]
    reach: Float[np.ndarray, " nu"]

    @classmethod
    def of(cls, dynamics: Dynamics, rate_max: float, dt: float, u_max: Size | None) -> InputLimits:
        """Those of a structure's inputs: a rate limit, m/s, a period, s, and a largest change of rest lengths, m."""
        members = dynamics.members
        fastest = np.minimum(rate_max / members.gearing.largest, powered_rates(members))
        return cls(*input_range(dynamics.structure, members, u_max), fastest * dt)

    @property
    def range(self) -> tuple[Float[np.ndarray, " nu"], Float[np.ndarray, " nu"]]:
        """Least and largest total inputs, m."""
        return self.lower, self.upper

    def kept(self, u: Float[np.ndarray, " nu"], now: Float[np.ndarray, " nu"]) -> Float[np.ndarray, " nu"]:
        """Inputs within all limits, to the last bit, a period after those of now."""
        near = np.minimum(np.maximum(u, now - self.reach), now + self.reach)
        return np.minimum(np.maximum(near, self.lower), self.upper)


def input_range(
    structure: Structure, members: Members, u_max: Size | None
) -> tuple[Float[np.ndarray, " nu"], Float[np.ndarray, " nu"]]:
    """Least and largest inputs, (nu,) m, at which rest lengths keep their floors and change by at most u_max."""
    (lower, upper), most = members.input_bounds, input_reach(structure, members, u_max)
    return np.maximum(lower, -most), np.minimum(upper, most)


def input_reach(structure: Structure, members: Members, u_max: Size | None) -> Float[np.ndarray, " nu"]:
    """Largest change of each input, (nu,) m, at which no rest length changes by more than u_max; infinite without one.

    Parameters
    ----------
    u_max : number or table by tendon label, optional
        Largest change of a rest length from L0, m; of a motor that pulls several tendons each keeps its own.
    """
    reach = np.full(members.gearing.size, np.inf)
    if u_max is not None:
        most = by_label(structure.tendon_labels, u_max, "u_max", np.inf)[members.inputs]
        np.minimum.at(reach, members.gearing.motor, most / np.abs(members.gearing.ratio))
    return reach


def powered_rates(members: Members) -> Float[np.ndarray, " nu"]:
    """Speed of each motor, m/s, up to which it keeps `actuators.power_max` whatever tensions its stall limits allow.

    Infinite where there is no limit of power, or a tendon of the motor has no stall limit.
    """
    bounded = np.isfinite(members.stall) & np.isfinite(members.power_max)
    return np.divide(members.power_max, members.stall, out=np.full(bounded.shape, np.inf), where=bounded)


def check_asked(tension_min: float, delay: float, dt: float) -> None:
    """Refuse a floor below which tendons would push, or that is no number, and a delay longer than a period.

    Raises
    ------
    SynthesisError
        With the setting and what is expected.
    """
    check_floor(tension_min)
    if delay > dt:
        raise SynthesisError(f"mpc.delay is {delay} s; a time from 0 to dt = {dt:g} s is expected.")


def check_floor(tension_min: float) -> None:
    """Refuse a floor of tensions, N, below which tendons would push, or that is no number.

    Raises
    ------
    SynthesisError
        With what was given and what is expected.
    """
    argument("tension_min", tension_min, Number("N; below 0 a tendon would push", least=0))


def plan_of(state: Mapping[str, np.ndarray], horizon: int, inputs: int) -> Float[np.ndarray, "N nu"] | None:
    """The plan that a predictive controller remembers, m; None before its first step, when it remembers nothing.

    Raises
    ------
    SynthesisError
        A memory of another controller.
    """
    again = "restore what state() of a controller with the same settings gave."
    if not isinstance(state, Mapping):
        raise SynthesisError(f"the memory is of type {type(state).__name__}; a table by name is expected: {again}")
    if not state:
        return None
    shapes, plan = {"plan": (horizon, inputs), "command": (inputs,)}, state.get("plan")
    wrong = [name for name, shape in shapes.items() if np.shape(state.get(name, np.zeros(shape))) != shape]
    if plan is None or wrong:
        given = f"a {wrong[0]} of shape {np.shape(state[wrong[0]])}" if wrong else ", ".join(sorted(state))
        name = wrong[0] if wrong else "plan"
        raise SynthesisError(f"the memory holds {given}; a {name} of shape {shapes[name]} is expected, so {again}")
    return plan
