"""Designs for actuators with lag, tau u' = c - u: rest lengths u become states, commands c the inputs.

    cost rate   (x, u)' [Q N; N' R] (x, u) + (c - u)' R (c - u)

What the structure and its rest lengths cost stays as it was; a command that is ahead of the rest length costs as a
change of it would. Without lag c = u, and nothing is added. States that a design leaves out are those of the
mechanics: a lag has no zeros, so each rest length can be brought to rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from tensctl.errors import SynthesisError
from tensctl.linear import HarmonicModel, LinearModel
from tensctl.synthesis.reference import Reference
from tensctl.synthesis.weights import Cost


def lagging_cost(linear: LinearModel, cost: Cost) -> Cost:
    """Weights on the states of `linear.actuated` and its commands, from those on the mechanics' states and inputs."""
    return _with_lag(cost) if linear.actuated.lag else cost


def lagging_costs(linear: HarmonicModel, costs: tuple[Cost, ...]) -> tuple[Cost, ...]:
    """The same harmonic by harmonic."""
    return tuple(_with_lag(cost) for cost in costs) if linear.actuated.lag else costs


def lagging_basis(linear: LinearModel, basis: Float[np.ndarray, "nx nr"]) -> Float[np.ndarray, "n m"]:
    """The basis of the states that a design is about, with the rest lengths where `linear.actuated` has them."""
    if not linear.actuated.lag:
        return basis
    (nx, nr), nu = basis.shape, len(linear.inputs)
    return np.block([[basis, np.zeros((nx, nu))], [np.zeros((nu, nr)), np.eye(nu)]])


def commands_now(linear: LinearModel | HarmonicModel, measurement: Any) -> Float[np.ndarray, " nu"]:
    """Rest-length changes as commanded now, m: without lag those that are there.

    Raises
    ------
    SynthesisError
        A measurement that does not tell the commands of actuators with lag.
    """
    if not linear.lag:
        return np.asarray(measurement.inputs)
    told = getattr(measurement, "commands", None)
    if told is None:
        raise SynthesisError(
            f"the actuators lag by {linear.lag:g} s, so a measurement needs commands, (nu,) m: the rest-length "
            "changes that were last asked for."
        )
    return np.asarray(told)


def commands_along(
    reference: Reference, times: Float[np.ndarray, " k"], lag: float, dt: float
) -> Float[np.ndarray, "k nu"]:
    """Commands that keep rest lengths on a reference, u + tau du/dt, m; du/dt is the mean over a period about each."""
    course = reference.inputs_at(times)
    if not lag:
        return course
    return course + lag / dt * (reference.inputs_at(times + 0.5 * dt) - reference.inputs_at(times - 0.5 * dt))


def followed(
    lag: float, inputs: Float[np.ndarray, " nu"], asked: Iterable[tuple[float, np.ndarray, np.ndarray]]
) -> Float[np.ndarray, " nu"]:
    """Rest-length changes after commands that ramp from one value to the next, each for so many seconds, m."""
    for seconds, start, end in asked:
        if seconds > 0:
            behind = lag / seconds * (end - start)  # a rest length on the ramp stays by this behind
            inputs = end - behind + np.exp(-seconds / lag) * (inputs - start + behind)
    return inputs


def followed_to_next(
    lag: float, dt: float, delay: float, inputs: Float[np.ndarray, " nu"], commands: Iterable[np.ndarray]
) -> Float[np.ndarray, " nu"]:
    """Rest-length changes at the next sample, m.

    Parameters
    ----------
    lag, dt, delay : float, s
    inputs : (nu,) m
        Rest-length changes at this one.
    commands : three of (nu,) m
        As they are now, at which the ramp under way ends after the delay, and at which that of a period then does.
    """
    now, before, command = commands
    share = 1 - delay / dt  # of the last ramp that the next sample sees
    there = before + share * (command - before)
    return followed(lag, inputs, ((delay, now, before), (share * dt, before, there)))


def followed_along(
    lag: float, dt: float, parts: Float[np.ndarray, " p"], now: Float[np.ndarray, " n"],
    commands: Float[np.ndarray, "N+1 n"],
) -> Float[np.ndarray, "N p n"]:  # fmt: skip
    """What follows commands that ramp through periods, at parts of each; `parts` end with 1.

    Without lag, the commands themselves. Exact for any lag: what is left of a ramp in a period far shorter than the
    lag is no difference of large numbers.
    """
    p = parts[:, None]
    if not lag:
        return (1.0 - p) * commands[:-1, None] + p * commands[1:, None]
    gone, found = np.expm1(-p * dt / lag), []
    for start, end in pairwise(commands):
        found.append(now + gone * (now - start) + (p + lag / dt * gone) * (end - start))
        now = found[-1][-1]
    return np.array(found)


def _with_lag(cost: Cost) -> Cost:
    nx, nu = cost.N.shape
    Q = cost.matrix
    Q[nx:, nx:] += cost.R
    return Cost(Q, cost.R, np.vstack([np.zeros((nx, nu)), -cost.R]))
