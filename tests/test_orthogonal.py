"""The dual active set on orthogonal factors: optima by their definition, from any limits that act, however alike."""

import daqp
import numpy as np
import pytest
from rates_support import INPUTS, N
from test_dual import hard, searched

from tensctl.synthesis import dual, orthogonal


def begun(problem, forces, work=np.inf, tol=1e-12):
    """How it ended from limits that these forces act on; answer and forces."""
    H, f, A, lower, upper = problem
    known = np.vstack([np.eye(N), A[:-N]])
    half = np.linalg.cholesky(H)
    rows = np.ascontiguousarray(np.linalg.solve(half, known.T).T)
    found = forces.copy()
    limits = orthogonal.Limits(lower, upper, INPUTS)
    ended, values = orthogonal.search(rows, known @ np.linalg.solve(H, -f), limits, found, tol, work)
    return ended, values[:N], found


def assert_optimal(problem, w, forces, tol):
    """Slopes balance forces, all limits are kept, and those that push are just kept."""
    H, f, A, lower, upper = problem
    all_rows = np.vstack([np.eye(N), A])
    values = all_rows @ w
    assert np.abs(H @ w + f - all_rows.T @ forces).max() < tol * np.abs(f).max()
    assert (values >= lower - tol).all()
    assert (values <= upper + tol).all()
    assert np.abs((values - lower)[forces > 0]).max(initial=0.0) < tol
    assert np.abs((upper - values)[forces < 0]).max(initial=0.0) < tol


@pytest.mark.parametrize("crowded", [False, True], ids=["general", "rows twice"])
@pytest.mark.parametrize("seed", range(20))
def test_optimum_of_another_active_set(seed, crowded):
    """From nothing, from the answer's own limits, and from any that are guessed, some of them dependent."""
    problem = hard(seed, 2.5, crowded)
    H, f, A, lower, upper = problem
    other, _, flag, _ = daqp.solve(H, f, A, upper, lower, np.zeros(lower.size, np.int32), primal_tol=1e-13)
    rng = np.random.default_rng(seed)
    guessed = rng.choice([-1.0, 0.0, 1.0], lower.size, p=[0.2, 0.6, 0.2])
    of_answer = searched(*problem)[2]
    for forces in (np.zeros(lower.size), of_answer, guessed):
        ended, w, found = begun(problem, forces)
        assert (ended == orthogonal.SOLVED) == (flag > 0)
        if flag > 0:
            assert np.abs(w - other).max() < 1e-10
            assert_optimal(problem, w, found, 1e-11)


def test_bounded_work():
    """It gives up before its first step, and a search that had given up is right when it may go on."""
    problem = hard(0, 2.5)
    nothing = np.zeros(problem[3].size)
    assert begun(problem, nothing, work=0.0)[0] == orthogonal.BUSY
    assert begun(problem, nothing)[0] == orthogonal.SOLVED


def unlimited():
    """A problem at its minimum w = 0, with unit Hessian, rows of nothing and no limits; those of inputs are sums."""
    _, _, A, lower, upper = hard(0, 0.0)
    rows = np.zeros_like(A)
    rows[-N:] = A[-N:]
    return np.eye(N), np.zeros(N), rows, np.full(lower.size, -np.inf), np.full(upper.size, np.inf)


@pytest.mark.parametrize("apart", [1e-3, 1e-5, 1e-7])
def test_two_limits_that_say_nearly_the_same(apart):
    """w_0 >= a and w_0 + apart w_1 <= a - b: forces of the size b / apart^2 are known to eps / apart of themselves."""
    H, f, A, lower, upper = unlimited()
    a, b = 0.75, 0.5 * apart
    A[0, 0], A[1, 0], A[1, 1] = 1.0, 1.0, apart
    lower[N], upper[N + 1] = a, a - b
    ended, w, forces = begun((H, f, A, lower, upper), np.zeros(lower.size))
    assert ended == orthogonal.SOLVED
    along = b / apart
    assert w[:2] == pytest.approx([a, -along], rel=1e-15 / apart)
    assert forces[N : N + 2] == pytest.approx([a + along / apart, -along / apart], rel=4e-16 / apart)


@pytest.mark.parametrize("apart", [1e-3, 1e-5, 1e-7])
def test_one_of_them_leaves(apart):
    """w_0 >= a and w_0 + apart w_1 >= a + b, where the first would have to pull if both were just kept."""
    H, f, A, lower, upper = unlimited()
    a, b = 0.75, 0.5 * apart
    A[0, 0], A[1, 0], A[1, 1] = 1.0, 1.0, apart
    lower[N], lower[N + 1] = a, a + b
    both = np.zeros(lower.size)
    both[N : N + 2] = 1.0
    for forces in (np.zeros(lower.size), both):
        ended, w, found = begun((H, f, A, lower, upper), forces)
        assert ended == orthogonal.SOLVED
        kept = (a + b) / (1 + apart**2)
        assert np.abs(w[:2] - [kept, kept * apart]).max() < 1e-15
        assert np.flatnonzero(found).tolist() == [N + 1]


def test_products_have_lost_them():
    """The same by products says that it is in doubt, or ends further away."""
    apart = 1e-7
    row = np.array([[1.0, 0.0], [1.0, apart]])
    moves = np.vstack([np.eye(2), row]) @ np.vstack([np.eye(2), row]).T
    lower = np.array([-np.inf, -np.inf, 0.75, -np.inf, -np.inf, -np.inf])
    upper = np.array([np.inf, np.inf, np.inf, 0.75 - 0.5 * apart, np.inf, np.inf])
    ended, _ = dual.search(moves, np.zeros(4), lower, upper, 2, 4, 1e-12, dual.FEW_DIGITS, np.inf)
    assert ended in (dual.DOUBTFUL, dual.INFEASIBLE)


@pytest.mark.parametrize("by", [0.0, 1e-9, 1e-3, 1.0])
def test_floors_that_contradict_each_other(by):
    """No plan keeps w_0 >= a and w_0 <= a - by, unless by nothing; others that act do not hide it."""
    H, f, A, lower, upper = hard(3, 5.0)
    A[:2] = 0.0
    A[:2, 0] = 1.0
    lower[N], lower[N + 1], upper[N + 1] = 0.1, -np.inf, 0.1 - by
    ended, w, _ = begun((H, f, A, lower, upper), np.zeros(lower.size))
    assert ended == (orthogonal.INFEASIBLE if by else orthogonal.SOLVED)
    assert by or w[0] == pytest.approx(0.1, abs=1e-12)
