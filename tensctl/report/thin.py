"""Long records drawn with few points: of every stretch that a pixel shows, only the least and the largest value."""

import numpy as np

MOST_POINTS = 1200  # a plot's axes are about 500 pixels wide: with two points a pixel nothing can be seen to be missing
_STRETCHES = 500


def thinned(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The record itself when it is short, else the extremes of each of 500 stretches, in their order.

    Parameters
    ----------
    time, values : (times,) array
    """
    if len(time) <= MOST_POINTS:
        return time, values
    size = -(-len(time) // _STRETCHES)
    padded = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    first = np.arange(len(padded)) * size
    chosen = np.concatenate([[0], first + padded.argmin(axis=1), first + padded.argmax(axis=1), [len(time) - 1]])
    chosen = np.unique(np.minimum(chosen, len(time) - 1))
    return time[chosen], values[chosen]


def thinned_band(time: np.ndarray, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A band from ``low`` to ``high`` (times,): of each stretch the outermost values, at its beginning."""
    if len(time) <= MOST_POINTS:
        return time, low, high
    first = np.arange(0, len(time), -(-len(time) // _STRETCHES))
    return time[first], np.fmin.reduceat(low, first), np.fmax.reduceat(high, first)
