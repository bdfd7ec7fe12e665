"""Random problems of predictive control in coordinates of rates, small and dense."""

import numpy as np

from tensctl.synthesis import bordered, primal

STAGES, INPUTS, TENSIONS = 5, 4, 3
N = STAGES * INPUTS


def posed(rng, crowded=False):
    """A random problem in rates: form and step; crowded, with rows that say the same twice and rates that are given."""
    root = rng.standard_normal((N, N))
    rows = rng.standard_normal((STAGES * TENSIONS, N))
    lower, upper = -rng.uniform(0.2, 1.0, N), rng.uniform(0.2, 1.0, N)
    if crowded:
        rows[1::TENSIONS] = rows[::TENSIONS]
        lower[:3] = upper[:3]
    form = bordered.Form(root @ root.T + np.eye(N), rows, np.ascontiguousarray(rows.T), 5.0, STAGES)
    floor = rng.uniform(-1.0, 1.0, STAGES * TENSIONS)
    if crowded:
        floor[1::TENSIONS] = floor[::TENSIONS]
    return form, primal.Step(20 * rng.standard_normal(N), 2e3, lower, upper, floor, np.full(N, -1.2), np.full(N, 1.3))


def stated(form, step):
    """Hessian, slopes, rows and bounds of rates and slacks, in full."""
    ones = np.kron(np.eye(STAGES), np.ones((TENSIONS, 1)))
    summed = np.kron(np.tril(np.ones((STAGES, STAGES))), np.eye(INPUTS))
    H = np.zeros((N + STAGES, N + STAGES))
    H[:N, :N], H[N:, N:] = form.G, form.curvature * np.eye(STAGES)
    f = np.append(step.g, np.full(STAGES, step.price))
    A = np.block([[form.rows, ones], [summed, np.zeros((N, STAGES))]])
    lower = np.concatenate([step.lower, np.zeros(STAGES), step.floor, step.low])
    upper = np.concatenate([step.upper, np.full(STAGES, 1e30), np.full(step.floor.size, 1e30), step.high])
    return H, f, A, lower, upper
