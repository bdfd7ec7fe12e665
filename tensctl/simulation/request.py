"""What was asked of a run besides its start: times, loads, schedule and how to integrate; as text for a file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from tensctl.simulation.integrators import Method
from tensctl.simulation.loads import History, Load, Push, Wave
from tensctl.simulation.schedule import Schedule

_KINDS = {kind.__name__: kind for kind in (Push, Wave, History, Schedule)}


@dataclass(frozen=True, eq=False)
class Request:
    """A run as asked for.

    Attributes
    ----------
    times : (t,) s
        Recorded.
    loads, schedule : sequences
    method, tol : as `simulate` has them
    rate_max : float, m/s
    period : float or None, s
        Of the controller.
    chunk : int or None
        Records that go to disk together.
    delay : float, s
        From a sample until the controller's command begins to act.
    """

    times: np.ndarray
    loads: Sequence[Load]
    schedule: Sequence[Schedule]
    method: Method
    tol: float
    rate_max: float
    period: float | None
    chunk: int | None = None
    delay: float = 0.0

    @property
    def ends(self) -> np.ndarray:
        """Last recorded time of every chunk, s; none without chunks."""
        if self.chunk is None:
            return np.zeros(0)
        return np.unique(np.append(self.times[self.chunk - 1 :: self.chunk], self.times[-1]))

    def as_text(self) -> str:
        """All but the times as JSON, exact to the last bit."""
        plain = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("times", "loads", "schedule")}
        return json.dumps(plain | {"loads": _tables(self.loads), "schedule": _tables(self.schedule)})

    @classmethod
    def of_text(cls, text: str, times: np.ndarray) -> Request:
        """The request that was written as text."""
        content = json.loads(text)
        loads, schedule = (_entries(content.pop(name)) for name in ("loads", "schedule"))
        return cls(times=times, loads=loads, schedule=schedule, **content)


def _tables(entries: Sequence[Load | Schedule]) -> list[dict]:
    values = [{f.name: np.asarray(getattr(entry, f.name)).tolist() for f in fields(entry)} for entry in entries]
    return [{"kind": type(entry).__name__} | table for entry, table in zip(entries, values, strict=True)]


def _entries(tables: list[dict]) -> list:
    return [_KINDS[table.pop("kind")](**table) for table in tables]
