"""Truncated models keep their bounds, Hankel values are those of the Gramians and finer, undamped modes are refused."""

import control
import numpy as np
import pytest
import scipy.linalg
from support import shell_scene, solved

import tensctl as tc
from tensctl.analysis.gramian import gramian
from tensctl.synthesis.truncation import balanced, gramian_factor, modal


@pytest.fixture(scope="module")
def damped():
    """The mast with drag, its top ring's nodes as outputs."""
    _, _, linear = solved(shell_scene(pins=["P1_*_1"], drag={"coefficient": 0.3}), outputs=("nodes",))
    return linear


def system(rng, n=8, m=2, p=3):
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(n)
    return A, rng.standard_normal((n, m)), rng.standard_normal((p, n))


def gain_error(A, B, C, cut, omega):
    full = C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B)
    less = cut.C @ np.linalg.solve(1j * omega * np.eye(cut.order) - cut.A, cut.B.astype(complex))
    return np.linalg.norm(full - less, 2)


def frequencies(A):
    poles = np.linalg.eigvals(A)
    return np.concatenate([np.geomspace(1e-3, 1e3, 120), np.abs(poles.imag), np.abs(poles)])


class TestGramians:
    @pytest.mark.parametrize("sampled", [False, True])
    def test_factor_solves_lyapunov(self, rng, sampled):
        A, B, _ = system(rng)
        A = scipy.linalg.expm(0.3 * A) if sampled else A
        Z = gramian_factor(A, B, sampled=sampled)
        X = scipy.linalg.solve_discrete_lyapunov(A, B @ B.T) if sampled else None
        X = scipy.linalg.solve_continuous_lyapunov(A, -B @ B.T) if X is None else X
        assert np.abs(Z @ Z.T - X).max() < 1e-11 * np.abs(X).max()

    def test_hankel_values_agree_with_python_control(self, rng):
        A, B, C = system(rng)
        ours = balanced(A, B, C, 8).values
        X, Y = (scipy.linalg.solve_continuous_lyapunov(M, -N @ N.T) for M, N in ((A, B), (A.T, C.T)))
        wanted = np.sort(np.sqrt(np.abs(np.linalg.eigvals(X @ Y).real)))[::-1]
        assert np.abs(ours - wanted).max() < 1e-8 * wanted[0]

    def test_small_hankel_values_are_not_lost(self):
        """A chain of lags, whose values fall by decades: the small ones survive a change of units."""
        lags = np.geomspace(1, 1e4, 8)
        A = -np.diag(lags) + np.diag(lags[1:], -1)
        B, C = np.eye(8)[:, :1], np.eye(8)[-1:]
        plain = balanced(A, B, C, 6).values
        units = np.diag(np.geomspace(1e-4, 1e4, 8))
        other = balanced(units @ A @ np.linalg.inv(units), units @ B, C @ np.linalg.inv(units), 6).values
        assert plain[6] < 1e-6 * plain[0]
        assert np.abs(other / plain - 1)[:7].max() < 1e-4

    def test_of_a_horizon(self, rng):
        """Of an undamped oscillator over whole periods: the mean, T/2 |b|^2."""
        A = np.array([[0.0, 5.0], [-5.0, 0.0]])
        Z = gramian(A, np.array([[0.0], [2.0]]), 2 * np.pi * 3 / 5, None).factor
        assert np.abs(Z @ Z.T - 2 * np.pi * 3 / 5 * 2 * np.eye(2)).max() < 1e-12 * 10

    def test_long_horizons_come_to_the_infinite_one(self, rng):
        A, B, _ = system(rng)
        long, whole = gramian(A, B, 400.0, None).factor, gramian_factor(A, B)
        assert np.abs(long @ long.T - whole @ whole.T).max() < 1e-10 * np.abs(whole @ whole.T).max()


