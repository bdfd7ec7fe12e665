"""Riccati solutions agree with SciPy, leave no residual, and are refused where there is none."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from support import shell_scene, solved

import tensctl as tc
from tensctl.linear import sample_ramped
from tensctl.synthesis import care, dare
from tensctl.synthesis.doubling import lyapunov

sizes = st.integers(1, 12)
seeds = st.integers(0, 10**6)


def system(n, m, seed, shift=0.0):
    """A random system with its spectrum shifted, and weights with Q >= 0, R > 0."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n)) / np.sqrt(n) + shift * np.eye(n)
    B, C, D = rng.standard_normal((n, m)), rng.standard_normal((n, n)), rng.standard_normal((m, m))
    return A, B, C @ C.T, D @ D.T + np.eye(m)


def oscillators(frequencies, drives):
    """Undamped oscillators in energy coordinates and one input."""
    count = len(frequencies)
    omega = np.diag(frequencies)
    A = np.block([[np.zeros((count, count)), omega], [-omega, np.zeros((count, count))]])
    return A, np.concatenate([np.zeros(count), drives])[:, None]


def continuous_residual(A, B, Q, R, X):
    terms = A.T @ X, X @ A, -X @ B @ np.linalg.solve(R, B.T @ X), Q
    return np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms)


def discrete_residual(A, B, Q, R, X):
    inner = np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
    terms = A.T @ X @ A, -A.T @ X @ B @ inner, -X, Q
    return np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms)


