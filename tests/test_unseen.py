"""Undamped modes that weights, or a filter's noise, do not see are named; unseen modes that are damped do no harm."""

import re

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import given
from hypothesis import strategies as st
from support import shell_scene, solved

import tensctl as tc
from tensctl.synthesis import Cost
from tensctl.synthesis.unseen import unseen

PERIODS = pytest.mark.parametrize("dt", [None, 0.02], ids=["continuous", "sampled"])
HEIGHT = tc.Mix({"height": {f"P4_{i}_1_z": 1 / 3 for i in (1, 2, 3)}})
DAMPED = {"tendons": {"rest_ratio": 0.8, "damping": {"ratio": 0.02}}}


def told(fault):
    """Numbers of the modes that a refusal names, and how many it counts."""
    named = re.findall(r"(?:mode|harmonic) (\d+) at", str(fault.value))
    more = re.search(r"and (\d+) more", str(fault.value))
    return [int(k) for k in named], len(named) + (int(more[1]) if more else 0)


def only(Q, nu):
    return Cost(Q, np.eye(nu), np.zeros((len(Q), nu)))


@pytest.fixture(scope="module", params=["free", "pinned"])
def symmetric(request):
    """A symmetric (3,1) shell that shows its mean height: linear model, weight of the height, harmonics."""
    pins = {"pins": ["P1_*_1"]} if request.param == "pinned" else {}
    dynamics, rest, _ = solved(shell_scene(3, 1, **pins))
    linear = tc.linearize(dynamics, rest, outputs=[HEIGHT])
    height = linear.flexible.C
    return linear, 1e4 * height.T @ height, tc.harmonics(dynamics, rest)


@pytest.fixture(scope="module")
def damped():
    dynamics, rest, _ = solved(shell_scene(3, 1, pins=["P1_*_1"], **DAMPED))
    linear = tc.linearize(dynamics, rest, outputs=[HEIGHT])
    height = linear.flexible.C
    return linear, 1e4 * height.T @ height, tc.harmonics(dynamics, rest)


@given(seed=st.integers(0, 10**6), count=st.integers(1, 6), rank=st.integers(0, 4))
def test_directions_are_those_of_hautus(seed, count, rank):
    """Rank of [A - i w; Q] at frequencies that repeat, with weights that leave out some modes."""
    rng = np.random.default_rng(seed)
    omega = rng.choice([0.7, 3.0, 40.0], count)
    turn = sla.block_diag(*(np.array([[0, w], [-w, 0]]) for w in omega))
    basis = np.linalg.qr(rng.standard_normal((2 * count, 2 * count)))[0]
    rows = rng.standard_normal((rank, 2 * count)) * np.repeat(rng.integers(0, 2, count), 2)
    A, L = basis @ turn @ basis.T, rows @ basis.T
    found = list(unseen(A, only(L.T @ L, 1)))
    for w in np.unique(omega):
        missing = 2 * count - np.linalg.matrix_rank(np.vstack([A - 1j * w * np.eye(2 * count), L]), tol=1e-8)
        mine = [v for pole, v in found if abs(pole - 1j * w) < 1e-6]
        assert sum(v.shape[1] for v in mine) == missing
        for v in mine:
            assert np.abs(A @ v - 1j * w * v).max() < 1e-12 * 40
            assert np.abs(L @ v).max(initial=0.0) < 1e-6


@PERIODS
def test_height_does_not_see_what_is_no_motion_of_harmonic_zero(symmetric, dt):
    linear, Q, model = symmetric
    with pytest.raises(tc.SynthesisError, match="do not see") as fault:
        tc.lqr(linear, Q, dt=dt)
    others = sum(block.copies * block.omega2.size for block in model.blocks[1:])
    named, count = told(fault)
    assert count == others
    first = linear.flexible.modes[0].index
    shares = np.abs(linear.flexible.C[0]).reshape(2, -1).max(axis=0)
    assert shares[[k - first for k in named]].max() < 1e-9 * shares.max()


