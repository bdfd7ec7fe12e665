"""The run-time check of shapes and types that `conftest.py` puts on some rooms; only tests have it.

A run calls the same functions with the same shapes at every stretch of its time. Its first stretches are checked and
the rest is not: checks of all of them took half of the time of closed loops.
"""

from __future__ import annotations

import functools

from beartype import BeartypeConf, beartype
from jaxtyping import config

checked = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""A whole number passes for a float, as Python's own typing rules have it."""

# Stretches of a run, from one sample or other change to the next, that are checked.
FIRST = 30


def check_first_stretches(moving: type) -> None:
    """Check no further stretches of the runs that a class moves; what begins or comes after a run is checked again."""
    begin, advance, finished = moving.begin, moving.advance, moving.finished

    @functools.wraps(begin)
    def begun(self, *given):
        config.update("jaxtyping_disable", False)
        self.stretches = 0
        return begin(self, *given)

    @functools.wraps(advance)
    def advanced(self, *given):
        self.stretches = getattr(self, "stretches", 0) + 1
        config.update("jaxtyping_disable", self.stretches > FIRST)
        return advance(self, *given)

    @functools.wraps(finished)
    def ended(self, *given):
        config.update("jaxtyping_disable", False)
        return finished(self, *given)

    moving.begin, moving.advance, moving.finished = begun, advanced, ended
