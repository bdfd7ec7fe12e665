"""What a long computation says while it works: bars on a terminal, plain lines elsewhere, or nothing.

All of it goes to the error stream, so that the output stream carries results only.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID


class Progress:
    """Says which stage runs, how far it is and how long it took.

    Parameters
    ----------
    quiet : bool
        Say nothing.
    stream : text stream, optional
        Where to say it; the error stream by default. Bars are drawn only where it is a terminal.
    """

    def __init__(self, *, quiet: bool = False, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._quiet = quiet
        self._bars: Bars | None = None

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Name a stage while it runs, and say at its end how many seconds it took; stages do not nest."""
        start = time.perf_counter()
        try:
            with self._live(name):
                yield
        except BaseException:
            self._say(f"{name}: stopped after {time.perf_counter() - start:.1f} s")
            raise
        self._say(f"{name}: {time.perf_counter() - start:.1f} s")

    def warn(self, sentence: str) -> None:
        """Say what is wrong with a result that stands all the same."""
        self._say(f"warning: {sentence}")

    def track(self, total: int, name: str) -> Track:
        """Count `total` steps of the running stage; call `advance` on what this returns."""
        if self._bars is None:
            return Track()
        return Track(self._bars, self._bars.add_task(name, total=total))

    @contextmanager
    def _live(self, name: str) -> Iterator[None]:
        if self._quiet or not self._stream.isatty():
            self._say(name)
            yield
            return
        from rich.console import Console
        from rich.progress import Progress as Bars

        with Bars(console=Console(file=self._stream), transient=True, refresh_per_second=5) as bars:
            bars.add_task(name, total=None)
            self._bars = bars
            try:
                yield
            finally:
                self._bars = None

    def _say(self, line: str) -> None:
        if not self._quiet:
            print(line, file=self._stream, flush=True)


class Track:
    """Steps of a stage, shown as a bar where there is one."""

    def __init__(self, bars: Bars | None = None, task: TaskID | None = None) -> None:
        self._bars, self._task = bars, task

    def advance(self, n: int = 1) -> None:
        """Count n more steps as done."""
        if self._bars is not None and self._task is not None:
            self._bars.advance(self._task, n)
