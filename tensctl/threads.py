"""One BLAS thread for small matrices: waking a second one costs up to a hundred times the work it would take over.

Measured on two cores: a Riccati equation of 48 states took 2 ms with one thread and from 2 to 160 ms with two.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from threading import local

from threadpoolctl import ThreadpoolController

_here = local()


@cache
def _pools() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - its BLAS must be loaded before the pools are listed

    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Run a block, or a decorated function, with one BLAS thread.

    A block inside another finds the limit set and costs nothing: to set it takes 40 us, a tenth of a control step.
    """
    if getattr(_here, "limited", False):
        yield
        return
    with _pools().limit(limits=1, user_api="blas"):
        _here.limited = True
        try:
            yield
        finally:
            _here.limited = False
