"""Gramians against fifty digits, a Lyapunov solver and the inputs that they promise."""

from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
import scipy.linalg as sla
from support import prism_scene, reference_prism, shell_scene, solved

import tensctl as tc
from tensctl.analysis import ReachEnergies, controllability_gramian, observability_gramian
from tensctl.analysis.scaling import energy_inputs

DAMPED = {"damping": {"*": 0.5, "t5_*": 2.0}}


@pytest.fixture(scope="module")
def prism():
    return solved(reference_prism(pins=["a", "b", "c"]))[2]


@pytest.fixture(scope="module")
def damped():
    return solved(shell_scene(pins=["P1_*_1"], tendons=DAMPED))[2]


def exact(linear, T):
    """W of an undamped pinned structure in closed form, 50 digits: x(t) = (sin, cos)(omega t) b for an impulse."""
    b, half = mp.matrix(energy_inputs(linear)[len(linear.modes) :]), len(linear.modes)
    omega = [mp.sqrt(mp.mpf(mode.omega2)) for mode in linear.modes]
    T, W = mp.mpf(T), mp.matrix(2 * half, 2 * half)

    def sine(w):
        return mp.sin(w * T) / w if w else T

    def versine(w):
        return (1 - mp.cos(w * T)) / w if w else mp.mpf(0)

    for j in range(half):
        for k in range(half):
            dot = mp.fsum(b[j, i] * b[k, i] for i in range(b.cols))
            plus, minus = omega[j] + omega[k], omega[j] - omega[k]
            W[j, k] = dot * (sine(minus) - sine(plus)) / 2
            W[j + half, k + half] = dot * (sine(minus) + sine(plus)) / 2
            W[j, k + half] = W[k + half, j] = dot * (versine(plus) + versine(minus)) / 2
    return W


@pytest.mark.parametrize("T", [1e-3, 1e-2, 0.3, 10.0, 1000.0])
def test_against_fifty_digits(prism, T):
    """State energies too, which at 1 ms spread over 20 decades: more than W itself could hold."""
    states = np.random.default_rng(1).standard_normal((3, 12))
    gramian = controllability_gramian(prism, T)
    with mp.workdps(50):
        W = exact(prism, T)
        own = np.array(W.tolist(), float)
        dear = [float((mp.matrix(x).T * mp.lu_solve(W, mp.matrix(x)))[0]) for x in states]
    assert np.abs(gramian.matrix - own).max() < 1e-12 * np.abs(own).max()
    conditioned = np.sqrt(gramian.spread) * np.finfo(float).eps
    assert gramian.state_energies(states) == pytest.approx(np.array(dear), rel=100 * conditioned + 1e-12)


def test_square_roots_keep_what_squares_lose(prism):
    """Within a millisecond the energies of states spread beyond 1/eps; the Cholesky factor of W does not exist."""
    gramian = controllability_gramian(prism, 1e-3)
    assert gramian.spread > 1e17
    assert np.linalg.eigvalsh(gramian.matrix)[0] < 1e-15 * np.linalg.eigvalsh(gramian.matrix)[-1]


@pytest.mark.parametrize("T", [0.01, 1.0, 30.0])
def test_damped_against_quadrature(damped, T):
    """Composite Gauss quadrature over steps of a tenth of a radian, each from its own matrix exponential."""
    gramian = controllability_gramian(damped, T)
    A, B = damped.A, energy_inputs(damped)
    pieces = int(np.ceil(T * np.linalg.norm(A, 2) / 4))
    x, w = np.polynomial.legendre.leggauss(16)
    edges = np.linspace(0, T, pieces + 1)
    W = np.zeros_like(A)
    inner = [sla.expm(A * (0.5 * (T / pieces) * (p + 1))) @ B for p in x]
    part = sum(0.5 * T / pieces * weight * (v @ v.T) for weight, v in zip(w, inner, strict=True))
    for start in edges[:-1]:
        F = sla.expm(A * start)
        W += F @ part @ F.T
    assert np.abs(gramian.matrix - W).max() < 1e-12 * np.abs(W).max()


def test_endless_against_a_lyapunov_solver(damped):
    gramian = controllability_gramian(damped, np.inf)
    B = energy_inputs(damped)
    wanted = sla.solve_continuous_lyapunov(damped.A, -B @ B.T)
    assert np.abs(gramian.matrix - wanted).max() < 1e-11 * np.abs(wanted).max()
    assert gramian.residual < 1e-13
    seen = observability_gramian(damped, np.inf)
    wanted = sla.solve_continuous_lyapunov(damped.A.T, -damped.C.T @ damped.C)
    assert np.abs(seen.matrix - wanted).max() < 1e-11 * np.abs(wanted).max()


