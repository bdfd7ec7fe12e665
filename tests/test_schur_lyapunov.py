"""Lyapunov equations by halves of a Schur form: residual, SciPy's answer, blocks of two that no cut may open."""

import numpy as np
import pytest
import scipy.linalg as sla

from tensctl.synthesis.schur_lyapunov import LyapunovSolver


def stable(n, kind, sampled, rng):
    """A random matrix with half of its poles in pairs, pushed into the stable half plane or the unit circle."""
    A = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if kind == "complex" else 0.0)
    values = np.linalg.eigvals(A)
    if sampled:
        return A / (1.05 * np.abs(values).max())
    return A - (values.real.max() + 0.1) * np.eye(n)


def noise(n, kind, rng):
    root = rng.standard_normal((n, n)) + (1j * rng.standard_normal((n, n)) if kind == "complex" else 0.0)
    return root @ root.conj().T


@pytest.mark.parametrize("n", [1, 2, 64, 65, 131, 200])
@pytest.mark.parametrize("kind", ["real", "complex"])
@pytest.mark.parametrize("sampled", [False, True])
def test_agrees_with_scipy(n, kind, sampled, rng):
    A, W = stable(n, kind, sampled, rng), noise(n, kind, rng)
    solver = LyapunovSolver.of(A, sampled=sampled)
    X = solver.solve(W)
    left = A @ X @ A.conj().T - X + W if sampled else A @ X + X @ A.conj().T + W
    assert solver.stable
    assert np.linalg.norm(left) < 1e-12 * n * np.linalg.norm(X) * max(np.linalg.norm(A, 2), 1)
    wanted = sla.solve_discrete_lyapunov(A, W) if sampled else sla.solve_continuous_lyapunov(A, -W)
    assert np.linalg.norm(X - wanted) < 1e-9 * np.linalg.norm(wanted)
    assert np.iscomplexobj(X) == (kind == "complex")


@pytest.mark.parametrize("shift", [0, 1])
def test_no_cut_opens_a_pair(shift, rng):
    """Oscillators alone: with and without one real pole in front every middle falls on a pair at some depth."""
    pairs = [np.array([[-0.1, w], [-w, -0.1]]) for w in rng.uniform(1, 50, 150)]
    A = sla.block_diag(*([[-1.0]] if shift else []), *pairs)
    A = A + np.triu(rng.standard_normal(A.shape), 2) * (
        sla.block_diag(*([[1.0]] if shift else []), *map(abs, pairs)) == 0
    )
    W = noise(len(A), "real", rng)
    X = LyapunovSolver.of(A).solve(W)
    assert np.linalg.norm(A @ X + X @ A.T + W) < 1e-10 * np.linalg.norm(A, 2) * np.linalg.norm(X)


def test_rates_that_lie_far_apart(rng):
    """Of 160 decays from 1e-6 to 1e6 the exact answer is W_ij / (a_i + a_j), each entry to 1e-9 of its size."""
    rates = np.geomspace(1e-6, 1e6, 160)
    W = noise(160, "real", rng)
    X = LyapunovSolver.of(-np.diag(rates)).solve(W)
    wanted = W / (rates[:, None] + rates)
    assert np.abs(X - wanted).max() < 1e-9 * np.abs(wanted).max()
    assert (np.abs(np.diag(X) / np.diag(wanted) - 1) < 1e-9).all()


def test_what_is_gone_in_a_sample(rng):
    """A nilpotent loop: X = sum A^k W A'^k ends."""
    A, W = np.diag(np.ones(99), 1), noise(100, "real", rng)
    X = LyapunovSolver.of(A, sampled=True).solve(W)
    wanted, power = np.zeros_like(W), np.eye(100)
    for _ in range(100):
        wanted, power = wanted + power @ W @ power.T, A @ power
    assert np.abs(X - wanted).max() < 1e-8 * np.abs(wanted).max()


@pytest.mark.parametrize(("A", "sampled"), [(np.diag([-1.0, 0.1]), False), (np.diag([0.5, 1.1]), True)])
def test_tells_what_is_not_stable(A, sampled):
    assert not LyapunovSolver.of(A, sampled=sampled).stable
