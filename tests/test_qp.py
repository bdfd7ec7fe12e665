"""Both solvers find optima that were known before, and the judge of answers tells right from wrong."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import replaced

from tensctl.synthesis.polish import polish
from tensctl.synthesis.qp import QP, judged
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_osqp import OsqpSolver
from tensctl.synthesis.relaxed import relax

SOLVERS = [DaqpSolver, OsqpSolver]
seeds = st.integers(0, 10**6)


def known(seed, n=8, rows=12, H=None, A=None):
    """A problem made around its own optimum (z, y): f from stationarity, bounds from which multipliers act."""
    rng = np.random.default_rng(seed)
    if H is None:
        root, A = rng.standard_normal((n, n)), rng.standard_normal((rows, n))
        H = root @ root.T + np.eye(n)
    z, y = rng.standard_normal(n), np.zeros(n + rows)
    values = np.concatenate([z, A @ z])
    acting = rng.permutation(n + rows)[: n // 2]
    y[acting] = rng.uniform(0.1, 2, acting.size) * rng.choice([-1, 1], acting.size)
    gap = rng.uniform(0.1, 2, (2, n + rows))
    lower, upper = values - np.where(y < 0, 0, gap[0]), values + np.where(y > 0, 0, gap[1])
    one_sided = rng.random(n + rows) < 0.3
    lower[one_sided & (y >= 0)] = -np.inf
    return QP(H, -(H @ z + y[:n] + A.T @ y[n:]), A, lower, upper), z, y


@pytest.mark.parametrize("solver", SOLVERS)
class TestSolvers:
    @given(seed=seeds)
    def test_find_the_known_optimum(self, solver, seed):
        qp, z, _ = known(seed)
        found = solver(qp).solve(qp)
        assert found.status == "solved"
        assert np.abs(found.z - z).max() < 1e-6
        assert found.kkt < 1e-7
        assert qp.objective(found.z) == pytest.approx(qp.objective(z), rel=1e-7, abs=1e-7)

    def test_keep_their_workspace(self, solver):
        """One set-up, many problems of the same H and A, infeasible ones between: answers as from a fresh start."""
        first, *_ = known(0)
        kept = solver(first)
        for seed in range(1, 12):
            qp, z, _ = known(seed, H=first.H, A=first.A)
            assert np.abs(kept.solve(qp).z - z).max() < 1e-6
            if seed % 4 == 0:
                assert kept.solve(contradictory(qp)).status == "infeasible"

    def test_say_infeasible(self, solver):
        qp = contradictory(known(3)[0])
        found = solver(qp).solve(qp)
        assert (found.status, found.z, found.kkt) == ("infeasible", None, np.inf)


def contradictory(qp):
    """Row 0 has to exceed what its variables' bounds allow."""
    n = qp.f.size
    lower, upper = qp.lower.copy(), qp.upper.copy()
    lower[:n], upper[:n] = -1.0, 1.0
    lower[n] = np.abs(qp.A[0]).sum() + 1.0
    upper[n] = lower[n] + 1.0
    return replaced(qp, lower=lower, upper=upper)


@given(seed=seeds)
def test_without_acting_limits_the_minimum_is_the_answer(seed):
    """The short way ends where DAQP would: at H z = -f, exactly where that is inside, by its own steps where not."""
    qp, z, _ = known(seed)
    free = np.linalg.solve(qp.H, -qp.f)
    width = 1e-6 + np.abs(qp.values(free))
    wide = replaced(qp, lower=qp.values(free) - width, upper=qp.values(free) + width)
    solver = DaqpSolver(qp)
    found = solver.solve(wide)
    assert not found.y.any()
    assert np.abs(found.z - free).max() < 1e-12 * np.abs(free).max()
    assert np.abs(solver.solve(qp).z - z).max() < 1e-9 * np.abs(z).max()


