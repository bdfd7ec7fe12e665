"""The primal active set: optima known from elsewhere, a way that only goes down, and an inverse that stays one."""

from dataclasses import replace

import numpy as np
import pytest
from rates_support import INPUTS, STAGES, N, posed, stated
from support import random_motion, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import bordered, primal, qp_primal
from tensctl.synthesis.constant_rates import ConstantRates
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_primal import FAR, PrimalSolver
from tensctl.synthesis.relaxed import relax

HORIZON = 10


@pytest.fixture(scope="module")
def controller(mast):
    return tc.MPC(mast[2], horizon=HORIZON)


@pytest.fixture
def steering(controller):
    controller.reset()
    return controller


def searched(form, step, guess=None, work=1e9, tol=1e-12):
    return primal.search(form, step, np.zeros(N) if guess is None else guess.copy(), 4 * N, tol, work)


class TestSearch:
    @pytest.mark.parametrize("crowded", [False, True], ids=["general", "rows twice"])
    @pytest.mark.parametrize("seed", range(20))
    def test_optimum_of_the_dual_active_set(self, seed, crowded):
        import daqp

        form, step = posed(np.random.default_rng(seed), crowded)
        ended, x, push, multipliers = searched(form, step)
        assert ended == primal.SOLVED
        H, f, A, lower, upper = stated(form, step)
        other, _, flag, _ = daqp.solve(H, f, A, upper, lower, np.zeros(lower.size, np.int32), primal_tol=1e-12)
        assert flag > 0
        assert np.abs(x - other).max() < 1e-9
        # Optimality by its definition, from the problem's own data.
        pull = H @ x + f + A.T @ multipliers
        assert np.abs(pull - push).max() < 1e-9 * np.abs(f).max()
        at_lower, at_upper = x <= lower[: x.size], x >= upper[: x.size]
        assert np.abs(push[~at_lower & ~at_upper]).max(initial=0.0) == 0.0
        assert (push[at_lower & ~at_upper] >= 0.0).all()
        assert (push[at_upper & ~at_lower] <= 0.0).all()
        values = A @ x
        assert (values >= lower[x.size :] - 1e-12).all()
        assert (values <= upper[x.size :] + 1e-12).all()
        gaps = np.where(multipliers < 0, values - lower[x.size :], upper[x.size :] - values)
        assert np.abs(gaps[multipliers != 0]).max(initial=0.0) < 1e-10

    @pytest.mark.parametrize("seed", range(5))
    def test_goes_down_and_keeps_all_limits(self, seed):
        """Wherever its work ends, from the guess brought within its limits on."""
        form, step = posed(np.random.default_rng(seed))
        guess = np.random.default_rng(seed).standard_normal(N)
        H, f, A, lower, upper = stated(form, step)
        costs = []
        for work in np.append(0.0, np.geomspace(1e3, 1e6, 25)):
            _, x, _, _ = searched(form, step, guess, work)
            costs.append(0.5 * x @ H @ x + f @ x)
            values = np.append(x, A @ x)
            assert (values >= lower - 1e-12).all()
            assert (values <= upper + 1e-12).all()
        assert (np.diff(costs) <= 1e-12 * np.abs(costs[0])).all()
        assert len(set(costs)) > 5

    def test_the_guess_changes_nothing(self, rng):
        form, step = posed(rng)
        first = searched(form, step)[1]
        for _ in range(5):
            assert np.abs(searched(form, step, rng.standard_normal(N))[1] - first).max() < 1e-12

    @pytest.mark.parametrize("seed", range(4))
    def test_a_high_price_costs_no_work(self, seed):
        """Pushes are sums of multipliers as large as the price: what is left of them is rounding, no drift."""
        form, step = posed(np.random.default_rng(seed))
        asked = [step._replace(price=price, floor=step.floor + 4) for price in (2e6, 2e10)]
        works = np.geomspace(1e5, 1e7, 25)
        ends = [[searched(form, one, work=work, tol=1e-11)[0] == primal.SOLVED for work in works] for one in asked]
        usual, high = (np.flatnonzero(solved)[0] for solved in ends)
        assert high <= usual

    def test_limits_that_contradict_each_other(self, rng):
        form, step = posed(rng)
        low = step.low.copy()
        low[0] = step.upper[0] + 0.1
        assert searched(form, step._replace(low=low))[0] == primal.STUCK


