"""How strongly the modes of a damped model are driven or seen, by the eigenvectors of the damped A.

    A v = lambda v,  |v| = 1:  gain sqrt(2) |C v|;  equal lambda together by the singular values of C V, V orthonormal

Every undamped mode is credited with the two eigenvectors that it takes the largest part in, and counts the weaker. An
overdamped mode has two real eigenvalues, an oscillating one a conjugate pair. Eigenvectors of nearly defective pairs
(critical damping) are blurred by the square root of rounding, about 1e-8.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.optimize import linear_sum_assignment

from tensctl.linear import LinearModel

# Eigenvalues nearer than this part of the largest are one.
_SAME = 1e-9


def damped_gains(
    A: Float[np.ndarray, "nx nx"], C: Float[np.ndarray, "ny nx"], linear: LinearModel
) -> Float[np.ndarray, " modes"]:
    """Gain of each mode of a damped model; pass A and C for observability, A' and B' for controllability."""
    poles, vectors = np.linalg.eig(A)
    strengths = np.empty(poles.size)
    for group in _groups(poles):
        basis, _ = np.linalg.qr(vectors[:, group])
        found = np.linalg.svd(C @ basis, compute_uv=False)[: group.size]
        strengths[group] = np.concatenate([found, np.zeros(group.size - found.size)])
    gains = np.full(len(linear.modes), np.inf)
    np.minimum.at(gains, _owners(linear, vectors), np.sqrt(2) * strengths)
    return gains


def _groups(poles: np.ndarray) -> list[np.ndarray]:
    """Indices of equal poles together."""
    left, groups = list(np.argsort(np.real(poles), kind="stable")), []
    while left:
        first = left[0]
        group = [k for k in left if abs(poles[k] - poles[first]) <= _SAME * np.abs(poles).max()]
        groups.append(np.array(group))
        left = [k for k in left if k not in group]
    return groups


def _owners(linear: LinearModel, vectors: np.ndarray) -> np.ndarray:
    """The mode of each eigenvector: two for each mode, so that the parts they take add up to the most."""
    sorted_back = np.empty_like(vectors)
    sorted_back[linear.order] = vectors
    half = len(linear.modes)
    part = np.abs(sorted_back[:half]) ** 2 + np.abs(sorted_back[half:]) ** 2
    _, chosen = linear_sum_assignment(np.vstack([part, part]).T, maximize=True)
    return chosen % half