@pytest.mark.parametrize("fixture", ["free", "mast"])
def test_observability_is_the_energy_of_outputs(request, fixture):
    """int |y|^2 dt from one state, by Gauss points; free structures in their flexible part."""
    linear = request.getfixturevalue(fixture)[2].flexible
    x0, T = np.random.default_rng(2).standard_normal(len(linear.A)), 0.7
    points, weights = np.polynomial.legendre.leggauss(80)
    y = [linear.C @ sla.expm(linear.A * (0.5 * T * (p + 1))) @ x0 for p in points]
    energy = 0.5 * T * sum(w * (v @ v) for w, v in zip(weights, y, strict=True))
    gramian = observability_gramian(linear, T)
    assert np.linalg.norm(gramian.factor.T @ x0) ** 2 == pytest.approx(energy, rel=1e-12)
    gramian.verify()


class TestEnergies:
    def test_the_promised_input_arrives(self, mast):
        """u = R^-1 B' e^(A'(T-t)) c/(c'Wc) ends at c'x = 1 and costs what was promised; other inputs cost more."""
        linear, T = mast[2], 1.3
        found = ReachEnergies.of(linear, T)
        c, promised = linear.C[linear.outputs.index("P4_1_1_z")], found.outputs[found.labels.index("P4_1_1_z")]
        A, B = linear.A, energy_inputs(linear)  # u^ = sqrt(R) u
        points, weights = np.polynomial.legendre.leggauss(120)
        kernel = np.array([c @ sla.expm(A * (0.5 * T * (1 - p))) @ B for p in points])
        w = 0.5 * T * weights[:, None]
        best = kernel * promised
        assert (w * kernel * best).sum() == pytest.approx(1, rel=1e-10)
        assert (w * best**2).sum() == pytest.approx(promised, rel=1e-10)
        other = best + np.random.default_rng(3).standard_normal(best.shape) * 0.1 * np.abs(best).max()
        other /= (w * kernel * other).sum()
        assert (w * other**2).sum() > 1.001 * promised

    def test_one_joule_in_a_mode(self, mast):
        """The cheapest phase of the mode, by scanning phases."""
        linear, T = mast[2], 0.4
        found = ReachEnergies.of(linear, T)
        angle = np.linspace(0, np.pi, 20001)
        for k in (0, 7, 20):
            rows = np.zeros((2, 42))
            rows[0, np.flatnonzero(linear.order == k)], rows[1, np.flatnonzero(linear.order == 21 + k)] = 1, 1
            phases = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ rows
            scanned = 2 * found.gramian.energies(phases).min()
            assert found.joules[k] == pytest.approx(scanned, rel=1e-6)

    def test_longer_is_cheaper(self, free):
        costs = [ReachEnergies.of(free[2], T) for T in (0.1, 0.2, 0.5, 1.0, 5.0)]
        for earlier, later in pairwise(costs):
            assert (later.outputs <= earlier.outputs * (1 + 1e-12)).all()
            assert (later.joules <= earlier.joules * (1 + 1e-12)).all()

    def test_tensions_are_left_out(self, mast):
        """They answer to their own rest length at once."""
        assert not any(label.startswith("T_") for label in ReachEnergies.of(mast[2], 1.0).labels)
        assert "one joule in a mode, J s: from mode" in str(ReachEnergies.of(mast[2], 1.0))


class TestExtremes:
    @pytest.mark.parametrize("scene", [
        prism_scene(pins=["a*"], tendons={"stiffness": {"*": 100.0, "side1": 1e9}}),
        prism_scene(pins=["a*"], rods={"mass": {"*": 1.0, "rod1": 1e8}}),
    ], ids=["stiffness", "mass"])  # fmt: skip
    def test_against_fifty_digits(self, scene):
        _, _, linear = solved(scene)
        gramian = controllability_gramian(linear, 2.0)
        with mp.workdps(50):
            own = np.array(exact(linear, 2.0).tolist(), float)
        scale = np.sqrt(np.outer(np.diag(own), np.diag(own)))
        assert (np.abs(gramian.matrix - own) / scale).max() < 1e-9


@pytest.mark.parametrize(
    ("horizon", "words"), [(0.0, "expected a time > 0"), (np.inf, "an infinite horizon needs damping in every mode")]
)
def test_refusals(mast, horizon, words):
    with pytest.raises(tc.LinearizationError, match=words):
        controllability_gramian(mast[2], horizon)
