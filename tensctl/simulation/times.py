"""What tables over time have in common."""

from __future__ import annotations

import numpy as np


def ascends(times: np.ndarray) -> bool:
    """Whether these are times: at least one, finite, each after the last."""
    return times.ndim == 1 and times.size > 0 and bool(np.isfinite(times).all() and (np.diff(times) > 0).all())
