"""Margins of single inputs and of sampled LQR: enclosed, guaranteed, and reached by a gain that ends stability."""

import numpy as np
import pytest

import tensctl as tc
from tensctl.synthesis.hinf import System, hinf
from tensctl.synthesis.margins import Sensitivity
from tensctl.synthesis.single_peaks import Expansion, highest_peak, peaks

DT = 0.02


@pytest.fixture(scope="module")
def sampled(mast):
    return tc.lqr(mast[2], dt=DT)


def test_each_input_of_lqr_is_enclosed(mast):
    """A fine sweep finds no less; and |S_ii| <= 1, which a diagonal R gives, makes alpha >= 2/3."""
    sensitivity = tc.lqr(mast[2]).sensitivity
    sweep = np.array([np.abs(np.diag(sensitivity.at(w)) - 0.5) for w in np.geomspace(0.1, 1e4, 1500)]).max(axis=0)
    enclosures = sensitivity.enclosures()
    assert len(enclosures) == sweep.size
    for (least, largest), peak in zip(enclosures, sweep, strict=True):
        assert least <= largest <= least * (1 + 1e-4)
        assert least <= 1 / peak
        assert 1 / peak == pytest.approx(largest, rel=1e-2)
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
    eye, w = np.eye(B.shape[1]), 2 * np.pi * sampled.sensitivity.all_inputs.frequency
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


@pytest.mark.parametrize("dt", [None, DT])
@pytest.mark.parametrize("seen", [False, True])
def test_bounds_between_frequencies_are_those_of_eigenvalues(mast, seen, dt):
    """Both enclose the same number, by nothing in common, for inputs of LQR and LQG."""
    eyes = tc.sensors(mast[0].structure, lengths=1e-3)
    s = (tc.lqg(mast[2], eyes, dt=dt) if seen else tc.lqr(mast[2], dt=dt)).sensitivity
    half = np.array([[0.5]])
    for i, one in list(enumerate(s.each_input))[::4]:
        other = hinf(System(s.A, s.B[:, [i]], s.C[[i]], half, dt))
        assert one.alpha <= 1 / other.low
        assert 1 / other.high <= one.largest
        assert one.alpha == pytest.approx(one.largest, rel=1e-5)
    weakest, which = s.weakest_input
    assert weakest.largest == pytest.approx(min(one.largest for one in s.each_input), rel=1e-6)
    assert s.each_input[which].alpha <= weakest.largest


def test_a_peak_at_rest_that_no_pole_shows(mast):
    """The least margin of a single input of this LQG is lost at rest, below every pole."""
    s = tc.lqg(mast[2], tc.sensors(mast[0].structure, lengths=1e-3)).sensitivity
    weakest, which = s.weakest_input
    assert weakest.frequency == 0
    assert 1 / abs(s.at(0.0)[which, which] - 0.5) == pytest.approx(weakest.largest, rel=1e-9)


def lightly_damped(zeta, dt, rng):
    """Six modes, two of them 1e-4 apart, and what shows two outputs of two inputs."""
    w = np.array([1, 1.0001, 3.0, 17.0, 30.0, 400.0])
    A = np.block([[np.zeros((6, 6)), np.diag(w)], [-np.diag(w), -np.diag(2 * zeta * w)]])
    if dt is not None:
        values, V = np.linalg.eig(A)
        A = np.real(V @ np.diag(np.exp(values * dt)) @ np.linalg.inv(V))
    return A, rng.standard_normal((12, 2)), rng.standard_normal((2, 12))


@pytest.mark.parametrize("dt", [None, 0.001, 0.1])
@pytest.mark.parametrize("zeta", [1e-1, 1e-3, 1e-5])
def test_narrow_peaks(zeta, dt, rng):
    """Wherever a pole's frequency is not that of the peak, no sweep about it finds more, and the bound is met."""
    A, B, C = lightly_damped(zeta, dt, rng)
    for i, peak in enumerate(peaks(A, B, C, 0.5, dt)):
        system = System(A, B[:, [i]], C[[i]], np.array([[0.5]]), dt)
        offsets = np.concatenate([-np.geomspace(1e-8, 0.5, 200), np.geomspace(1e-8, 0.5, 200)])
        sweep = [w for w in np.outer([1.0, 1.0001, 17.0], 1 + offsets).ravel() if dt is None or w * dt < np.pi]
        assert max(map(system.gain, sweep)) <= peak.high
        assert peak.low * (1 - 1e-9) <= system.gain(peak.omega)
        assert peak.high <= peak.low * (1 + 1e-4)


@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-6, 1e-2])
def test_poles_that_nearly_coincide(apart):
    """1/2 + 4/((s + 1)(s + 1 + a)) is largest at rest; eigenvectors tell that they are hardly two, or none."""
    A = np.array([[-1.0, 1.0], [0.0, -1.0 - apart]])
    B, C = np.array([[0.0], [4.0]]), np.array([[1.0, 0.0]])
    exact = 0.5 + 4 / (1 + apart)
    assert (Expansion.of(A, B, C, 0.5, None).error > 1e-6) == (apart < 1e-10)
    peak, which = highest_peak(A, B, C, 0.5, None)
    assert which == 0
    assert peak.low <= exact * (1 + 1e-9)
    assert exact <= peak.high <= peak.low * (1 + 1e-4)


def test_a_loop_that_forgives_everything_but_infinity():
    """|S - 1/2| of S = 1 - 1/(2(s + 1)) is below 1/2 and comes as near as one likes at high frequencies: alpha is 2."""
    s = Sensitivity(-np.eye(1), np.eye(1), -0.5 * np.eye(1), None)
    for margin in (s.all_inputs, *s.each_input):
        assert margin.alpha == pytest.approx(2, rel=1e-5)
        assert margin.alpha <= 2 <= margin.largest * (1 + 1e-12)
        assert margin.frequency == np.inf


@pytest.mark.parametrize("dt", [None, DT])
def test_a_loop_that_is_not_stable_has_no_margin(dt):
    s = Sensitivity(1.5 * np.eye(2), np.eye(2), -np.eye(2), dt)
    assert {(one.alpha, one.largest) for one in (s.all_inputs, *s.each_input, s.weakest_input[0])} == {(0.0, 0.0)}
    assert s.all_inputs.gain == (1.0, 1.0)
    assert s.all_inputs.phase == 0


def test_what_is_not_asked_in_passing():
    """Beyond 640 states the margin of all inputs is left to who asks for it."""
    size = 641
    s = Sensitivity(-np.eye(size), np.ones((size, 1)), -np.ones((1, size)), None)
    assert s.costly
    assert "beyond 640 states: a loop of 641" in s.costly
    assert Sensitivity(-np.eye(2), np.eye(2), -np.eye(2), None).costly is None
