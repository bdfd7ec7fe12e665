"""The doubt about a gain is what changes of the data do to it, and a broken symmetry shows."""

import numpy as np
import pytest
import scipy.linalg as sla
from support import shell_scene, solved

import tensctl as tc
from tensctl.synthesis.gain_doubt import gain_doubt
from tensctl.synthesis.kalman import kalman
from tensctl.synthesis.weights import Cost

ROUNDING = 1e-8


def problem(rng, crossed):
    n, m = 8, 2
    root = rng.standard_normal((n + m, n + m))
    joint = root @ root.T + 0.1 * np.eye(n + m)
    N = joint[:n, n:] if crossed else np.zeros((n, m))
    return rng.standard_normal((n, n)) / 2, rng.standard_normal((n, m)), Cost(joint[:n, :n], joint[n:, n:], N)


def optimum(A, B, cost, sampled):
    """P, W and K by SciPy's pencils."""
    solve = sla.solve_discrete_are if sampled else sla.solve_continuous_are
    P = solve(A, B, cost.Q, cost.R, s=cost.N)
    W = cost.R + B.T @ P @ B if sampled else cost.R
    return P, W, np.linalg.solve(W, B.T @ P @ (A if sampled else np.eye(len(A))) + cost.N.T)


@pytest.mark.parametrize("sampled", [False, True])
@pytest.mark.parametrize("crossed", [False, True])
def test_changes_of_the_data(sampled, crossed, rng):
    """The worst of 40 changes of every entry by 1e-8, solved anew, is within a factor of 3 of the estimate."""
    A, B, cost = problem(rng, crossed)
    P, W, K = optimum(A, B, cost, sampled)
    root = sla.sqrtm(W).real
    doubt = gain_doubt(A, B, cost, P, K, sampled=sampled, rounding=ROUNDING).relative

    def moved(M):
        change = rng.choice([-1, 1], M.shape) * ROUNDING
        return M * (1 + (np.tril(change) + np.tril(change, -1).T if len(M) == len(M.T) else change))

    changes = []
    for _ in range(40):
        other = Cost(moved(cost.Q), moved(cost.R), moved(cost.N))
        changed = optimum(moved(A), moved(B), other, sampled)[2]
        changes.append(np.linalg.norm(root @ (changed - K)) / np.linalg.norm(root @ K))
    assert doubt / 3 < max(changes) < 3 * doubt


@pytest.mark.parametrize("sampled", [False, True])
def test_changes_of_a_filters_data(sampled, rng):
    """Likewise of a filter, whose sampled gain X C'(C X C' + V)^-1 corrects at once."""
    A, B, cost = problem(rng, crossed=False)

    def filtered(A, C, W, V):
        X, S, _ = optimum(A.T, C.T, Cost(W, V, np.zeros(C.T.shape)), sampled)
        return X, S, np.linalg.solve(S, C @ X).T

    X, S, M = filtered(A, B.T, cost.Q, cost.R)
    root, predictor = sla.sqrtm(S).real, A @ M if sampled else M
    given = {"sampled": sampled, "current": sampled, "rounding": ROUNDING}
    doubt = gain_doubt(A.T, B, cost, X, predictor.T, **given).relative

    def moved(M):
        change = rng.choice([-1, 1], M.shape) * ROUNDING
        return M * (1 + (np.tril(change) + np.tril(change, -1).T if len(M) == len(M.T) else change))

    changes = []
    for _ in range(40):
        changed = filtered(moved(A), moved(B.T), moved(cost.Q), moved(cost.R))[2]
        changes.append(np.linalg.norm((changed - M) @ root) / np.linalg.norm(M @ root))
    assert doubt / 3 < max(changes) < 3 * doubt
    ours = kalman(A, B.T, cost.Q, cost.R, sampled=sampled)
    assert ours.gain_doubt == pytest.approx(doubt * np.finfo(float).eps / ROUNDING, rel=2)


def test_a_state_that_no_noise_reaches():
    """Its error vanishes; that of the other is known all the same."""
    found = kalman(np.diag([-1.0, -2.0]), np.ones((1, 2)), np.diag([1.0, 0.0]), np.eye(1))
    assert found.gain_doubt < 1e-14


@pytest.mark.parametrize(("sampled", "current"), [(False, False), (True, False), (True, True)])
def test_a_residual_counts(sampled, current, rng):
    """P off by 1e-5 of itself: the distance of its gain to the optimum, to first order."""
    A, B, cost = problem(rng, crossed=False)
    P, W, _ = optimum(A, B, cost, sampled)
    off = P + 1e-5 * np.diag(np.diag(P))

    def gains(P):
        W = cost.R + B.T @ P @ B if sampled else cost.R
        M = np.linalg.solve(W, B.T @ P)
        return M @ A if sampled else M, M

    root = sla.sqrtm(W).real
    wrong, right = (gains(one)[current] for one in (off, P))
    distance = np.linalg.norm(root @ (wrong - right)) / np.linalg.norm(root @ right)
    given = {"sampled": sampled, "current": current, "rounding": 0.0}
    assert gain_doubt(A, B, cost, off, gains(off)[0], **given).relative == pytest.approx(distance, rel=1e-2)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_gain_that_is_determined(mast, dt):
    assert tc.lqr(mast[2], dt=dt).gain_doubt < 1e-9


@pytest.mark.parametrize("dt", [None, 0.02])
def test_lqg_of_gains_that_are_determined(mast, dt):
    design = tc.lqg(mast[2], tc.sensors(mast[0].structure, lengths=1e-3), dt=dt)
    assert design.regulator_doubt == pytest.approx(tc.lqr(mast[2], dt=dt).gain_doubt, rel=1)
    assert 0 < design.gain_doubt == max(design.regulator_doubt, design.filter.gain_doubt) < 1e-9


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_filter_by_harmonics_is_as_sure_as_the_dense_one(dt):
    dynamics, rest, linear = solved(shell_scene(4, 1))
    eyes = tc.sensors(dynamics.structure, lengths=1e-3)
    found = tc.harmonic_lqg(tc.harmonics(dynamics, rest), eyes, dt=dt)
    dense = tc.lqg(linear, eyes, dt=dt).filter.gain_doubt
    assert dense / 5 < found.filter.gain_doubt < 5 * dense
    assert found.gain_doubt == max(found.regulator.gain_doubt, found.filter.gain_doubt)


def broken_prism(part):
    """The pinned prism with one motor and a symmetry that a stiffness breaks."""
    stiffness = {"*": 100.0, "top2": 100.0 * (1 + part)}
    structure = {"kind": "prism", "n": 3, "pins": ["a*"]}
    return solved(tc.Scene(structure=structure, tendons={"stiffness": stiffness}, actuators={"tendons": ["side1"]}))


def test_one_sensor_and_a_symmetry_broken_by_little():
    """What one motor hardly drives, the length of its tendon hardly shows: the filter's gain is open as well."""

    def design(part):
        dynamics, _, linear = broken_prism(part)
        return tc.lqg(linear, tc.sensors(dynamics.structure, lengths={"side1": 1e-3}), stabilisable_only=True)

    assert design(0.1).gain_doubt < 1e-8
    open_ = design(1e-6)
    assert open_.regulator_doubt > 1e-5
    assert open_.filter.gain_doubt > 1e-6


def test_one_motor_and_a_symmetry_broken_by_little():
    """The less the symmetry is broken, the less the data say about the gain, whatever the residual."""

    def design(part):
        return tc.lqr(broken_prism(part)[2], stabilisable_only=True)

    assert design(0.1).gain_doubt < 1e-8
    assert design(1e-6).gain_doubt > 1e-5
