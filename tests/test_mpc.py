"""MPC solves its own problem exactly, keeps hard limits whatever happens, and gives way on tensions by the least."""

import numpy as np
import pytest
import scipy.optimize
from support import random_motion, replaced, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis import Weights, condensed
from tensctl.synthesis.piece import Piece
from tensctl.synthesis.qp import Solution, judged
from tensctl.synthesis.qp_cvxpy import reference_optimum
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_dual import DualSolver
from tensctl.synthesis.qp_solvers import SOLVERS, first_choice, new_solver, order_of
from tensctl.synthesis.relaxed import relax

HORIZON, RATE, FLOOR = 10, 0.5, 2.0
NO_FLOOR = 0.0


@pytest.fixture(scope="module")
def steering(mast):
    return tc.MPC(mast[2], horizon=HORIZON, tension_min=FLOOR, rate_max=RATE)


@pytest.fixture
def controller(steering):
    steering.reset()
    return steering


def shown(case, nodes, velocities, inputs=None):
    """What the controller sees; commands depend on nodes, velocities and inputs only."""
    rest = case[1]
    inputs = rest.inputs if inputs is None else inputs
    return Measurement(nodes, velocities, rest.lengths, rest.tensions, inputs)


# Solvers whose work is bounded, with the tolerance that takes the bound away.
BOUNDLESS = {"primal": 1e-11}
# Reach (m) and speed (m/s) of random disturbances: no limit acts; some do; 35 tension rows and 46 rate rows do.
QUIET, LIVELY, BUSY = (0.001, 0.01), (0.006, 0.1), (0.005, 0.3)


