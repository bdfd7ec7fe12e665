"""Motion as bytes that a page can carry: x = centre + step * q with q in 16 bits, written in base64."""

import base64
from dataclasses import dataclass

import numpy as np

# Most bytes that the frames may take before base64, unless that leaves fewer than FEWEST_FRAMES. A (3,1) shell
# keeps every one of 500 times with it, an (8,4) shell 436. The page interpolates between frames.
FRAME_BYTES = 600_000
FEWEST_FRAMES = 120
_Q = 32767  # positions use -_Q.._Q, symmetric about the centre
_T = 65535  # tensions use 1.._T; 0 is kept for slack


@dataclass(frozen=True)
class Packed:
    """Quantised frames.

    Attributes
    ----------
    times : (frames,) array
        Moments, s.
    centre : (3,) array
        Middle of the box around every position of every frame, m.
    step : float
        Length of one unit of ``nodes``, m: the box's longest edge over 65534.
    nodes : (frames, nodes, 3) int16 array
    tension_max : float
        Tension of the number 65535, N.
    tensions : (frames, tendons) uint16 array
    """

    times: np.ndarray
    centre: np.ndarray
    step: float
    nodes: np.ndarray
    tension_max: float
    tensions: np.ndarray


def pack(times: np.ndarray, nodes: np.ndarray, tensions: np.ndarray) -> Packed:
    """Quantise frames: positions to half a step, tensions to tension_max/65535, slack (0 N) exactly.

    Parameters
    ----------
    times : (times,) array
        Moments, s, ascending.
    nodes : (times, nodes, 3) array
        Positions, m.
    tensions : (times, tendons) array
        Tendon forces, N, >= 0.
    """
    keep = _evenly(times, 6 * nodes.shape[1] + 2 * tensions.shape[1])
    times, nodes, tensions = times[keep], nodes[keep], tensions[keep]
    low, high = nodes.min(axis=(0, 1)), nodes.max(axis=(0, 1))
    centre = (low + high) / 2
    step = float((high - low).max()) / (2 * _Q) or 1.0
    top = float(tensions.max(initial=0.0)) or 1.0
    quantised = np.maximum(np.rint(tensions / top * _T), tensions > 0)
    return Packed(
        times=times,
        centre=centre,
        step=step,
        nodes=np.rint((nodes - centre) / step).astype("<i2"),
        tension_max=top,
        tensions=quantised.astype("<u2"),
    )


def unpack_nodes(packed: Packed) -> np.ndarray:
    """Positions (frames, nodes, 3) in m as the page will draw them."""
    return packed.centre + packed.step * packed.nodes.astype(float)


def pack_shapes(shapes: np.ndarray) -> np.ndarray:
    """Mode shapes (modes, nodes, 3) as int8, each scaled to a largest node displacement of 127."""
    size = np.linalg.norm(shapes, axis=2).max(axis=1, initial=0.0)
    return np.rint(shapes * (127 / np.where(size > 0, size, 1.0))[:, None, None]).astype("i1")


def base64_of(array: np.ndarray) -> str:
    """The array's bytes, row by row, in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


def _evenly(times: np.ndarray, frame_bytes: int) -> np.ndarray:
    """Frames to keep: those nearest to an even division of the time, first and last included."""
    room = max(FEWEST_FRAMES, FRAME_BYTES // frame_bytes)
    if len(times) <= room:
        return np.arange(len(times))
    wanted = np.linspace(times[0], times[-1], room)
    right = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    left_is_nearer = wanted - times[right - 1] < times[right] - wanted
    return np.unique(right - left_is_nearer)