class TestBounds:
    @pytest.mark.parametrize("method", [balanced, modal])
    @pytest.mark.parametrize("order", [1, 3, 5, 7])
    def test_hold_on_a_grid(self, rng, method, order):
        A, B, C = system(rng)
        cut = method(A, B, C, order)
        worst = max(gain_error(A, B, C, cut, w) for w in frequencies(A))
        assert 0 < worst <= cut.bound * (1 + 1e-9)
        assert np.linalg.eigvals(cut.A).real.max(initial=-1) < 0
        assert order - 1 <= cut.order <= order

    def test_last_state_meets_the_bound(self, rng):
        """One state left out: the error is 2 sigma_n at some frequency, Glover's equality for a single input."""
        A, B, _ = system(rng, m=1, p=1)
        A = 0.5 * (A + A.T)
        A -= (np.linalg.eigvalsh(A).max() + 0.1) * np.eye(8)
        cut = balanced(A, B, B.T, 7)
        worst = max(gain_error(A, B, B.T, cut, w) for w in [0.0, *np.geomspace(1e-4, 1e4, 400)])
        assert worst == pytest.approx(cut.bound, rel=1e-3)

    def test_agrees_with_python_control(self, rng):
        A, B, C = system(rng, m=3)
        cut = balanced(A, B, C, 4)
        full = control.ss(A, B, C, np.zeros((3, 3)))
        values = scipy.linalg.svdvals(gramian_factor(A.T, C.T).T @ gramian_factor(A, B))
        assert cut.bound == pytest.approx(2 * values[4:].sum(), rel=1e-12)
        worst = max(gain_error(A, B, C, cut, w) for w in frequencies(A))
        less = control.ss(cut.A, cut.B, cut.C, np.zeros((3, 3)))
        assert control.norm(full - less, p="inf") == pytest.approx(worst, rel=0.05)

    @pytest.mark.parametrize("method", ["balanced", "modal"])
    def test_of_a_shell(self, damped, method):
        less = tc.truncate(damped, 20, method=method)
        assert less.truncated.order == 20
        worst = max(less.error_at(w) for w in frequencies(less.damped))
        assert 0 < worst <= less.bound
        assert less.to_statespace().input_labels == list(damped.flexible.inputs)

    def test_balanced_beats_modal(self, damped):
        assert tc.truncate(damped, 20).bound < tc.truncate(damped, 20, method="modal").bound


class TestUndamped:
    def test_is_refused(self, mast):
        for method in ("balanced", "modal"):
            with pytest.raises(tc.SynthesisError, match="rings for ever, so it has no Gramian"):
                tc.truncate(mast[2], 10, method=method)

    def test_with_a_stated_damping(self, mast):
        less = tc.truncate(mast[2], 20, damping=0.02)
        worst = max(less.error_at(w) for w in frequencies(less.damped))
        assert 0 < worst <= less.bound
        poles = np.linalg.eigvals(less.damped)
        assert -poles.real / np.abs(poles) == pytest.approx(0.02, rel=1e-6)

    def test_for_a_finite_horizon(self, mast):
        """No bound is claimed; the error of the impulse response falls with the order and is what quadrature finds."""
        errors = [tc.truncate(mast[2], order, horizon=2.0).impulse_error(2.0) for order in (10, 20, 30, 42)]
        assert errors[0] > errors[1] > errors[2] > 1e3 * errors[3]
        less = tc.truncate(mast[2], 20, horizon=2.0)
        assert less.bound is None
        points, shares = np.polynomial.legendre.leggauss(200)
        t, flexible = less.truncated, mast[2].flexible
        squared = 0.0
        for point, share in zip(points + 1, shares, strict=True):
            full = flexible.C @ scipy.linalg.expm(point * flexible.A) @ flexible.B
            squared += share * np.linalg.norm(full - t.C @ scipy.linalg.expm(point * t.A) @ t.B) ** 2
        assert errors[1] == pytest.approx(np.sqrt(squared), rel=1e-9)


class TestMistakes:
    @pytest.mark.parametrize(
        ("given", "sentence"),
        [
            ({"order": 0}, "order is 0; a whole number from 1 to 42"),
            ({"order": 10, "damping": -1.0}, "damping is -1.0; expected a finite number > 0 .a damping ratio"),
            ({"order": 10, "horizon": 0.0}, "horizon is 0.0; expected a finite number > 0 .s"),
            ({"order": 10, "horizon": 1.0, "method": "modal"}, "modal truncation has no horizon"),
        ],
    )
    def test_refused(self, mast, given, sentence):
        with pytest.raises(tc.SynthesisError, match=sentence):
            tc.truncate(mast[2], **given)

    def test_states_that_nothing_drives(self, rng):
        A, B, C = system(rng, 3, 1, 1)
        A, B = scipy.linalg.block_diag(A, -np.eye(2)), np.vstack([B, np.zeros((2, 1))])
        with pytest.raises(tc.SynthesisError, match="only 3 states are both driven and seen"):
            balanced(A, B, np.hstack([C, np.ones((1, 2))]), 4)