class TestInverse:
    @pytest.mark.parametrize("seed", range(5))
    def test_of_what_entered_and_did_not_leave(self, seed):
        """Whatever the order, the inverse is that of the matrix in numbers; rows come after two rates each."""
        rng = np.random.default_rng(seed)
        form, _ = posed(rng)
        room, size, m = 60, N + STAGES, 0
        basis = bordered.Basis(np.empty(room, np.int64), np.empty((room, room)), np.empty(room), np.empty(room))
        H, _, A, _, _ = stated(form, posed(rng)[1])
        K = np.block([[H, A.T], [A, np.zeros((len(A), len(A)))]])
        for turn in range(60):
            inside = basis.entries[:m]
            rows = (inside >= size).sum()
            free = np.setdiff1d(np.arange(size), inside)
            if turn % 5 == 4:
                bordered.leave(basis, m, int(rng.choice(np.flatnonzero(inside >= size)) if rows else 0))
                m -= 1
            elif turn % 3 == 2 or not free.size:
                others = np.setdiff1d(np.arange(size, len(K)), inside)
                m += bordered.enter(form, basis, m, int(rng.choice(others)))
            else:
                m += bordered.enter(form, basis, m, int(rng.choice(free)))
            inside = basis.entries[:m]
            assert np.abs(basis.inverse[:m, :m] @ K[np.ix_(inside, inside)] - np.eye(m)).max() < 1e-7
        assert m > 20

    def test_a_row_that_follows_from_others_does_not_enter(self, rng):
        form, _ = posed(rng, crowded=True)
        basis = bordered.Basis(np.empty(50, np.int64), np.empty((50, 50)), np.empty(50), np.empty(50))
        m = 0
        for e in range(N):
            m += bordered.enter(form, basis, m, e)
        size = N + STAGES
        assert bordered.enter(form, basis, m, size)
        assert not bordered.enter(form, basis, m + 1, size + 1)

    def test_room_is_kept(self, rng):
        form, _ = posed(rng)
        basis = bordered.Basis(np.empty(1, np.int64), np.empty((1, 1)), np.empty(1), np.empty(1))
        assert bordered.enter(form, basis, 0, 3)
        assert not bordered.enter(form, basis, 1, 4)


class TestConstantRates:
    @pytest.mark.parametrize("parts", [1, STAGES])
    @pytest.mark.parametrize("seed", range(5))
    def test_best_of_all_plans_of_constant_rates(self, seed, parts):
        """The problem of all stages in the changes of each part, by DAQP; with a part a stage it is the whole."""
        import daqp

        rng = np.random.default_rng(seed)
        form, step = posed(rng)
        now, floor = rng.uniform(-0.5, 0.5, INPUTS), step.floor + 2
        first = np.append(now, np.zeros(N - INPUTS))
        step = step._replace(lower=step.lower + first, upper=step.upper + first, floor=floor)
        plan = ConstantRates(form, parts).plan(step, now, np.tile(now, STAGES), 1e9)
        H, f, A, lower, upper = stated(form, step)
        long = STAGES // parts
        spread = np.kron(np.eye(parts), np.ones((long, 1)))
        free = np.zeros((N + STAGES, parts * (INPUTS + 1)))
        free[:N, : parts * INPUTS] = np.kron(spread / long, np.eye(INPUTS))
        free[N:, parts * INPUTS :] = spread
        began = np.append(first, np.zeros(STAGES))
        bounded = np.vstack([np.eye(N + STAGES), A])
        y, _, flag, _ = daqp.solve(
            free.T @ H @ free, free.T @ (f + H @ began), bounded @ free,
            upper - bounded @ began, lower - bounded @ began, np.zeros(lower.size, np.int32), primal_tol=1e-12,
        )  # fmt: skip
        assert flag > 0
        assert y[parts * INPUTS :].max() > 0.1
        best = (began + free @ y)[:N].reshape(STAGES, INPUTS).cumsum(axis=0)
        assert np.abs(plan - best.ravel()).max() < 1e-8

    @pytest.mark.parametrize("parts", [2, 3])
    def test_parts_of_unequal_length(self, rng, parts):
        """Rates change where parts do, and nowhere else; limits hold."""
        form, step = posed(rng)
        plan = ConstantRates(form, parts).plan(step, np.zeros(INPUTS), np.zeros(N), 1e9)
        rates = np.diff(plan.reshape(STAGES, INPUTS), axis=0, prepend=0.0)
        turns = np.abs(np.diff(rates, axis=0)).max(axis=1) > 1e-9
        assert turns.sum() == parts - 1
        assert (rates.ravel() >= step.lower - 1e-12).all()
        assert (rates.ravel() <= step.upper + 1e-12).all()
        assert (plan >= step.low - 1e-12).all()
        assert (plan <= step.high + 1e-12).all()

    def test_floors_far_above_rest_are_reached(self):
        """20 N at a shell that rests with 4 N, all work bounded: the last plan alone leaves it there for a second."""
        dynamics, rest, linear = solved(shell_scene())
        smallest = []
        for far in (np.inf, FAR):
            controller = tc.MPC(linear, tension_min=20.0)
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(qp_primal, "FAR", far)
                run = tc.simulate(dynamics, rest, controller=controller, t_end=0.6)
            assert {record.status for record in controller.records} <= {"primal bounded", "primal relaxed"}
            smallest.append(run.tensions.min(axis=1)[-1])
        assert smallest[0] < 10
        assert smallest[1] > 18


