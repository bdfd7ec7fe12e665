"""The Kalman filter by harmonics is the dense one: gain, covariance, poles, corrections; certificate and refusals."""

import numpy as np
import pytest
import scipy.linalg
from harmonic_support import DAMPED, dense_and_harmonic, relative
from support import replaced, shell_scene, solved

import tensctl as tc
from tensctl.errors import LinearizationError
from tensctl.synthesis.kalman import kalman, white_forces
from tensctl.synthesis.over_period import integral

CASES = {
    "free (3,1), lengths": ((3, 1), {}, {"lengths": 1e-3}),
    "free (4,2), lengths and tensions": ((4, 2), {}, {"lengths": {"*": 1e-3, "t5_*": 2e-3}, "tensions": 0.1}),
    "free (6,3), some lengths": ((6, 3), {}, {"lengths": {"t1_*": 1e-3, "t5_*": 2e-3, "t6_*": 1e-3}}),
    "pinned, damped, dragged (4,1), nodes": (
        (4, 1), {"pins": ["P1_*_1"], **DAMPED}, {"tensions": {"t5_*": 0.05}, "nodes": {"P4_*": 1e-3}},
    ),
    "free, damped, dragged (3,1), lengths": ((3, 1), DAMPED, {"lengths": 1e-3}),
}  # fmt: skip


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request):
    return dense_and_harmonic(*request.param)


@pytest.fixture(scope="module")
def small():
    """The free (4,1) shell with all lengths measured."""
    dynamics, rest, linear = solved(shell_scene(4, 1))
    model, eyes = tc.harmonics(dynamics, rest), tc.sensors(dynamics.structure, lengths=1e-3)
    return linear, model, eyes, tc.harmonic_kalman(model, eyes)


@pytest.mark.parametrize("dt", [None, 0.01])
def test_agrees_with_the_dense_filter(both, dt):
    linear, model, eyes = both
    flexible = linear.flexible
    A, (C, _), W, V = flexible.A, eyes.rows(flexible), white_forces(flexible, 0.3), np.diag(eyes.noise**2)
    if dt is None:
        wanted = kalman(A, C, W, V)
        loop = A - wanted.gain @ C
    else:
        F = scipy.linalg.expm(dt * A)
        wanted = kalman(F, C, integral(A.T, W, dt)[1], V, sampled=True)
        loop = F - F @ wanted.gain @ C
    found = tc.harmonic_kalman(model, eyes, force_noise=0.3, dt=dt)
    gain, X = found.dense(linear)
    assert relative(gain, wanted.gain) < 1e-11
    assert relative(X, wanted.X) < 1e-11
    poles, own = np.linalg.eigvals(loop), found.poles if dt is None else np.exp(dt * found.poles)
    assert np.abs(own[:, None] - poles).min(axis=1).max() < 1e-9 * np.abs(poles).max()
    assert found.outputs.labels == eyes.labels
    found.verify(1e-13)


def test_forces_are_those_of_the_whole_structure(both):
    linear, model, _ = both
    bases = model.changed_basis(linear)
    intensity = sum(
        b.copies * np.real(T.conj().T @ b.E @ b.E.conj().T @ T) for b, T in zip(model.blocks, bases, strict=True)
    )
    assert relative(intensity, white_forces(linear.flexible, 1.0)) < 1e-12


def test_is_the_filter_of_lqg(small):
    linear, _, eyes, found = small
    wanted = tc.lqg(linear, eyes).filter
    gain, X = found.dense(linear)
    assert relative(gain, wanted.gain) < 1e-12
    assert relative(X, wanted.X) < 1e-12
    assert found.residual < 1e-15


def test_corrections_are_the_gain_times_the_readings(small, rng):
    linear, model, eyes, found = small
    y, (gain, _) = rng.standard_normal((eyes.noise.size, 3)), found.dense(linear)
    parts = zip(model.blocks, model.changed_basis(linear), found.correction(y), strict=True)
    assert relative(sum(b.copies * np.real(T.conj().T @ x) for b, T, x in parts), gain @ y) < 1e-12


def test_residual_is_that_of_the_whole_structure(small):
    linear, _, eyes, found = small
    flexible = linear.flexible
    (C, _), W = eyes.rows(flexible), white_forces(flexible, 0.1)
    wrong = replaced(found, blocks=tuple(replaced(own, X=1.001 * own.X) for own in found.blocks))
    X = wrong.dense(linear)[1]
    terms = (flexible.A @ X, X @ flexible.A.T, -X @ C.T @ (C @ X) / 1e-6, W)
    left = np.linalg.norm(sum(terms)) / sum(np.linalg.norm(term) for term in terms)
    assert wrong.residual == pytest.approx(left, rel=1e-9)
    with pytest.raises(tc.SynthesisError, match=f"filter's Riccati residual is {left:.1e}"):
        wrong.verify()


@pytest.mark.parametrize("dt", [None, 0.01])
def test_verify_tells_an_unstable_gain(small, dt):
    _, model, eyes, _ = small
    found = tc.harmonic_kalman(model, eyes, dt=dt)
    first, second, third = found.blocks
    wrong = replaced(found, blocks=(first, replaced(second, gain=-9 * second.gain), third))
    with pytest.raises(tc.SynthesisError, match="a pole of the filter of harmonic 1 is not stable"):
        wrong.verify()


def test_a_shell_of_628_states():
    """(8,4): certified by its residual and by Lyapunov's inequality in every harmonic."""
    scene = shell_scene(8, 4)
    dynamics = tc.build_dynamics(scene)
    model = tc.harmonics(dynamics, tc.find_equilibrium(scene))
    found = tc.harmonic_kalman(model, tc.sensors(dynamics.structure, lengths=1e-3))
    assert found.residual < 1e-14
    found.verify(1e-14)


class TestRefusals:
    def test_images(self, small):
        structure, model = small[0].dynamics.structure, small[1]
        with pytest.raises(LinearizationError, match="leave out images"):
            tc.harmonic_kalman(model, tc.sensors(structure, lengths={"t5_1_1": 1e-3}))
        with pytest.raises(
            tc.SynthesisError, match=r"noises of sensors are not the same in all sectors; .* or use tc\.lqg"
        ):
            tc.harmonic_kalman(model, tc.sensors(structure, lengths={"*": 1e-3, "t5_1_1": 2e-3}))
        with pytest.raises(tc.SynthesisError, match="noises of forces are not the same in all sectors"):
            tc.harmonic_kalman(model, small[2], force_noise={"*": 0.1, "P4_1_1": 0.2})

    def test_a_mode_that_is_not_seen(self, small):
        structure, model = small[0].dynamics.structure, small[1]
        with pytest.raises(tc.SynthesisError, match=r"^harmonic 2: a mode at \d.* Hz, one of 5, is neither damped nor"):
            tc.harmonic_kalman(model, tc.sensors(structure, lengths={"t4_*": 1e-3}))

    def test_what_does_not_fit(self, small):
        _, model, eyes, _ = small
        with pytest.raises(tc.SynthesisError, match="dt is 0; expected a finite number > 0"):
            tc.harmonic_kalman(model, eyes, dt=0)
        with pytest.raises(tc.SynthesisError, match="sensors belong to another structure"):
            tc.harmonic_kalman(model, tc.sensors(tc.shell(3, 1), lengths=1e-3))
        with pytest.raises(tc.SynthesisError, match=r"force_noise is -1.0; expected a finite number >= 0"):
            tc.harmonic_kalman(model, eyes, force_noise=-1.0)