class TestContinuous:
    @given(n=sizes, seed=seeds, shift=st.sampled_from([-2.0, 0.0, 0.5]))
    def test_random_systems(self, n, seed, shift):
        """With an input for every second state: fewer make X itself too large for double precision."""
        A, B, Q, R = system(n, n // 2 + 1, seed, shift)
        found = care(A, B, Q, R)
        assert continuous_residual(A, B, Q, R, found.X) < 1e-12
        assert found.residual == pytest.approx(continuous_residual(A, B, Q, R, found.X), abs=1e-13)
        assert (found.X == found.X.T).all()
        assert np.linalg.eigvals(A - B @ found.K).real.max() < 0
        assert np.linalg.norm(found.K - np.linalg.solve(R, B.T @ found.X)) < 1e-12 * np.linalg.norm(found.K)

    @given(n=st.integers(1, 8), seed=seeds, shift=st.sampled_from([-2.0, 0.0, 0.5]))
    def test_agrees_with_scipy(self, n, seed, shift):
        A, B, Q, R = system(n, n, seed, shift)
        B = B + 2 * np.eye(n)
        wanted = scipy.linalg.solve_continuous_are(A, B, Q, R)
        left = continuous_residual(A, B, Q, R, wanted)
        assert np.linalg.norm(care(A, B, Q, R).X - wanted) < (1e-9 + 1e3 * left) * np.linalg.norm(wanted)

    def test_scalar_in_closed_form(self):
        """2 a x - x^2 b^2/r + q = 0."""
        for a in (-3.0, 1e-9, 3.0):
            assert self.scalar(a) < 1e-14

    def scalar(self, a):
        """Relative error against the closed form."""
        b, q, r = 2.0, 5.0, 0.5
        x = (a + np.sqrt(a * a + q * b * b / r)) * r / b**2
        return abs(care(*(np.array([[value]]) for value in (a, b, q, r))).X[0, 0] / x - 1)

    def test_integrator(self):
        assert self.scalar(0.0) < 1e-14

    def test_stiff_spectrum(self, rng):
        """Frequencies over four decades, all undamped."""
        frequencies = np.logspace(-1, 3, 12)
        A, B = oscillators(frequencies, rng.uniform(0.5, 1.5, 12))
        Q, R = np.eye(24), np.eye(1)
        found = care(A, B, Q, R)
        assert continuous_residual(A, B, Q, R, found.X) < 1e-12
        assert np.linalg.eigvals(A - B @ found.K).real.max() < 0
        assert np.linalg.eigvalsh(found.X).min() > 0

    @pytest.mark.parametrize("decades", [5, 8])
    def test_stiff_spectrum_with_weights_over_eight_decades(self, rng, decades):
        frequencies = np.logspace(0, decades, 20)
        A, _ = oscillators(frequencies, np.zeros(20))
        B = np.vstack([np.zeros((20, 10)), frequencies[:, None] * rng.standard_normal((20, 10))])
        found = care(A, B, np.eye(40), np.diag(np.logspace(-4, 4, 10)))
        assert continuous_residual(A, B, np.eye(40), np.diag(np.logspace(-4, 4, 10)), found.X) < 1e-11
        assert np.linalg.eigvals(A - B @ found.K).real.max() < 0

    @given(n=st.integers(1, 6), seed=seeds, shift=st.sampled_from([-2.0, 0.0, 0.5]))
    def test_complex_systems_are_the_real_ones_of_twice_the_size(self, n, seed, shift):
        """M -> [Re M, -Im M; Im M, Re M] turns products into products, so also solutions into solutions."""
        real, imaginary = system(n, n, seed, shift), system(n, n, seed + 1)
        A, B, C = real[0] + 1j * imaginary[0], real[1] + 1j * imaginary[1], real[1] - 1j * imaginary[0]
        Q, R = C @ C.conj().T, np.eye(n) + B.conj().T @ B
        found = care(A, B, Q, R)
        pair = care(*(np.block([[M.real, -M.imag], [M.imag, M.real]]) for M in (A, B, Q, R)))
        assert np.linalg.norm(found.X - pair.X[:n, :n] - 1j * pair.X[n:, :n]) < 1e-9 * np.linalg.norm(found.X)
        assert np.linalg.norm(found.K - pair.K[:n, :n] - 1j * pair.K[n:, :n]) < 1e-9 * np.linalg.norm(found.K)
        assert (found.X == found.X.conj().T).all()
        assert found.residual < 1e-12

    def test_an_unstable_eigenvalue_on_the_first_shift(self):
        """The shift between the slowest and the fastest rate would make A - gamma I singular here."""
        A, B = np.diag([1.0, 2.0, 4.0]), np.eye(3)
        found = care(A, B, np.eye(3), np.eye(3))
        assert np.abs(np.diag(found.X) - np.diag(A) - np.sqrt(np.diag(A) ** 2 + 1)).max() < 1e-13
        assert found.residual < 1e-14

    def test_a_shell_in_energy_coordinates(self):
        _, _, linear = solved(shell_scene(4, 2))
        flexible = linear.flexible
        Q, R = np.eye(len(flexible.A)), 100 * np.eye(72)
        found = care(flexible.A, flexible.B, Q, R)
        assert continuous_residual(flexible.A, flexible.B, Q, R, found.X) < 1e-13

    @pytest.mark.parametrize("frequency", [0.3, 0.5, 2.0, 40.0])
    def test_refuses_an_undamped_mode_that_nothing_drives(self, frequency):
        A, B = oscillators([1.0, frequency], [1.0, 0.0])
        with pytest.raises(tc.SynthesisError, match="no stabilising solution: some mode is neither damped nor driven"):
            care(A, B, np.eye(4), np.eye(1))

    def test_refuses_an_unstable_mode_that_nothing_drives(self):
        with pytest.raises(tc.SynthesisError, match="Riccati equation"):
            care(np.diag([-1.0, 2.0]), np.array([[1.0], [0.0]]), np.eye(2), np.eye(1))

    @pytest.mark.parametrize("ratio", [1e4, 1e8, 1e12])
    def test_a_stiff_mode_decides_nothing_about_a_soft_one(self, ratio):
        """Modes that do not see each other have each its own solution, however far apart their G and X are."""
        given = ((1.0, 1.0, 1e2), (ratio**0.5, ratio, 1 / ratio))
        parts = [(*oscillators([omega], [drive]), np.diag([weight, 0.0])) for omega, drive, weight in given]
        A, B, Q = (scipy.linalg.block_diag(*each) for each in zip(*parts, strict=True))
        alone = [np.diag(care(*part, np.eye(1)).X) for part in parts]
        assert np.diag(care(A, B, Q, np.eye(2)).X) == pytest.approx(np.concatenate(alone), rel=1e-13, abs=0)

    @pytest.mark.parametrize("drive", [0.0, 1e-16])
    def test_refuses_beside_a_stiff_mode_what_rounding_alone_drives(self, drive):
        """The second mode has no more of the stiff one's input than rounding leaves there."""
        A, _ = oscillators([1.0, 3.0, 1e4], np.zeros(3))
        B = np.zeros((6, 2))
        B[3, 0], B[4:, 1] = 1.0, (1e8 * drive, 1e8)
        with pytest.raises(tc.SynthesisError, match="neither damped nor driven"):
            care(A, B, np.diag([1.0, 1.0, 1e-8, 0, 0, 0]), np.eye(2))

    def test_takes_a_damped_mode_that_nothing_drives(self):
        A, B = oscillators([1.0, 3.0], [1.0, 0.0])
        A = A - np.diag([0, 0, 0, 0.2])
        found = care(A, B, np.eye(4), np.eye(1))
        assert continuous_residual(A, B, np.eye(4), np.eye(1), found.X) < 1e-14


class TestLyapunov:
    @given(n=sizes, seed=seeds)
    def test_agrees_with_scipy(self, n, seed):
        A, _, Q, _ = system(n, 1, seed, -3.0)
        wanted = scipy.linalg.solve_continuous_lyapunov(A.T, -Q)
        for gamma in (0.3, 3.0, 30.0):
            assert np.linalg.norm(lyapunov(A, Q, gamma) - wanted) < 1e-5 * np.linalg.norm(wanted)

    def test_an_unstable_matrix_has_none(self):
        assert lyapunov(np.diag([-1.0, 0.5]), np.eye(2), 2.0) is None


class TestDiscrete:
    @given(n=sizes, m=st.integers(1, 4), seed=seeds, scale=st.sampled_from([0.3, 1.0, 1.5]))
    def test_random_systems(self, n, m, seed, scale):
        A, B, Q, R = system(n, m, seed)
        A = scale * A
        found = dare(A, B, Q, R)
        assert discrete_residual(A, B, Q, R, found.X) < 1e-12
        assert np.abs(np.linalg.eigvals(A - B @ found.K)).max() < 1
        assert (found.X == found.X.T).all()

    @given(n=st.integers(1, 8), seed=seeds)
    def test_agrees_with_scipy(self, n, seed):
        A, B, Q, R = system(n, n, seed)
        B = B + 2 * np.eye(n)
        wanted = scipy.linalg.solve_discrete_are(A, B, Q, R)
        left = discrete_residual(A, B, Q, R, wanted)
        assert np.linalg.norm(dare(A, B, Q, R).X - wanted) < (1e-9 + 1e3 * left) * np.linalg.norm(wanted)

    def test_sampled_shell_with_the_input_as_state(self, mast):
        """The terminal weight of the predictive controller: Q is singular, the input state is dead-beat."""
        _, _, linear = mast
        A, B = sample_ramped(linear.A, linear.B, 0.02).with_input_state()
        Q, R = np.diag(np.repeat([0.02, 0.0], [42, 21])), 2 * np.eye(21)
        found = dare(A, B, Q, R)
        assert discrete_residual(A, B, Q, R, found.X) < 1e-13
        assert np.abs(np.linalg.eigvals(A - B @ found.K)).max() < 1

    @pytest.mark.parametrize("angle", [0.3, 0.7, 1.0])
    def test_refuses_what_nothing_drives(self, angle):
        c, s = np.cos(angle), np.sin(angle)
        A = np.array([[c, s, 0], [-s, c, 0], [0, 0, 0.5]])
        with pytest.raises(tc.SynthesisError, match="Riccati equation"):
            dare(A, np.array([[0.0], [0.0], [1.0]]), np.eye(3), np.eye(1))

    @pytest.mark.parametrize("ratio", [1e4, 1e6, 1e8, 1e12])
    def test_a_stiff_mode_decides_nothing_about_a_soft_one(self, ratio):
        """One mode is driven, the other weighed by so much: each keeps its own solution, however large |G| |X|."""
        parts = [
            (turned(0.3), np.array([[0.0], [ratio]]), np.eye(2)),
            (turned(1.0), np.eye(2)[:, :1], ratio * np.eye(2)),
        ]
        A, B, Q = (scipy.linalg.block_diag(*each) for each in zip(*parts, strict=True))
        alone = [np.diag(dare(*part, np.eye(1)).X) for part in parts]
        assert np.diag(dare(A, B, Q, np.eye(2)).X) == pytest.approx(np.concatenate(alone), rel=1e-13, abs=0)

    @pytest.mark.parametrize("drive", [0.0, 1e-16])
    def test_refuses_beside_a_stiff_mode_what_rounding_alone_drives(self, drive):
        """The second mode has no more of the stiff one's input than rounding leaves there."""
        with pytest.raises(tc.SynthesisError, match="neither damped nor driven"):
            dare(*beside_a_stiff_mode(drive))

    def test_takes_beside_a_stiff_mode_what_is_driven_weakly(self):
        """Drives of 1e-12 and 1e-10 of the stiff mode's: the decay is known, since it is proportional to them."""

        def decay(drive):
            A, B, Q, R = beside_a_stiff_mode(drive)
            found = dare(A, B, Q, R)
            assert discrete_residual(A, B, Q, R, found.X) < 1e-10
            return 1 - np.abs(np.linalg.eigvals(A - B @ found.K)).max()

        assert decay(1e-12) > 0
        assert decay(1e-12) == pytest.approx(1e-2 * decay(1e-10), rel=1e-5)


def beside_a_stiff_mode(drive):
    """A, B, Q, R of three undamped modes; the second has so much of the third's input, which is 1e4 times stronger."""
    A = scipy.linalg.block_diag(turned(0.3), turned(0.7), turned(1.0))
    B = np.zeros((6, 2))
    B[1, 0], B[3, 1], B[5, 1] = 1.0, 1e4 * drive, 1e4
    return A, B, np.diag([1.0, 0, 1.0, 0, 1e-8, 0]), np.eye(2)


def turned(angle):
    """One undamped step of a mode."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])