class TestController:
    @pytest.fixture
    def hopeless(self, mast):
        """So fast that no rates keep all floors."""
        rest = mast[1]
        nodes, velocities = random_motion(rest.potential, np.random.default_rng(1), reach=0.03, speed=1.5)
        return Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs)

    def test_floors_that_give_way(self, steering, hopeless):
        """Most rates are at their limits; the answer is the dual active set's."""
        problem, _, hard = steering.statement(0.0, hopeless)
        soft = relax(hard, HORIZON)
        found = PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=1e10).solve(soft)
        other = DaqpSolver(soft).solve(soft)
        assert found.status == "solved"
        assert found.kkt < 1e-11
        assert np.abs(found.z - other.z).max() < 1e-8
        assert (found.y[-hard.f.size :] != 0).mean() > 0.5

    def test_without_slacks_it_says_that_there_is_none(self, steering, hopeless):
        problem, _, hard = steering.statement(0.0, hopeless)
        assert PrimalSolver(problem.H, problem.rows, HORIZON, soft=False, work=1e10).solve(hard).status == "infeasible"

    def test_bounded_work_is_told(self, mast, steering, hopeless, monkeypatch):
        """The command keeps its limits, the plan costs no more than the one before, and the record says bounded."""
        problem, limits, hard = steering.statement(0.0, hopeless)
        ask = Piece.ask
        short = PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=1e5)
        monkeypatch.setattr(
            Piece,
            "ask",
            lambda own, name, qp, *, soft: short.solve(qp) if name == "primal" else ask(own, name, qp, soft=soft),
        )
        steering.step(0.0, hopeless)
        record = steering.records[-1]
        assert record.status == "primal bounded"
        assert record.kkt > 1e-6
        assert record.relaxed == pytest.approx(limits.shortfall(problem, steering.state()["plan"] - limits.about))
        soft = relax(hard, HORIZON)
        stay = replace(soft, guess=hard.guess)
        first = PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=0.0).solve(stay)
        assert soft.objective(short.solve(soft).z) < soft.objective(first.z)

    def test_a_plan_to_go_on_from_saves_work(self, mast, steering, hopeless):
        """From the optimum itself next to nothing is left to do."""
        problem, _, hard = steering.statement(0.0, hopeless)
        soft = relax(hard, HORIZON)
        optimum = PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=1e10).solve(soft)
        again = replace(soft, guess=optimum.z[: hard.f.size])
        found = PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=2e6).solve(again)
        assert found.status == "solved"
        assert PrimalSolver(problem.H, problem.rows, HORIZON, soft=True, work=2e6).solve(soft).status == "bounded"
        assert np.abs(found.z - optimum.z).max() < 1e-10

    def test_bounded_steps_are_told_of_a_run(self, mast, monkeypatch):
        """A run knows which of its steps they were, and does not count their residuals among those of optima."""
        from tensctl.synthesis import qp_primal

        _, rest, linear = mast
        short = qp_primal.PrimalSolver.__init__
        monkeypatch.setattr(
            qp_primal.PrimalSolver, "__init__", lambda own, *given, **named: short(own, *given, **named | {"work": 1e5})
        )
        controller = tc.MPC(linear, horizon=HORIZON)
        push = tc.Push("P4_1_1", (25.0, 0.0, 0.0), 0.02, 0.12)
        run = tc.simulate(mast[0], rest, controller=controller, t_end=0.3, pushes=[push])
        told = np.array([record.status == "primal bounded" for record in controller.records])
        assert 0 < told.sum() < told.size
        assert (run.bounded == told).all()
        assert run.kkt[told].max() > 1e-6 > run.kkt[~told].max()