@PERIODS
def test_rank_one_sees_one_direction(symmetric, dt):
    linear, _, _ = symmetric
    nx = len(linear.flexible.A)
    with pytest.raises(tc.SynthesisError, match="weigh energy as well") as fault:
        tc.lqr(linear, np.diag([1.0] + [0.0] * (nx - 1)), dt=dt)
    assert told(fault)[1] == nx // 2 - 1


@PERIODS
def test_little_energy_is_enough(symmetric, dt):
    linear, Q, _ = symmetric
    design = tc.lqr(linear, Q + 1e-8 * np.linalg.norm(Q, 2) * np.eye(len(Q)), dt=dt)
    design.verify()


@PERIODS
def test_harmonics_that_no_weight_sees(symmetric, dt):
    _, _, model = symmetric
    blocks = model.blocks
    Q = [np.eye(block.nx) * (block.k != 1) for block in blocks]
    with pytest.raises(tc.SynthesisError, match="a mode of harmonic 1") as fault:
        tc.harmonic_lqr(model, Q, dt=dt)
    named, count = told(fault)
    assert count == 2 * blocks[1].omega2.size
    assert set(named) == {1}


@PERIODS
def test_damped_modes_need_not_be_seen(damped, dt):
    """The solution of SciPy, for the height's weight and for none but one state."""
    linear, Q, model = damped
    flexible = linear.flexible
    for weight in (Q, np.diag([1.0] + [0.0] * (len(Q) - 1)), 0 * Q):
        design = tc.lqr(linear, weight, dt=dt)
        design.verify()
        if dt is None and weight.any():
            wanted = sla.solve_continuous_are(flexible.A, flexible.B, weight, design.R)
            assert np.abs(design.P - wanted).max() <= 1e-9 * np.abs(wanted).max()
        assert weight.any() or not design.K[:, : len(Q)].any()
    found = tc.harmonic_lqr(model, [np.eye(b.nx) * (b.k == 0) for b in model.blocks], dt=dt)
    found.verify()
    assert not found.K[1][:, : model.blocks[1].nx].any()
    nothing = tc.harmonic_lqr(model, [np.zeros((b.nx, b.nx)) for b in model.blocks], dt=dt)
    assert nothing.residual == 0.0


@PERIODS
def test_noise_that_moves_nothing(symmetric, damped, dt):
    linear, _, model = symmetric
    eyes = tc.sensors(linear.dynamics.structure, lengths=1e-3)
    with pytest.raises(tc.SynthesisError, match="force_noise does not drive") as fault:
        tc.lqg(linear, eyes, force_noise=0.0, dt=dt)
    assert told(fault)[1] == len(linear.flexible.modes)
    with pytest.raises(tc.SynthesisError, match="force_noise does not drive a mode of harmonic 0") as fault:
        tc.harmonic_kalman(model, eyes, force_noise=0.0, dt=dt)
    assert told(fault)[1] == len(linear.flexible.modes)
    own = tc.sensors(damped[0].dynamics.structure, lengths=1e-3)
    assert not tc.lqg(damped[0], own, force_noise=0.0, dt=dt).filter.gain.any()
    assert tc.harmonic_kalman(damped[2], own, force_noise=0.0, dt=dt).residual == 0.0


def test_a_cross_weight_hides_modes_from_the_continuous_cost_alone(symmetric):
    """|R^1/2 (u + R^-1 N'x)|^2 costs nothing under u = -R^-1 N'x, which N = B S with skew S leaves undamped.

    Rest lengths that ramp cannot follow that oscillation, so the sampled cost sees every mode.
    """
    linear, _, _ = symmetric
    B = linear.flexible.B
    skew = np.random.default_rng(3).standard_normal((B.shape[1], B.shape[1]))
    R = 100.0 * np.eye(B.shape[1])
    N = B @ (skew - skew.T)
    cost = Cost(N @ np.linalg.solve(R, N.T), R, N)
    with pytest.raises(tc.SynthesisError, match="do not see") as fault:
        tc.lqr(linear, cost=cost)
    assert told(fault)[1] == len(linear.flexible.modes)
    tc.lqr(linear, cost=cost, dt=0.02).verify()