def disturbed(case, reach, speed):
    """A random disturbance; always the same one, but for its size."""
    rest, rng = case[1], np.random.default_rng(1)
    manifold = rest.potential.manifold
    nodes = manifold.retract(rest.nodes, reach * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (speed * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return shown(case, nodes, velocities)


class TestOptimum:
    """Every solver, condensed or by stages, against the same problem stated with states in cvxpy."""

    @pytest.mark.parametrize("size", [QUIET, LIVELY, BUSY], ids=["quiet", "lively", "busy"])
    def test_every_solver_and_cvxpy(self, mast, controller, size):
        problem, limits, qp = controller.statement(0.0, disturbed(mast, *size))
        cost, inputs = reference_optimum(problem, limits)
        assert np.isfinite(cost)
        for name in SOLVERS:
            found = new_solver(name, problem, soft=False, tol=BOUNDLESS.get(name)).solve(qp)
            ours = qp.objective(found.z) + problem.constant(limits.start)
            assert abs(ours - cost) < 1e-7 * cost
            assert np.abs(found.z[: inputs.shape[1]] - inputs[0]).max() < 1e-7
            assert found.kkt < 1e-7

    @pytest.mark.parametrize("size", [LIVELY, (0.03, 1.5)], ids=["floors kept", "floors out of reach"])
    def test_slack_is_the_same_by_stages(self, mast, controller, size):
        """Floors give way by the same amounts, at the same cost, whether states are eliminated or not."""
        problem, _, hard = controller.statement(0.0, disturbed(mast, *size))
        soft = relax(hard, HORIZON)
        n = hard.f.size
        found = {
            name: new_solver(name, problem, soft=True, tol=BOUNDLESS.get(name)).solve(soft)
            for name in ("daqp", "primal", "piqp", "clarabel")
        }
        for other in ("primal", "piqp", "clarabel"):
            assert found[other].kkt < 1e-8
            assert np.abs(found[other].z - found["daqp"].z)[n:].max() < 1e-8
            assert soft.objective(found[other].z) == pytest.approx(soft.objective(found["daqp"].z), rel=1e-8)
        assert (found["piqp"].z[n:].max() > 1e-4) == (size == (0.03, 1.5))

    def test_the_interior_point_remembers_nothing(self, mast, controller):
        """Used or new, an answer is the same to the last bit."""
        problem, _, qp = controller.statement(0.0, disturbed(mast, *BUSY))
        _, _, before = controller.statement(0.0, disturbed(mast, 0.03, 1.5))
        used = new_solver("piqp", problem, soft=True)
        used.solve(relax(before, HORIZON))
        asked = relax(qp, HORIZON)
        assert (used.solve(asked).z == new_solver("piqp", problem, soft=True).solve(asked).z).all()

    def test_a_tolerance_reaches_each_solver(self, mast, controller):
        """Loose answers are off by more than tight ones; an active set breaks rows by as much as it may."""
        problem, limits, qp = controller.statement(0.0, disturbed(mast, *BUSY))
        exact = DaqpSolver(qp).solve(qp).z
        for name in SOLVERS:
            loose, tight = (new_solver(name, problem, soft=False, tol=tol).solve(qp) for tol in (1e-3, 1e-9))
            off, near = (np.abs(found.z - exact).max() for found in (loose, tight))
            assert near < 1e-6
            assert tight.kkt < 1e-7
            if name == "piqp":  # its answers are polished
                assert off <= 1e-6
            else:
                assert off > 10 * near
        loose = new_solver("daqp", problem, soft=False, tol=1e-3).solve(qp)
        assert 1e-6 < qp.violation(loose.z) <= 1e-3
        assert np.abs(reference_optimum(problem, limits, tol=1e-3)[1].ravel() - exact).max() > 1e-6

    def test_an_active_set_that_takes_long_hands_over(self, mast, controller):
        """Within a few iterations there is no answer, and the interior point's is the one that long ones give."""
        _, _, qp = controller.statement(0.0, disturbed(mast, *BUSY))
        assert DaqpSolver(qp, most=5).solve(qp).status == "failed"
        assert DaqpSolver(qp).solve(qp).status == "solved"

    def test_order_of_solvers(self):
        """Each is asked for the hard problem before any floor gives way, and each that was not, later."""
        for first in SOLVERS:
            order = order_of(first, 480, 1.0)
            assert order[0] == (first, False)
            assert [soft for _, soft in order] == sorted(soft for _, soft in order)
            assert ("piqp", True) in order
            assert len(set(order)) == len(order)
        name, why = first_choice(20, 24, 48, 1.0)
        assert name == "dual"
        assert first_choice(10, 304, 628, 1.0)[0] == "dual"
        assert first_choice(20, 304, 1000, 1.0)[0] == "daqp"
        assert [first_choice(900, 4, 4, spread)[0] for spread in (1.0, 1e9)] == ["piqp", "dual"]
        assert "0.92 million operations in an active set at rest, 670 in" in why

    @pytest.mark.parametrize(("stiffer", "second"), [(1.0, "piqp"), (1e9, "daqp")], ids=["soft", "stiff"])
    def test_stiffness_decides_who_is_asked_when_one_fails(self, mast, stiffer, second):
        """Where the primal set fails, the next one of a stiff mast is no interior point; `why` has the figure."""
        rest = mast[1]
        labels = rest.structure.tendon_labels
        k = np.where([label.startswith("t5_") for label in labels], stiffer, 1.0) * 100.0
        lengths = rest.lengths - rest.tensions / k
        tendons = {
            name: dict(zip(labels, values.tolist(), strict=True))
            for name, values in (("stiffness", k), ("rest_length", lengths))
        }
        scene = tc.Scene(structure=rest.structure, tendons=tendons)
        there = tc.find_equilibrium(scene, start=rest.nodes)
        linear = tc.linearize(tc.build_dynamics(scene), there, outputs=())
        controller = tc.MPC(linear, horizon=HORIZON, tension_min=15.0, modes="truncate")
        assert controller.solver == "dual"
        assert f"stiffest tendon is {stiffer:.2g} times the softest" in controller.why
        piece, asked = controller.piece_at(0.0), []
        ask = piece.ask

        def told(name, qp, *, soft):
            asked.append(name)
            return judged(qp, None, None, "failed") if name == "primal" else ask(name, qp, soft=soft)

        object.__setattr__(piece, "ask", told)
        seen = Measurement(there.nodes, 0 * there.nodes, there.lengths, there.tensions, there.inputs)
        controller.step(0.0, seen)
        assert asked[-2:] == ["primal", second]
        assert controller.records[0].status == f"{second} relaxed"
        assert controller.records[0].kkt < 1e-9

    def test_limits_act_in_the_hardest_of_them(self, mast, controller):
        """The comparison would prove little if no limit acted: here rates and tension floors do."""
        _, _, qp = controller.statement(0.0, disturbed(mast, *BUSY))
        y = DaqpSolver(qp).solve(qp).y[qp.f.size :]
        count = qp.A.shape[0] - qp.f.size
        assert (y[:count] != 0).sum() > 20
        assert (y[count:] != 0).sum() > 20

    def test_condensed_cost_is_the_cost_of_the_prediction(self, mast, controller, rng):
        """z'Hz/2 + f'z + constant is the sum over predicted stages, for any plan."""
        problem, limits, qp = controller.statement(0.0, disturbed(mast, *LIVELY))
        plan = 0.01 * rng.standard_normal((HORIZON, 21))
        state, cost = limits.start, 0.0
        for k, v in enumerate(plan):
            state = problem.A @ state + problem.B @ v
            weight = problem.P if k == HORIZON - 1 else problem.Q
            cost += 0.5 * state @ weight @ state + 0.5 * v @ problem.R @ v
        assert qp.objective(plan.ravel()) + problem.constant(limits.start) == pytest.approx(cost, rel=1e-12)

    @pytest.mark.parametrize("horizon", [1, 3, 12])
    def test_short_products_are_the_matrices(self, mast, horizon, rng, monkeypatch):
        """Large problems leave out the zeros of their rows; slacks of relaxed ones are added to the same."""
        monkeypatch.setattr(condensed, "_LARGE", 0)
        mpc = tc.MPC(mast[2], horizon=horizon)
        qp = mpc.statement(0.0, disturbed(mast, *QUIET))[2]
        for asked in (qp, mpc.piece_at(0.0).relaxed.problem(qp)):
            z = rng.standard_normal(asked.f.size)
            wanted = asked.A @ z
            assert np.abs(asked.product(z) - wanted).max() < 1e-14 * np.abs(wanted).max()
            assert np.abs(asked.pull(z) - asked.H @ z).max() < 1e-14 * np.abs(asked.H).max() * np.abs(z).sum()

    def test_tension_rows_predict_tensions(self, mast, controller, rng):
        """Stage by stage: scaled C e + D v of the linear model of all tensions."""
        dynamics, rest, _ = mast
        shown_tensions = tc.linearize(dynamics, rest, outputs=("tensions",))
        problem, limits, _ = controller.statement(0.0, disturbed(mast, *LIVELY))
        plan = 0.01 * rng.standard_normal((HORIZON, 21))
        predicted = problem.tension_from_state @ limits.start
        predicted = (predicted + problem.rows[: predicted.size] @ plan.ravel()).reshape(HORIZON, -1)
        state = limits.start
        for k, v in enumerate(plan):
            state = problem.A @ state + problem.B @ v
            wanted = shown_tensions.C @ state[:42] + shown_tensions.D @ v
            assert np.abs(predicted[k] * problem.tension_scale - wanted[problem.tendons]).max() < 1e-10

    def test_solver_asked_first_does_not_matter(self, mast, controller):
        seen = disturbed(mast, *LIVELY)
        asked = controller.step(0.0, seen)
        assert controller.records[0].status == "dual"
        for name in SOLVERS[1:]:
            other = tc.MPC(mast[2], horizon=HORIZON, tension_min=FLOOR, rate_max=RATE, solver=name)
            assert np.abs(asked - other.step(0.0, seen)).max() < 1e-7
            assert other.records[0].status == name


class TestUnconstrained:
    @pytest.fixture
    def idle(self, mast):
        """A controller whose limits are too far to act."""
        return tc.MPC(mast[2], horizon=3, tension_min=NO_FLOOR, rate_max=1e6, weights=Weights(input=0.5))

    def test_first_input_is_the_infinite_horizon_gain(self, mast, idle):
        """The terminal weight solves the Riccati equation, so the horizon's length does not matter."""
        seen = disturbed(mast, *QUIET)
        problem, limits, _ = idle.statement(0.0, seen)
        wanted = mast[1].inputs - problem.K @ limits.start
        assert np.abs(idle.step(0.0, seen) - wanted).max() < 1e-11
        longer = tc.MPC(mast[2], horizon=9, tension_min=NO_FLOOR, rate_max=1e6, weights=Weights(input=0.5))
        assert np.abs(longer.step(0.0, seen) - wanted).max() < 1e-11

    def test_cost_is_the_riccati_cost_to_go(self, mast, idle):
        problem, limits, qp = idle.statement(0.0, disturbed(mast, *QUIET))
        plan = DaqpSolver(qp).solve(qp).z
        cost, start = qp.objective(plan) + problem.constant(limits.start), limits.start
        assert cost == pytest.approx(0.5 * start @ (problem.P - problem.Q) @ start, rel=1e-9)

    def test_at_rest_nothing_is_asked(self, mast, idle):
        _, rest, _ = mast
        assert np.abs(idle.step(0.0, shown(mast, rest.nodes, 0 * rest.nodes))).max() < 1e-12


def test_input_is_the_total_from_L0(mast):
    """At another equilibrium, held by rest lengths of its own, exactly these are asked for again."""
    dynamics, rest, _ = mast
    u = 0.03 * np.linspace(-1, 1, 21)
    other = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]), start=rest.nodes, inputs=u)
    held = tc.MPC(tc.linearize(dynamics, other), horizon=5, rate_max=RATE)
    asked = held.step(0.0, shown(mast, other.nodes, 0 * other.nodes, inputs=u))
    assert np.abs(asked - u).max() < 1e-11


