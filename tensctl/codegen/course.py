"""What a controller follows, as tables: one row a sample, up to the one from which it rests.

    row k   at t = k dt + delay:   state and inputs of the reference,   at t = k dt:   the model that acts

The C source counts its steps, so times are those of the Python controller and rows are its own values: nothing is
interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from jaxtyping import Float

from tensctl.codegen.literals import Table
from tensctl.errors import OutputError
from tensctl.linear import LinearModel
from tensctl.synthesis.lagging import commands_along
from tensctl.synthesis.reference import Reference


class Part(Protocol):
    """What acts on a part of a course: a design or a problem about one equilibrium."""

    @property
    def linear(self) -> LinearModel:
        """Its model."""
        ...


P = TypeVar("P", bound=Part)


@dataclass(frozen=True, eq=False)
class Course(Generic[P]):
    """A reference, sample by sample.

    Attributes
    ----------
    times : (k,) s
        When a command that is computed at each sample begins to act.
    parts : tuple
        What acts on the way, in the order in which it is first met.
    suffixes : tuple of str
        Ends of the names of their tables.
    tables : tuple of Table
    """

    times: Float[np.ndarray, " k"]
    parts: tuple[P, ...]
    suffixes: tuple[str, ...]
    tables: tuple[Table, ...]


def sample_times(reference: Reference, dt: float, *, lags: bool) -> Float[np.ndarray, " k"]:
    """Times of the samples up to the first at which a reference is at rest for good, s.

    Commands of actuators with lag rest a sample later: they are told from half a period back.

    Raises
    ------
    OutputError
        For a reference that does not say when that is.
    """
    ends = float(getattr(reference, "ends", np.inf))
    if ends == np.inf:
        raise OutputError(
            f"this controller follows a {type(reference).__name__} that does not say when it comes to rest, and C "
            "source holds tables of what it follows; give the class an attribute `ends`, s."
        )
    return dt * np.arange(1 if ends <= 0 else int(ends / dt) + 2 + lags)


def course_of(reference: Reference, dt: float, delay: float, part_at: Callable[[float], P]) -> Course[P]:
    """Tables of a reference and of what acts along it.

    Raises
    ------
    OutputError
        A reference that never rests for good, or models of different numbers of states.
    """
    samples = sample_times(reference, dt, lags=part_at(0.0).linear.lag > 0)
    found = [part_at(t) for t in samples.tolist()]
    parts = tuple({id(part): part for part in found}.values())
    numbers = {id(part): k for k, part in enumerate(parts)}
    if len({len(part.linear.states) for part in parts}) > 1:
        raise OutputError(
            "models along this path keep different numbers of modes, and the C source has one number of states; "
            "take a shorter period, or tendons that are less stiff, so that no mode is truncated."
        )
    acts = samples + delay
    states = [
        part.linear.seen(reference.nodes_at(t), reference.velocities_at(t), reference.inputs_at(t))
        for t, part in zip(acts.tolist(), found, strict=True)
    ]
    inputs = commands_along(reference, acts, parts[0].linear.lag, dt)
    tables = (
        Table("course_model", np.array([numbers[id(part)] for part in found]), "which model acts at each sample"),
        Table("course_state", np.array(states), "state of the reference in it when the command begins to act"),
        Table("course_inputs", inputs, "and total inputs of the reference then, m"),
    )
    suffixes = ("",) if len(parts) == 1 else tuple(f"_{k}" for k in range(len(parts)))
    return Course(acts, parts, suffixes, tables)
