"""One BLAS thread for small matrices: waking a second one costs up to a hundred times the work it would take over.

Measured on two cores: a Riccati equation of 48 states took 2 ms with one thread and from 2 to 160 ms with two.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock
from typing import Any

from threadpoolctl import ThreadpoolController


@cache
def _pools() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - its BLAS must be loaded before the pools are listed

    return ThreadpoolController()


def _give_up_control() -> None:
    """Let any thread set limits: since 3.8 threadpoolctl keeps that for the one that did so first."""
    for library in _pools().lib_controllers:
        getattr(library, "clear_controlling_thread", lambda: None)()


class _Limit:
    """The limit of the whole process: the first block that needs it sets it, the last one to leave takes it away.

    OpenBLAS has one number of threads for all threads of Python: where each of these set and restored it by itself, it
    would be lifted while another one still counts on it, and the last one would restore the limit that it found.
    """

    def __init__(self) -> None:
        self._lock, self._blocks = Lock(), 0
        self._set: Any = None

    def enter(self) -> None:
        with self._lock:
            if not self._blocks:
                self._set = _pools().limit(limits=1, user_api="blas")
                _give_up_control()
            self._blocks += 1

    def leave(self) -> None:
        with self._lock:
            self._blocks -= 1
            if not self._blocks:
                self._set.restore_original_limits()
                _give_up_control()


_limit = _Limit()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Run a block, or a decorated function, with one BLAS thread.

    A block inside another finds the limit set and costs nothing: to set it takes 40 us, a tenth of a control step.
    """
    _limit.enter()
    try:
        yield
    finally:
        _limit.leave()
