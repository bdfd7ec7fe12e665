"""Processor time of work that takes microseconds or minutes, and memory of the process that does it."""

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np


def timed(work: Callable[[], Any], at_least: float = 0.0) -> tuple[float, Any]:
    """Processor time of the fastest call, s, and its answer; called once, and until so many seconds are spent."""
    best, spent, answer = np.inf, 0.0, None
    while not spent or spent < at_least:
        began = time.process_time()
        answer = work()
        took = time.process_time() - began
        best, spent = min(best, took), spent + max(took, 1e-6)
    return best, answer


def memory() -> float:
    """Largest memory of this process so far, MB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform != "darwin" else 1024**2)