class Rough:
    """A reference that jumps about: no equilibrium, no limit respected."""

    def __init__(self, equilibrium, seed):
        self.equilibria, self._seed = (equilibrium,), seed

    def inputs_at(self, t):
        return np.array([self._noise(s, 21) for s in np.ravel(t)]).reshape(*np.shape(t), 21) * 0.4

    def tensions_at(self, t):
        return np.abs(np.array([self._noise(s, 24) for s in np.ravel(t)]).reshape(*np.shape(t), 24)) * 20

    def nodes_at(self, t):
        rest = self.equilibria[0]
        return rest.potential.manifold.retract(rest.nodes, 0.2 * self._noise(t, 21))

    def velocities_at(self, t):
        return np.zeros_like(self.equilibria[0].nodes)

    def knot_at(self, t):
        return 0

    def _noise(self, t, size):
        return np.random.default_rng([self._seed, round(1e6 * float(t))]).standard_normal(size)


class Overheard:
    """A controller's commands as they leave it, before the plant clips anything."""

    def __init__(self, controller):
        self.controller, self.dt, self.commands, self.seen = controller, controller.dt, [], []

    def step(self, t, measurement):
        self.seen.append(measurement.inputs)
        self.commands.append(self.controller.step(t, measurement))
        return self.commands[-1]

    def reset(self):
        self.controller.reset()


