"""The dual active set in rates: optima known from elsewhere, and no answer where there is none."""

import daqp
import numpy as np
import pytest
from rates_support import INPUTS, STAGES, N, posed, stated

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import dual
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_dual import DualSolver


def hard(seed, below, crowded=False):
    """A random problem whose floors are so far below, without slacks: Hessian, slopes, rows and all bounds."""
    form, step = posed(np.random.default_rng(seed), crowded)
    H, f, A, lower, upper = stated(form, step)
    lower[N + STAGES : N + STAGES + step.floor.size] -= below
    kept = np.r_[:N, N + STAGES : lower.size]
    return H[:N, :N].copy(), f[:N], A[:, :N].copy(), lower[kept], upper[kept]


def searched(H, f, A, lower, upper, room=4 * N):
    """How it ended, answer and forces: rates and tensions are known, inputs are summed up."""
    known = np.vstack([np.eye(N), A[:-N]])
    values = known @ np.linalg.solve(H, -f)
    moves = known @ np.linalg.solve(H, known.T)
    ended, forces = dual.search(moves, values, lower, upper, INPUTS, room, 1e-12, -np.inf, np.inf)
    return ended, values[:N], forces


class TestSearch:
    @pytest.mark.parametrize("crowded", [False, True], ids=["general", "rows twice"])
    @pytest.mark.parametrize("seed", range(20))
    def test_optimum_of_another_active_set(self, seed, crowded):
        H, f, A, lower, upper = hard(seed, 2.5, crowded)
        other, _, flag, _ = daqp.solve(H, f, A, upper, lower, np.zeros(lower.size, np.int32), primal_tol=1e-13)
        ended, w, forces = searched(H, f, A, lower, upper)
        assert (ended == dual.SOLVED) == (flag > 0)
        if flag <= 0:
            return
        assert np.abs(w - other).max() < 1e-10
        # Optimality by its definition, from the problem's own data.
        all_rows = np.vstack([np.eye(N), A])
        values = all_rows @ w
        assert np.abs(H @ w + f - all_rows.T @ forces).max() < 1e-9 * np.abs(f).max()
        assert (values >= lower - 1e-11).all()
        assert (values <= upper + 1e-11).all()
        assert np.abs((values - lower)[forces > 0]).max(initial=0.0) < 1e-11
        assert np.abs((upper - values)[forces < 0]).max(initial=0.0) < 1e-11

    def test_most_of_them_have_an_answer_on_inputs_too(self):
        """The comparison would prove little otherwise: limits of every kind act."""
        ends = [searched(*hard(seed, 2.5)) for seed in range(20)]
        solved = np.array([forces for ended, _, forces in ends if ended == dual.SOLVED])
        assert len(solved) > 10
        rates, tensions, inputs = solved[:, :N], solved[:, N:-N], solved[:, -N:]
        assert all((kind != 0).any() for kind in (rates, tensions, inputs))
        assert (rates > 0).any()
        assert (rates < 0).any()

    def test_no_answer_where_floors_contradict_limits(self):
        for seed in range(10):
            assert searched(*hard(seed, -5.0))[0] != dual.SOLVED

    def test_room_is_kept(self):
        problem = hard(0, 2.5)
        acting = np.count_nonzero(searched(*problem)[2])
        assert acting > 2
        assert searched(*problem, room=acting - 1)[0] == dual.BUSY


@pytest.fixture(scope="module")
def asked(mast):
    """The problem of a step within whose floors some eighty limits act."""
    _, rest, linear = mast
    rng, manifold = np.random.default_rng(1), rest.potential.manifold
    nodes = manifold.retract(rest.nodes, 0.005 * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (0.3 * rng.standard_normal(manifold.size))).reshape(-1, 3)
    mpc = tc.MPC(linear, horizon=10, tension_min=2.0)
    return mpc.statement(0.0, Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs))


class TestController:
    def test_is_exact(self, asked):
        problem, _, qp = asked
        found, other = DualSolver(problem).solve(qp), DaqpSolver(qp, tol=1e-13).solve(qp)
        assert np.count_nonzero(found.y) == np.count_nonzero(other.y) > 50
        assert found.kkt < 1e-12
        assert np.abs(found.z - other.z).max() < 1e-12

    def test_room_beyond_all_variables_is_room_for_all(self, asked):
        """No more limits can act than there are variables: room for 1e9 takes no more memory."""
        problem, _, qp = asked
        n = qp.f.size
        every, beyond = (DualSolver(problem, room=room).solve(qp) for room in (n, 10**9))
        assert beyond.status == every.status == "solved"
        assert (beyond.z == every.z).all()

    def test_hands_over_where_many_limits_are_broken(self, asked):
        problem, _, qp = asked
        assert DualSolver(problem, room=5).solve(qp).status == "failed"
