"""What accompanies the stages of a run: their times, who is told, and where a motion goes that is stored."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from tensctl.pipeline.unfinished import Unfinished
from tensctl.progress import Progress


class Clock:
    """Wall time of each stage; and where a run goes that is stored while it goes on."""

    def __init__(self, progress: Progress | None = None, unfinished: Unfinished | None = None) -> None:
        self.progress, self.seconds = Progress(quiet=True) if progress is None else progress, dict[str, float]()
        self.unfinished = unfinished

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a stage, and say that it runs."""
        began = time.perf_counter()
        with self.progress.stage(name):
            yield
        self.seconds[name] = time.perf_counter() - began