def keeps_hard_limits(controller, run, overheard):
    """Of the run, and of each command by itself: the plant was given no rate limit of its own."""
    members = controller.linear.dynamics.members
    longest = (members.rest_lengths - members.floors)[members.inputs]
    commands, seen = np.array(overheard.commands), np.array(overheard.seen)
    assert np.isfinite(commands).all()
    assert (commands <= longest).all()
    assert np.abs(commands - seen).max() <= controller.rate_max * controller.dt * (1 + 1e-12)
    assert (run.rest_lengths >= members.floors * (1 - 1e-12)).all()
    rates = np.diff(run.rest_lengths, axis=0) / np.diff(run.time)[:, None]
    assert np.abs(rates).max() <= controller.rate_max * (1 + 1e-9)
    return np.abs(rates).max(), run.rest_lengths.min()


class TestHardLimits:
    @pytest.mark.parametrize("seed", range(2))
    def test_rough_reference_and_pushes(self, mast, seed):
        dynamics, rest, linear = mast
        rough = tc.MPC(linear, horizon=5, rate_max=RATE, path=Rough(rest, seed))
        heard, rng = Overheard(rough), np.random.default_rng(seed)
        pushes = [tc.Push("P4_*", 20 * rng.standard_normal(3), 0.1 * k, 0.1 * k + 0.05) for k in range(5)]
        run = tc.simulate(dynamics, rest, controller=heard, t_end=0.5, pushes=pushes)
        fastest, _ = keeps_hard_limits(rough, run, heard)
        assert fastest > 0.99 * RATE, "the rate limit never acted, so nothing is proven"
        assert np.isfinite(run.nodes).all()

    def test_rest_lengths_driven_to_their_floor(self, mast):
        """A reference far below the floors with a rate that would get there at once."""
        dynamics, rest, linear = mast

        class Greedy(Rough):
            def inputs_at(self, t):
                return np.full((*np.shape(t), 21), 5.0)

        greedy = tc.MPC(linear, horizon=5, rate_max=100.0, path=Greedy(rest, 0))
        for u in (rest.inputs, rest.inputs + 0.5):
            asked = greedy.step(0.0, shown(mast, rest.nodes, 0 * rest.nodes, inputs=u))
            left = dynamics.members.rest_lengths[dynamics.members.inputs] - asked
            floors = dynamics.members.floors[dynamics.members.inputs]
            assert (left >= floors - 2e-16).all()
            assert (left < floors + 1e-9).any()

    def test_when_every_solver_fails(self, mast, monkeypatch):
        """Solvers that break down in mid-run: the last plan is followed, then held, within all hard limits."""
        dynamics, rest, linear = mast
        controller = tc.MPC(linear, horizon=5, rate_max=RATE, path=Rough(rest, 3))
        heard, honest, calls = Overheard(controller), Piece.ask, []

        def failing(self, *arguments, **given):
            calls.append(0)
            return honest(self, *arguments, **given) if len(calls) <= 12 else Solution(None, None, "failed", np.inf)

        monkeypatch.setattr(Piece, "ask", failing)
        run = tc.simulate(dynamics, rest, controller=heard, t_end=0.5)
        statuses = [record.status for record in controller.records]
        assert statuses[0] != "fallback"
        assert statuses[-1] == "fallback"
        assert statuses.count("fallback") > 10
        assert all(np.isnan(r.kkt) == (r.status == "fallback") for r in controller.records)
        assert all(np.isfinite(r.relaxed) for r in controller.records)
        keeps_hard_limits(controller, run, heard)

    def test_when_solvers_fail_from_the_start(self, mast, monkeypatch, rng):
        """Without any plan rest lengths stay where they are."""
        controller = tc.MPC(mast[2], horizon=5, rate_max=RATE)
        monkeypatch.setattr(Piece, "ask", lambda *_, **__: Solution(None, None, "failed", np.inf))
        inputs = 0.01 * rng.standard_normal(21)
        nodes, _ = random_motion(mast[1].potential, rng)
        asked = controller.step(0.0, shown(mast, nodes, 0 * nodes, inputs=inputs))
        assert np.abs(asked - inputs).max() < 1e-15

    def test_a_wrong_answer_is_not_taken(self, mast, monkeypatch):
        """A solver that says "solved" and is off by a little is refused by the recomputed KKT residual."""
        controller = tc.MPC(mast[2], horizon=5, rate_max=RATE)
        honest = DualSolver.solve

        def lying(self, qp):
            found = honest(self, qp)
            z = found.z + 1e-4
            return Solution(z, found.y, "solved", qp.kkt_residual(z, found.y))

        monkeypatch.setattr(DualSolver, "solve", lying)
        controller.step(0.0, disturbed(mast, *LIVELY))
        assert controller.records[0].status == "primal"
        assert controller.records[0].kkt < 1e-6


