"""Margins of single inputs and of sampled LQR: enclosed, guaranteed, and reached by a gain that ends stability."""

import numpy as np
import pytest

import tensctl as tc

DT = 0.02


@pytest.fixture(scope="module")
def sampled(mast):
    return tc.lqr(mast[2], dt=DT)


def test_each_input_of_lqr_is_enclosed(mast):
    """A fine sweep finds no less, the search no more; and |S_ii| <= 1, which a diagonal R gives, makes alpha >= 2/3."""
    sensitivity = tc.lqr(mast[2]).sensitivity
    sweep = np.array([np.abs(np.diag(sensitivity.at(w)) - 0.5) for w in np.geomspace(0.1, 1e4, 1500)]).max(axis=0)
    enclosures, (_, single) = sensitivity.enclosures(), sensitivity.margins()
    assert len(enclosures) == sweep.size
    for (least, largest), peak, searched in zip(enclosures, sweep, single, strict=True):
        assert least <= largest <= least * (1 + 1e-4)
        assert least <= 1 / peak
        assert 1 / peak == pytest.approx(largest, rel=1e-2)
        assert least <= searched.alpha * (1 + 1e-9)
        assert least >= 2 / 3 * (1 - 1e-5)


def test_return_difference_of_sampled_lqr(sampled):
    """S*[G; I]* M [G; I] S = R + B'PB at every frequency, with M the weights of a period and G = (zI - A)^-1 B."""
    A, B = sampled.sampled.with_input_state()
    weight = sampled.period_cost.R + B.T @ sampled.P @ B
    for w in np.linspace(0.1, np.pi / DT, 25):
        S = sampled.sensitivity.at(w)
        shown = np.vstack([np.linalg.solve(np.exp(1j * w * DT) * np.eye(len(A)) - A, B), np.eye(B.shape[1])]) @ S
        left = shown.conj().T @ sampled.period_cost.matrix @ shown - weight
        assert np.linalg.norm(left) < 1e-7 * np.linalg.norm(weight)


def test_the_margin_of_sampled_lqr_is_where_stability_ends(sampled):
    """Gains up to (2 + alpha)/(2 - alpha) or its inverse keep it; a complex one of that size puts a pole on |z| = 1."""
    A, B = sampled.sampled.with_input_state()
    least, largest = sampled.sensitivity.enclosure()
    assert largest == pytest.approx(least, rel=1e-4)
    whole, _ = sampled.sensitivity.margins()
    assert least <= whole.alpha * (1 + 1e-9)
    eye, w = np.eye(B.shape[1]), 2 * np.pi * whole.frequency
    rng = np.random.default_rng(3)
    low, high = (2 - least) / (2 + least), (2 + least) / (2 - least)
    for _ in range(20):
        gains = rng.choice([low, high], B.shape[1]) ** 0.999
        assert np.abs(np.linalg.eigvals(A - B @ np.diag(gains) @ sampled.K)).max() < 1
    left, sizes, right = np.linalg.svd(sampled.sensitivity.at(w) - 0.5 * eye)
    turn = np.outer(right[0].conj(), left[:, 0].conj()) / sizes[0]
    factor = np.linalg.solve((eye - turn / 2).T, (eye + turn / 2).T).T
    poles = np.linalg.eigvals(A - B @ factor @ sampled.K)
    assert np.abs(poles - np.exp(1j * w * DT)).min() < 1e-6


def test_single_inputs_of_sampled_lqr(sampled):
    """One input alone may change at least as much as all at once, and no sweep finds less."""
    least, _ = sampled.sensitivity.enclosure()
    sweep = np.array([np.abs(np.diag(sampled.sensitivity.at(w)) - 0.5) for w in np.linspace(0, np.pi / DT, 800)])
    for (low, high), peak in zip(sampled.sensitivity.enclosures(), sweep.max(axis=0), strict=True):
        assert low >= least * (1 - 1e-9)
        assert low <= 1 / peak
        assert high == pytest.approx(low, rel=1e-4)
