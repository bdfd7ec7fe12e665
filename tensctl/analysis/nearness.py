"""Gains of modes whose eigenvalues are equal, nearly equal or apart, without a step between these cases.

    G = (V* C'C V) o Phi,   E = (V* V) o Phi,   Phi_jl = exp(-|x_j - x_l|^2 / 2),   gains^2 = eigenvalues of (G, E)

V holds unit eigenvectors and x their eigenvalues over a resolution. For equal eigenvalues Phi = 1, and the gains are
the singular values of C on the space that V spans; far apart Phi = I, and each eigenvector has its own. Nothing is
squared: exp(-(x - y)^2/2) = sum_n f_n(x) f_n(y) with f_n(x) = x^n exp(-x^2/2)/sqrt(n!), so both matrices have factors
of known entries, and a gain much smaller than the others keeps its digits.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Complex, Float
from scipy.optimize import linear_sum_assignment

# Eigenvalues nearer than this part of themselves are resolved in part only: to tell two such frequencies apart takes a
# hundred thousand periods. Smaller, and a gain changes from one definition to the other more steeply.
RESOLUTION = 1e-6
# exp(-x^2/2) is below rounding from here on.
APART = 9.0
# Eigenvectors whose part square to the others is smaller than this are one: a defective pair's angle is the square root
# of rounding, 1e-8, and equal eigenvalues of a semisimple matrix come with angles of size one.
_PARALLEL = 1e-4


def gains(
    vectors: Complex[np.ndarray, "n r"] | Float[np.ndarray, "n r"],
    seen: Complex[np.ndarray, "m r"] | Float[np.ndarray, "m r"],
    places: Float[np.ndarray, " r"],
) -> Float[np.ndarray, " r"]:
    """Gains of one group, each at the eigenvector that it belongs to most.

    Parameters
    ----------
    vectors : (n, r)
        Unit eigenvectors.
    seen : (m, r)
        C times the eigenvectors.
    places : (r,)
        Eigenvalues over the resolution.
    """
    if places.size == 1:
        return np.linalg.norm(seen, axis=0)
    features = _features(places - 0.5 * (places.min() + places.max()))
    spread, shown = _weighted(vectors, features), _weighted(seen, features)
    _, sizes, right = np.linalg.svd(spread, full_matrices=False)
    kept = sizes > _PARALLEL * sizes[0]
    _, values, mixes = np.linalg.svd(shown @ (right[kept].conj().T / sizes[kept]))
    found = np.zeros(int(kept.sum()))
    found[: values.size] = values[: found.size]
    # Parts of each eigenvector in each direction; eigenvectors that are one share what is found for it.
    part = np.abs(mixes @ (sizes[kept, None] * right[kept])) ** 2
    return found[_owners(part)]


def _features(x: Float[np.ndarray, " r"]) -> Float[np.ndarray, "r terms"]:
    """f_n(x), as many as it takes for the kernel to be exact to rounding."""
    far = float(np.abs(x).max())
    count = int(far**2 + 9 * far) + 20
    terms = np.empty((x.size, count))
    terms[:, 0] = np.exp(-0.5 * x**2)
    for n in range(1, count):
        terms[:, n] = terms[:, n - 1] * x / np.sqrt(n)
    return terms[:, np.abs(terms).max(axis=0) > 0]


def _weighted(columns: np.ndarray, features: np.ndarray) -> np.ndarray:
    """Each column times each of its features, stacked, and shortened to a triangle with the same products."""
    stacked = (columns[:, None, :] * features.T[None]).reshape(-1, columns.shape[1])
    return np.asarray(np.linalg.qr(stacked, mode="r")) if len(stacked) > columns.shape[1] else stacked


def _owners(part: Float[np.ndarray, "found r"]) -> np.ndarray:
    """The direction of each eigenvector, every direction taken once before one is taken twice."""
    found, count = part.shape
    rows, columns = linear_sum_assignment(part, maximize=True)
    owners = part.argmax(axis=0) if found < count else np.empty(count, int)
    owners[columns] = rows
    return owners
