"""The doubt about a gain is what changes of the data do to it, and a broken symmetry shows."""

import numpy as np
import pytest
import scipy.linalg as sla
from support import solved

import tensctl as tc
from tensctl.synthesis.gain_doubt import gain_doubt
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


def test_a_residual_counts(rng):
    """P off by 1e-5 of itself: the distance of its gain to the optimum, to first order."""
    A, B, cost = problem(rng, crossed=False)
    P, W, K = optimum(A, B, cost, sampled=False)
    off = P + 1e-5 * np.diag(np.diag(P))
    wrong = np.linalg.solve(W, B.T @ off)
    root = sla.sqrtm(W).real
    distance = np.linalg.norm(root @ (wrong - K)) / np.linalg.norm(root @ K)
    assert gain_doubt(A, B, cost, off, wrong, rounding=0.0).relative == pytest.approx(distance, rel=1e-2)


@pytest.mark.parametrize("dt", [None, 0.02])
def test_a_gain_that_is_determined(mast, dt):
    assert tc.lqr(mast[2], dt=dt).gain_doubt < 1e-9


def test_one_motor_and_a_symmetry_broken_by_little():
    """The less the symmetry is broken, the less the data say about the gain, whatever the residual."""

    def design(part):
        stiffness = {"*": 100.0, "top2": 100.0 * (1 + part)}
        structure = {"kind": "prism", "n": 3, "pins": ["a*"]}
        scene = tc.Scene(structure=structure, tendons={"stiffness": stiffness}, actuators={"tendons": ["side1"]})
        return tc.lqr(solved(scene)[2], stabilisable_only=True)

    assert design(0.1).gain_doubt < 1e-8
    assert design(1e-6).gain_doubt > 1e-5
