"""What white forces cost an LQR: its loop's Lyapunov equation, less than any other gain's, the same by harmonics."""

import numpy as np
import pytest
import scipy.linalg as sla
from harmonic_support import DAMPED, dense_and_harmonic
from support import shell_scene, solved

import tensctl as tc
from tensctl.synthesis.kalman import white_forces

NOISE = {"P4_*": 0.3, "P3_*": 0.1}


def covariance_cost(design, K, force_noise):
    """Cost of the closed loop under a gain K, from the covariance of its states."""
    linear, T = design.linear, design.basis
    W, nx = white_forces(linear, force_noise), len(linear.A)
    if isinstance(design, tc.LQR):
        loop, rows = T.T @ (linear.A - linear.B @ K) @ T, np.vstack([np.eye(nx), -K]) @ T
        X = sla.solve_continuous_lyapunov(loop, -T.T @ W @ T)
        weight = np.block([[design.Q, design.N], [design.N.T, design.R]])
        return np.trace(weight @ rows @ X @ rows.T)
    A, B = design.sampled.with_input_state()
    steps = np.linspace(0, design.dt, 201)
    spread = np.array([sla.expm(t * linear.A) @ W @ sla.expm(t * linear.A).T for t in steps])
    left = np.zeros((len(A), len(A)))
    left[:nx, :nx] = sla.block_diag(np.einsum("t,tij->ij", simpson(steps), spread))
    X = sla.solve_discrete_lyapunov(T.T @ (A - B @ K) @ T, T.T @ left @ T)
    rows = np.vstack([np.eye(len(A)), -K]) @ T
    return np.trace(design.period_cost.matrix @ rows @ X @ rows.T)


def simpson(t):
    weights = np.where(np.arange(t.size) % 2, 4.0, 2.0)
    weights[[0, -1]] = 1.0
    return weights * (t[1] - t[0]) / 3


@pytest.fixture(scope="module", params=[None, 0.02], ids=["continuous", "sampled"])
def design(request, mast):
    linear = mast[2]
    cost = tc.weights(linear, energy=1.0, tensions=2.0, rest_lengths=0.05)
    return tc.lqr(linear, cost=cost, dt=request.param)


@pytest.mark.parametrize("force_noise", [0.1, NOISE])
def test_is_that_of_the_covariance(design, force_noise):
    assert design.expected_cost(force_noise) == pytest.approx(covariance_cost(design, design.K, force_noise), rel=1e-9)


def test_grows_with_the_square_of_the_noise(design):
    assert design.expected_cost(0.2) == pytest.approx(4 * design.expected_cost(0.1), rel=1e-12)
    assert design.expected_cost(0.0) == 0.0
    with pytest.raises(tc.SynthesisError, match="expected a finite number >= 0"):
        design.expected_cost(-1.0)


def test_any_other_gain_costs_more_by_the_square_of_the_change(design, rng):
    change, best = np.abs(design.K).max() * rng.standard_normal(design.K.shape), design.expected_cost()
    steps = np.array([4e-3, 2e-3, 1e-3])
    more = [covariance_cost(design, design.K + h * change, 0.1) - best for h in steps]
    assert np.polyfit(np.log(steps), np.log(more), 1)[0] == pytest.approx(2, abs=0.1)


def test_an_estimate_costs_what_its_error_costs(mast):
    """LQG's expected cost less LQR's is tr(X K'RK), X the covariance of the estimate's error."""
    eyes = tc.sensors(mast[0].structure, lengths=1e-3)
    both, alone = tc.lqg(mast[2], eyes, force_noise=NOISE), tc.lqr(mast[2])
    error = np.trace(both.filter.X @ alone.K.T @ alone.R @ alone.K)
    assert both.expected_cost - alone.expected_cost(NOISE) == pytest.approx(error, rel=1e-8)
    assert error > 1e-3 * alone.expected_cost(NOISE)


@pytest.mark.parametrize("dt", [None, 0.02])
@pytest.mark.parametrize("given", [{}, {"pins": ["P1_*_1"], **DAMPED}], ids=["free", "pinned, damped"])
def test_by_harmonics(given, dt):
    linear, model, _ = dense_and_harmonic((4, 1), given, {"lengths": 1e-3})
    noise = {"P1_*": 0.2, "P2_*": 0.3, "P4_*": 0.1}
    found, wanted = tc.harmonic_lqr(model, dt=dt), tc.lqr(linear, dt=dt)
    assert found.expected_cost(noise) == pytest.approx(wanted.expected_cost(noise), rel=1e-10)
    with pytest.raises(tc.SynthesisError, match="noises of forces are not the same"):
        found.expected_cost({"P4_1_1": 0.1})


@pytest.mark.parametrize("dt", [None, 0.02])
def test_of_what_was_designed_when_modes_were_left_out(dt):
    _, _, linear = solved(shell_scene(actuators={"tendons": ["t5_1_1"]}))
    design = tc.lqr(linear, dt=dt, stabilisable_only=True)
    assert len(design.left) == 8
    wanted = covariance_cost(design, design.K, 0.1)
    assert design.expected_cost() == pytest.approx(wanted, rel=1e-8)
