"""What tables over time have in common."""

from __future__ import annotations

import numpy as np

from tensctl.jit import bare


def ascends(times: np.ndarray) -> bool:
    """Whether these are times: at least one, finite, each after the last."""
    return times.ndim == 1 and times.size > 0 and _ascends(times)


@bare
def _ascends(times):
    for k in range(1, times.size):
        if not times[k] > times[k - 1]:
            return False
    return np.isfinite(times[0]) and np.isfinite(times[-1])