class TestRelaxedFloor:
    @pytest.fixture
    def hopeless(self, mast, controller):
        """A motion so fast that no rest-length rate keeps every tension above the floor."""
        return disturbed(mast, 0.03, 1.5)

    def least(self, qp, horizon):
        """The least sum over stages of the worst missing tension (m): a linear programme, solved by HiGHS."""
        n, count = qp.f.size, qp.A.shape[0] - qp.f.size
        stage = np.kron(np.eye(horizon), np.ones((count // horizon, 1)))
        rates = np.hstack([qp.A[count:], np.zeros((n, horizon))])
        A = np.vstack([np.hstack([-qp.A[:count], -stage]), rates, -rates])
        b = np.concatenate([-qp.lower[n : n + count], qp.upper[n + count :], -qp.lower[n + count :]])
        bounds = [*zip(qp.lower[:n], qp.upper[:n], strict=True), *[(0, None)] * horizon]
        return scipy.optimize.linprog(np.repeat([0, 1], [n, horizon]), A, b, bounds=bounds).fun

    def missing(self, qp, plan, horizon):
        n, count = qp.f.size, qp.A.shape[0] - qp.f.size
        short = (qp.lower[n : n + count] - qp.A[:count] @ plan.ravel()).reshape(horizon, -1)
        return np.maximum(short, 0)

    def test_is_told_and_near_the_least(self, mast, controller, hopeless):
        problem, _, qp = controller.statement(0.0, hopeless)
        assert DaqpSolver(qp).solve(qp).status == "infeasible"
        plan = controller.solve(0.0, hopeless)
        controller.step(0.0, hopeless)
        record = controller.records[0]
        missing = self.missing(qp, plan, HORIZON)
        assert record.status == "primal relaxed"
        assert record.relaxed == pytest.approx((missing * problem.tension_scale).max(), rel=1e-9)
        assert record.relaxed > 0.1
        least = self.least(qp, HORIZON)
        assert least > 0
        assert least * (1 - 1e-6) < missing.max(axis=1).sum() < least * (1 + 1e-3)

    def test_hard_limits_are_not_relaxed(self, mast, controller, hopeless):
        _, limits, _ = controller.statement(0.0, hopeless)
        plan = controller.solve(0.0, hopeless)
        change = np.diff(np.vstack([limits.start[-21:], plan]), axis=0)
        assert (change <= limits.change_upper + 1e-9).all()
        assert (change >= limits.change_lower - 1e-9).all()
        assert (plan <= limits.input_upper + 1e-9).all()

    def test_floors_that_can_be_kept_are_kept(self, mast, controller):
        seen = disturbed(mast, *BUSY)
        _, _, qp = controller.statement(0.0, seen)
        plan = controller.solve(0.0, seen)
        controller.step(0.0, seen)
        assert controller.records[0].relaxed == 0
        assert self.missing(qp, plan, HORIZON).max() < 1e-12


class TestClosedLoop:
    def test_holds_against_a_push_and_repeats_itself(self, mast, controller):
        """Two runs of one controller are the same to the last bit: `simulate` resets it."""
        dynamics, rest, _ = mast
        push = tc.Push("P4_1_1", [5.0, 0.0, 0.0], 0.1, 0.2)
        runs = [tc.simulate(dynamics, rest, controller=controller, t_end=2.0, pushes=[push]) for _ in range(2)]
        assert (runs[0].nodes == runs[1].nodes).all()
        assert len(controller.records) == len(runs[0].sample_time) == 101
        error = runs[0].distance_to(rest.nodes)
        assert error.max() > 0.02
        assert error[-1] < 0.1 * error.max()
        for array in (runs[0].nodes, runs[0].tensions, runs[0].inputs, runs[0].kkt):
            assert np.isfinite(array).all()
        assert runs[0].kkt.max() < 1e-6

    def test_follows_a_path(self, mast):
        dynamics, rest, _ = mast
        scene = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.1, "duration": 1.0}, mpc={"tension_min": 1.0})
        path = tc.plan_shape(scene, start=rest)
        linear = tc.linearize(dynamics, path.target, outputs=())
        controller = tc.MPC(linear, horizon=HORIZON, tension_min=1.0, rate_max=RATE, path=path)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=3.5)
        on_the_way = [np.abs(run.nodes[k] - path.nodes_at(t)).max() for k, t in enumerate(run.time)]
        assert max(on_the_way) < 0.02
        assert run.distance_to(path.target_nodes)[-1] < 1e-3

    def test_free_shell_while_it_drifts(self, free, rng):
        """A free structure is controlled in its own frame, wherever it goes."""
        dynamics, rest, linear = free
        controller = tc.MPC(linear, horizon=5, tension_min=0.1, rate_max=RATE)
        start = rest.potential.manifold.retract(rest.nodes, 0.01 * rng.standard_normal(30))
        drift = np.array([0.5, -0.2, 0.1]) + np.cross([0.2, 0.4, -0.3], start)
        run = tc.simulate(dynamics, (start, drift), controller=controller, t_end=2.0)
        first, last = (linear.flexible.state_of(run.nodes[k], run.velocities[k]) for k in (0, -1))
        assert np.linalg.norm(last) < 0.3 * np.linalg.norm(first)


