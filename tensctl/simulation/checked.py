"""Arguments that several kinds of runs take, refused in one sentence where they are of another kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tensctl.errors import SimulationError
from tensctl.scene.complaint import shown
from tensctl.simulation.loads import Load


def check_each(name: str, given: object, kind: Any, example: str) -> None:
    """Refuse a list that holds anything of another kind.

    Raises
    ------
    SimulationError
        With the first of them, and an example.
    """
    listed = given if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    wrong = [one for one in listed if not isinstance(one, kind)]
    if wrong:
        raise SimulationError(f"{name} holds {shown(wrong[0])}; a list such as [{example}] is expected.")


def check_pushes(pushes: object) -> None:
    """Refuse what is no list of forces over time.

    Raises
    ------
    SimulationError
        With the first entry that is none, and an example.
    """
    check_each("pushes", pushes, Load, 'tc.Push("P4_1_1", [5, 0, 0], 1.0, 1.1)')


def check_counter(progress: object) -> None:
    """Refuse what cannot count steps.

    Raises
    ------
    SimulationError
        With what was given.
    """
    if progress is not None and not callable(getattr(progress, "advance", None)):
        raise SimulationError(f"progress is of type {type(progress).__name__}; an object with advance(n) is expected.")