class TestJudge:
    @given(seed=seeds)
    def test_optimum_has_no_residual(self, seed):
        qp, z, y = known(seed)
        assert qp.kkt_residual(z, y) < 1e-14
        assert qp.violation(z) < 1e-15 * 10

    @given(seed=seeds, size=st.sampled_from([1e-2, 1e-4, 1e-6]))
    def test_a_wrong_answer_shows(self, seed, size):
        """Perturbed variables or multipliers leave a residual of about their size."""
        qp, z, y = known(seed)
        rng = np.random.default_rng(seed)
        dz, dy = rng.standard_normal(z.size), rng.standard_normal(y.size)
        assert qp.kkt_residual(z + size * dz, y) > 1e-3 * size
        assert qp.kkt_residual(z, y + size * dy) > 1e-3 * size

    @given(seed=seeds)
    def test_a_multiplier_of_the_wrong_sign_shows(self, seed):
        """Stationary and feasible, yet no optimum: a bound pulls instead of pushing."""
        qp, z, y = known(seed)
        n = z.size
        acting = np.flatnonzero(y)
        wrong = y.copy()
        wrong[acting[0]] = -y[acting[0]]
        f = -(qp.H @ z + wrong[:n] + qp.A.T @ wrong[n:])
        assert replaced(qp, f=f).kkt_residual(z, wrong) > 1e-5

    @given(seed=seeds)
    def test_a_multiplier_on_an_idle_bound_shows(self, seed):
        qp, z, y = known(seed)
        n = z.size
        idle = int(np.flatnonzero((y == 0) & np.isfinite(qp.lower))[0])
        wrong = y.copy()
        wrong[idle] = 0.5
        f = -(qp.H @ z + wrong[:n] + qp.A.T @ wrong[n:])
        assert replaced(qp, f=f).kkt_residual(z, wrong) > 1e-5

    def test_a_broken_bound_shows(self):
        qp, z, y = known(1)
        tight = replaced(qp, upper=qp.upper - 1e-3 * (y > 0))
        assert tight.violation(z) == pytest.approx(1e-3)
        assert tight.kkt_residual(z, y) > 1e-5

    def test_units_do_not_matter(self):
        """The residual of a wrong answer is the same in other units of cost and of variables."""
        qp, z, y = known(2)
        dz = 1e-4 * np.ones_like(z)
        cost, size = 1e6, 1e-3
        other = QP(qp.H * cost / size**2, qp.f * cost / size, qp.A, qp.lower * size, qp.upper * size)
        here, there = qp.kkt_residual(z + dz, y), other.kkt_residual(size * (z + dz), y * cost / size)
        assert here == pytest.approx(there, rel=1e-9)


class TestRelaxed:
    """One slack a stage on the tension rows, which come before as many rate rows as variables."""

    def staged(self, floor):
        """Two stages of two inputs: the sum and the difference of each stage above a floor, inputs within +-1."""
        rows = np.kron(np.eye(2), [[1.0, 1.0], [1.0, -1.0]])
        A = np.vstack([rows, np.eye(4)])
        lower = np.concatenate([-np.ones(4), floor, -np.full(4, 1.5)])
        upper = np.concatenate([np.ones(4), np.full(4, np.inf), np.full(4, 1.5)])
        return QP(np.eye(4), np.zeros(4), A, lower, upper)

    @pytest.mark.parametrize("solver", SOLVERS)
    def test_keeps_what_can_be_kept(self, solver):
        """Stage 1 misses its floor of 2.5 by 0.5, as little as possible; stage 2 keeps its own."""
        soft = relax(self.staged(np.array([2.5, -9.0, 1.0, 0.5])), 2)
        found = solver(soft).solve(soft)
        z, slack = found.z[:4], found.z[4:]
        assert slack == pytest.approx([0.5, 0.0], abs=1e-6)
        assert z == pytest.approx([1.0, 1.0, 0.75, 0.25], abs=1e-6)

    def test_feasible_problem_is_left_as_it_is(self):
        hard = self.staged(np.array([1.0, 0.0, 1.0, 0.5]))
        soft = relax(hard, 2)
        one, other = DaqpSolver(hard).solve(hard), DaqpSolver(soft).solve(soft)
        assert other.z[4:] == pytest.approx([0, 0], abs=1e-12)
        assert other.z[:4] == pytest.approx(one.z, abs=1e-9)


class TestPolish:
    @given(seed=seeds)
    def test_from_near_to_exact(self, seed):
        """An answer that an interior point might have stopped at, a millionth off, becomes the optimum."""
        qp, z, y = known(seed)
        rng = np.random.default_rng(seed)
        near = judged(qp, z + 1e-6 * rng.standard_normal(z.size), y + 1e-6 * rng.random(y.size), "solved")
        assert near.kkt > 1e-9
        assert np.abs(polish(qp, near, np.linalg.cholesky(qp.H)).z - z).max() < 1e-11

    @given(seed=seeds)
    def test_a_wrong_set_of_limits_is_corrected_or_the_answer_is_left(self, seed):
        """Started from the optimum without limits, never worse than that."""
        qp, _, y = known(seed)
        far = judged(qp, np.linalg.solve(qp.H, -qp.f), np.full(y.size, 1e-3), "solved")
        assert polish(qp, far, np.linalg.cholesky(qp.H)).kkt <= far.kkt

    def test_nothing_found_is_nothing_polished(self):
        qp = known(1)[0]
        none = judged(qp, None, None, "infeasible")
        assert polish(qp, none, np.linalg.cholesky(qp.H)) is none