class TestMistakes:
    def test_too_long_a_period(self, mast):
        """The fastest mode has 6.366 Hz: 0.0785 s is its half period."""
        with pytest.raises(tc.SynthesisError, match=r"mpc\.dt = 0\.1 s is too long for mode 20 at 6\.37 Hz; take"):
            tc.MPC(mast[2], dt=0.1)
        assert tc.MPC(mast[2], dt=0.07, horizon=2).dt == 0.07

    def test_too_large_a_problem(self, mast):
        with pytest.raises(tc.SynthesisError, match=r"shorten the horizon or choose fewer actuators\.tendons"):
            tc.MPC(mast[2], horizon=1000)

    def test_mode_that_nothing_drives(self):
        """Drift of an undriven mode leaves the terminal Riccati equation without a solution; the mode is named."""
        _, _, linear = solved(shell_scene(pins=["P1_*_1"], actuators={"tendons": ["t5_1_1"]}))
        with pytest.raises(tc.SynthesisError, match=r"mode 1 at .* neither damped nor driven"):
            tc.MPC(linear, horizon=3)


class TestUnlimited:
    """The minimum without limits, which is a linear function of the start and of what is wanted."""

    @pytest.mark.parametrize("followed", [False, True])
    def test_it_is_the_minimum(self, mast, followed):
        linear, wanted = mast[2], {}
        if followed:
            weights = tc.Weights(energy=0.1, outputs={"nodes:P4_1_1_z": 1e-3})
            wanted = {"weights": weights, "signal": lambda t: np.array([mast[1].nodes.max() + 0.01 * t])}
        controller = tc.MPC(linear, horizon=6, **wanted)
        problem, _, qp = controller.statement(0.3, disturbed(mast, *LIVELY))
        assert qp.free is not None
        z = qp.free[: qp.f.size]
        rounding = np.finfo(float).eps * np.linalg.cond(qp.H) * np.abs(z).max()
        assert np.abs(qp.free - qp.values(np.linalg.solve(qp.H, -qp.f))).max() < rounding
        assert np.abs(qp.H @ z + qp.f).max() < 1e-12 * np.abs(qp.f).max()
        assert problem.unlimited.shape == (qp.upper.size, qp.start.size + 6 * followed)

    def test_a_solver_that_is_not_told_finds_it(self, mast, controller):
        """The same answer to rounding, and where limits act the same steps."""
        for size in (QUIET, LIVELY):
            problem, _, qp = controller.statement(0.0, disturbed(mast, *size))
            for solver in (DaqpSolver(qp), DualSolver(problem)):
                told, untold = solver.solve(qp), solver.solve(replaced(qp, free=None))
                assert told.status == untold.status == "solved"
                assert np.abs(told.z - untold.z).max() < 1e-12 * np.abs(told.z).max()
                assert max(told.kkt, untold.kkt) < 1e-9


