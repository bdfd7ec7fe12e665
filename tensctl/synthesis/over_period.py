"""Integrals over one period, by doubling: sums of positive terms only, so stiff damping does no harm.

    F(t) = exp(A t),   S(t) = int_0^t F' W F dt,   S(2t) = S(t) + F(t)' S(t) F(t)

The first S is that of a period so short that |A| t < 1/2 (Van Loan's block exponential). With the state (x, u, change
of u) it gives the cost of a period in which rest lengths ramp; with A' in place of A the covariance that noise leaves.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg as sla
from jaxtyping import Inexact

from tensctl.synthesis.weights import Cost

# Longest first period, over 1/|A|: the block exponential then has no large cancelling terms.
_SHORT = 0.5


def integral(
    A: Inexact[np.ndarray, "n n"], W: Inexact[np.ndarray, "n n"], t: float
) -> tuple[Inexact[np.ndarray, "n n"], Inexact[np.ndarray, "n n"]]:
    """F(t) and S(t)."""
    n, halvings = len(A), max(0, int(np.ceil(np.log2(max(np.linalg.norm(A, 1) * t / _SHORT, 1e-300)))))
    h = t / 2**halvings
    block = sla.expm(h * np.block([[-A.conj().T, W], [np.zeros((n, n)), A]]))
    F = block[n:, n:]
    S = F.conj().T @ block[:n, n:]
    for _ in range(halvings):
        S, F = S + F.conj().T @ S @ F, F @ F
    return F, 0.5 * (S + S.conj().T)


def ramped_cost(A: np.ndarray, B: np.ndarray, cost: Cost, dt: float) -> Cost:
    """Cost of one period as weights on z = (x_k, u_k) and u_(k+1), exact for inputs that ramp."""
    nx, nu = B.shape
    n = nx + 2 * nu
    rate = np.zeros((n, n), np.result_type(A, B, cost.Q, cost.R))
    weight = np.zeros_like(rate)
    rate[:nx, :nx], rate[:nx, nx : nx + nu] = A, B
    rate[nx : nx + nu, nx + nu :] = np.eye(nu) / dt
    weight[: nx + nu, : nx + nu] = cost.matrix
    change = np.eye(n)  # (x, u_k, u_(k+1) - u_k) from (x, u_k, u_(k+1))
    change[nx + nu :, nx : nx + nu] = -np.eye(nu)
    total = change.T @ integral(rate, weight, dt)[1] @ change
    z, u = slice(0, nx + nu), slice(nx + nu, n)
    return Cost(total[z, z], total[u, u], total[z, u])
