"""Weights as they were given, refused in one sentence where they are none."""

from __future__ import annotations

import numpy as np

from tensctl.analysis.scaling import input_stiffness
from tensctl.errors import SynthesisError
from tensctl.linear import LinearModel
from tensctl.scene.given import check_kind
from tensctl.synthesis.weights import Cost

# A weight that is skew or negative by less than this part of itself is so by rounding.
_SKEW = 1e-12


def checked_cost(
    linear: LinearModel, Q: np.ndarray | None, R: np.ndarray | None, N: np.ndarray | None, cost: Cost | None
) -> Cost:
    """The cost asked for, energies where nothing is said.

    Raises
    ------
    SynthesisError
        A weight of the wrong shape or sign, a cost given twice, or a model without states or inputs.
    """
    nx, nu = linear.B.shape
    if nx == 0 or nu == 0:
        raise SynthesisError(f"the model has {nx} flexible states and {nu} inputs; at least one of each is needed.")
    if cost is not None:
        check_kind(Cost, cost=cost)
    if cost is not None and any(weight is not None for weight in (Q, R, N)):
        raise SynthesisError("weights are given twice, as cost and as Q, R or N; give one of them.")
    if cost is not None:
        Q, R, N = cost.Q, cost.R, cost.N
    Q = np.eye(nx) if Q is None else matrix("Q", Q)
    R = np.diag(input_stiffness(linear)) if R is None else matrix("R", R)
    check_weight("Q", Q, nx, positive=False)
    check_weight("R", R, nu, positive=True)
    if N is None:
        return Cost(Q, R, np.zeros((nx, nu)))
    N = matrix("N", N)
    if N.shape != (nx, nu) or not np.isfinite(N).all():
        raise SynthesisError(f"N has shape {N.shape}; ({nx}, {nu}) and finite numbers are expected.")
    joint = Cost(Q, R, N)
    check_weight("[Q N; N' R]", joint.matrix, nx + nu, positive=False)
    return joint


def matrix(name: str, given: object) -> np.ndarray:
    """A weight as an array of numbers; its shape is checked elsewhere."""
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError, OverflowError):
        raise SynthesisError(f"{name} is of type {type(given).__name__}; a matrix of numbers is expected.") from None


def check_weight(name: str, weight: np.ndarray, size: int, *, positive: bool) -> None:
    """Refuse a weight that is not symmetric and positive (semi)definite."""
    if weight.shape != (size, size):
        raise SynthesisError(f"{name} has shape {weight.shape}; ({size}, {size}) is expected.")
    scale = np.abs(weight).max(initial=0.0)
    if not np.isfinite(scale):
        raise SynthesisError(f"{name} has entries that are no finite numbers.")
    if np.abs(weight - weight.T).max(initial=0.0) > _SKEW * scale:
        raise SynthesisError(f"{name} is not symmetric; give ({name} + {name}')/2.")
    smallest = np.linalg.eigvalsh(weight).min(initial=np.inf)
    if positive and smallest <= 0:
        raise SynthesisError(
            f"{name} is not positive definite; every input needs a cost, because one direction of u "
            "changes the prestress only."
        )
    if smallest < -_SKEW * scale * size:
        raise SynthesisError(f"{name} has the eigenvalue {smallest:.3g}; weights are never negative.")