class Reticent:
    """A reference that never says that it rests."""

    def __init__(self, reference):
        self._reference = reference

    def __getattr__(self, name):
        if name == "ends":
            raise AttributeError
        return getattr(self._reference, name)


class TestAtRest:
    """What is computed once of a reference that rests is what every step would compute."""

    @pytest.mark.parametrize("delay", [0.0, 0.012])
    def test_commands_are_the_same_to_the_last_bit(self, mast, delay):
        dynamics, rest, linear = mast
        path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), {"height_scale": 1.02, "duration": 0.3})
        runs = [
            tc.simulate(
                dynamics, rest, controller=tc.MPC(linear, horizon=4, path=way, delay=delay), t_end=0.5,
                pushes=[tc.Push("P4_1_1", (3.0, 0.0, 0.0), 0.35, 0.4)],
            )
            for way in (path, Reticent(path))
        ]  # fmt: skip
        assert (runs[0].inputs == runs[1].inputs).all()
        assert np.ptp(runs[0].inputs[runs[0].time > 0.35], axis=0).max() > 1e-4

    def test_a_path_rests_from_its_end_on(self, mast):
        path = tc.plan_shape(shell_scene(pins=["P1_*_1"]), {"height_scale": 1.02, "duration": 0.3, "start": 0.1})
        assert path.ends == pytest.approx(0.4)
        assert path.knot_at(path.ends) == path.knot_at(path.ends - 1e-9) == len(path.equilibria) - 1
        for at in (path.inputs_at, path.tensions_at, path.nodes_at):
            assert (at(path.ends) == at(path.ends + 1.0)).all()
            assert np.abs(at(path.ends) - at(path.ends - 1e-9)).max() < 1e-6
