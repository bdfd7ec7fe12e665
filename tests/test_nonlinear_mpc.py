"""Nonlinear MPC: exact sensitivities of the rollout, the linear controller near rest, the optimum far from it."""

import json
import re

import numpy as np
import pytest
from linear_support import SCENES
from support import disturbed, lively_plan, order_of, shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.linear.state_slopes import states_and_slopes
from tensctl.model.kernel import accelerations
from tensctl.model.kernel_columns import acceleration_columns, column_room
from tensctl.synthesis.qp import Solution
from tensctl.synthesis.qp_daqp import DaqpSolver
from tensctl.synthesis.qp_dense import solve_dense
from tensctl.synthesis.qp_lazy import solve_lazily
from tensctl.synthesis.relaxed import relax
from tensctl.synthesis.rollout import Rolling, rolling

DT, RATE, HORIZON = 0.02, 0.5, 5
UNTIED = [name for name, scene in SCENES.items() if not tc.build_dynamics(scene).tied]
TIED = [name for name in SCENES if name not in UNTIED]
KINDS = ["mixed pins", "free EA", "free damped", "weight", "cables, pinned damped EA", "plane"]
STEPS = np.array([1e-2, 1e-3]) / 10


def rough(name, rng, reach=0.05, speed=0.5):
    """Dynamics of a scene, a state in which many tendons are slack, inputs and a plan."""
    dynamics = tc.build_dynamics(SCENES[name])
    nodes, velocities, now, _, plan = lively_plan(dynamics, rng, HORIZON, reach, speed)
    return dynamics, nodes, velocities, now, plan


class TestKernelColumns:
    @pytest.mark.parametrize("name", UNTIED)
    def test_accelerations_are_those_of_the_kernel(self, name, rng):
        dynamics, nodes, velocities, _, _ = rough(name, rng)
        q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
        rest, load = dynamics.members.rest_lengths, dynamics.layout.spread(dynamics.members.forces)
        wanted, found = np.zeros_like(q), np.zeros_like(q)
        none, columns = np.zeros((*q.shape, 0)), np.zeros((rest.size, 0))
        accelerations(dynamics.kernel, q, v, rest, load, wanted)
        room = column_room(dynamics.kernel, 0)
        acceleration_columns(dynamics.kernel, q, v, rest, load.ravel(), none, none, columns, 0, 0, room, found, none)
        assert np.abs(found - wanted).max() < 1e-13 * np.abs(wanted).max()


class TestRollout:
    @pytest.mark.parametrize("name", KINDS + TIED)
    def test_taylor_remainders(self, name, rng):
        """Nodes, velocities and stretches leave remainders of second order, slack tendons among them."""
        dynamics, nodes, velocities, now, plan = rough(name, rng)
        roll, way = rolling(dynamics, DT), rng.standard_normal(plan.shape)
        here = roll(nodes, velocities, now, plan)

        def moved(step):
            return roll(nodes, velocities, now, plan + step * way, columns=False)

        def remainder(value, slope):
            return lambda step: value(moved(step)) - value(here) - step * slope @ way.ravel()

        assert name.startswith("plane") or (here.stretches < 0).any()
        steps = STEPS / 10
        assert taylor_order(remainder(lambda r: r.nodes, here.by_inputs[:, 0]), steps) > 1.9
        assert taylor_order(remainder(lambda r: r.velocities, here.by_inputs[:, 1]), steps) > 1.9
        assert taylor_order(remainder(lambda r: r.stretches, here.stretch_by_inputs), steps) > 1.9

    @pytest.mark.parametrize("name", ["free", "joints"])
    def test_order_against_the_simulation(self, name, rng):
        """Order 4 towards what the event-located integrator gives, while all tendons stay taut."""
        dynamics, rest = tc.build_dynamics(SCENES[name]), tc.find_equilibrium(SCENES[name])
        nodes, manifold = rest.nodes, rest.potential.manifold
        velocities = (manifold.tangent(nodes) @ (0.1 * rng.standard_normal(manifold.size))).reshape(-1, 3)
        still = np.zeros((HORIZON, dynamics.members.gearing.size))
        run = tc.simulate(dynamics, (nodes, velocities), timepts=DT * np.arange(HORIZON + 1), tol=1e-12)
        assert run.tensions.min() > 0
        counts = np.array([1, 2, 4])
        rolls = [Rolling(dynamics, DT, k)(nodes, velocities, still[0], still, columns=False) for k in counts]
        assert order_of(1 / counts, [np.abs(r.nodes - run.nodes[1:]).max() for r in rolls]) > 3.8

    def test_linear_model_at_rest(self, free):
        """At an equilibrium the sensitivities are the linear model's, with the discretisation's error of order 4."""
        dynamics, rest, linear = free
        linear = linear.flexible
        problem = tc.MPC(linear, horizon=HORIZON, dt=DT).problem
        plan = np.tile(rest.inputs, (HORIZON, 1))
        wanted, drive = [], np.zeros((problem.A.shape[0], plan.size))
        for k in range(HORIZON):
            drive = problem.A @ drive
            drive[:, k * plan.shape[1] : (k + 1) * plan.shape[1]] += problem.B
            wanted.append(drive[: len(linear.states)])
        counts, errors = np.array([1, 2, 4]), []
        for k in counts:
            found = Rolling(dynamics, DT, k)(rest.nodes, 0 * rest.nodes, rest.inputs, plan)
            _, slopes = states_and_slopes(linear, found.nodes, found.velocities)
            ours = np.array([s @ by.reshape(s.shape[1], -1) for s, by in zip(slopes, found.by_inputs, strict=True)])
            errors.append(np.abs(ours - wanted).max())
        assert order_of(1 / counts, errors) > 3.8
        assert errors[-1] < 1e-4 * np.abs(wanted).max()


class TestStateSlopes:
    @pytest.mark.parametrize("name", SCENES)
    @pytest.mark.parametrize("part", ["all", "flexible"])
    def test_values_and_taylor_remainder(self, name, part, rng):
        """`state_of` at several points, near and far, and its derivative along motions of rigid rods."""
        case = solved(SCENES[name], outputs=())
        rest, linear = case[1], case[2] if part == "all" else case[2].flexible
        manifold = rest.potential.manifold
        way, turn = rng.standard_normal((2, manifold.size))
        starts = [manifold.retract(rest.nodes, reach * rng.standard_normal(manifold.size)) for reach in (0.0, 0.3)]

        def at(step):
            nodes = [manifold.retract(start, step * way) for start in starts]
            velocities = [(manifold.tangent(p) @ turn).reshape(-1, 3) for p in nodes]
            return np.array(nodes), np.array(velocities)

        nodes, velocities = at(0.0)
        states, slopes = states_and_slopes(linear, nodes, velocities)
        wanted = [linear.state_of(p, v) for p, v in zip(nodes, velocities, strict=True)]
        assert np.abs(states - wanted).max() < 1e-12 * max(1.0, np.abs(wanted).max())

        def remainder(step):
            p, v = at(step)
            change = np.concatenate([(p - nodes).reshape(2, -1), (v - velocities).reshape(2, -1)], axis=1)
            return states_and_slopes(linear, p, v)[0] - states - np.einsum("snc,sc->sn", slopes, change)

        assert taylor_order(remainder, STEPS) > 1.9


@pytest.fixture(scope="module")
def steering(mast):
    return tc.NonlinearMPC(mast[0], mast[1], horizon=HORIZON, rate_max=RATE)


@pytest.fixture
def controller(steering):
    steering.reset()
    return steering


class TestProblem:
    def test_rows_taken_in_by_need_give_the_same_answer(self, mast, controller):
        """None, some and many limits acting: the lazy active set, DAQP and the interior point agree."""
        kept, most = 0, 0
        for size in (0.05, 2.0, 6.0):
            seen = disturbed(mast[1], size)
            qp = controller.statement(0.0, seen, np.tile(mast[1].inputs, (HORIZON, 1)))
            for asked, first in ((qp, None), (relax(qp, HORIZON), qp.f.size + np.arange(HORIZON))):
                known, found, inner = (
                    DaqpSolver(asked).solve(asked),
                    solve_lazily(asked, first=first),
                    solve_dense(asked),
                )
                assert (known.z is None) == (found.z is None) == (inner.z is None)
                if known.z is not None:
                    kept, most = kept + 1, max(most, int((known.y != 0).sum()))
                    assert found.kkt < 1e-9
                    assert np.abs(found.z - known.z).max() < 1e-9
                    assert np.abs(inner.z - known.z).max() < 1e-7
        assert kept > 3
        assert most > 60

    @pytest.mark.parametrize("name", ["free", "joints, guides, weight"])
    def test_first_input_is_the_linear_controllers(self, name):
        """The difference to `tc.MPC` is of second order in the deviation."""
        dynamics, rest, linear = solved(SCENES[name], outputs=())
        nonlinear, known = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON), tc.MPC(linear, horizon=HORIZON)
        sizes, differences = np.array([0.3, 0.1, 0.03]), []
        for size in sizes:
            nonlinear.reset()
            seen = disturbed(rest, size)
            differences.append(np.abs(nonlinear.step(0.0, seen) - known.step(0.0, seen)).max())
        assert order_of(sizes, differences) > 1.8
        assert differences[0] < 0.05 * np.abs(known.step(0.0, disturbed(rest, 0.3)) - rest.inputs).max()

    def test_at_rest_nothing_is_asked(self, mast, controller):
        asked = controller.step(0.0, disturbed(mast[1], 0.0))
        assert np.abs(asked - mast[1].inputs).max() < 1e-10

    def test_iterations_lead_to_the_optimum(self, mast):
        """The multipliers of the last QP make its plan optimal for the nonlinear problem, linearised there."""
        dynamics, rest, _ = mast
        seen, residuals = disturbed(rest, 2.0), []
        for count in (1, 3, 12):
            controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, iterations=count)
            controller.step(0.0, seen)
            assert (controller.records[0].change > 1e-3) == (count == 1)
            plan = controller.state()["plan"]
            answer = solve_lazily(controller.statement(0.0, seen, plan))
            qp = controller.statement(0.0, seen, plan)
            residuals.append(qp.kkt_residual((plan - rest.inputs).ravel(), answer.y))
        assert (answer.y != 0).sum() > 10
        assert residuals[0] > 1e-4
        assert residuals[1] < 0.1 * residuals[0]
        assert residuals[2] < 1e-8
        assert controller.records[0].change < 1e-8

    def test_a_slack_tendon_is_told_how_to_get_taut(self, mast, controller):
        """Its row is the unclamped stretch: negative, and growing as its own rest length shrinks."""
        dynamics, rest, _ = mast
        loose = rest.inputs.copy()
        loose[0] = -0.5
        seen = disturbed(rest, 0.0)
        rollout = controller._roll(seen.nodes, seen.velocities, loose, np.tile(loose, (HORIZON, 1)))
        tendon = dynamics.members.inputs[0]
        assert (rollout.stretches[:, tendon] < -0.1).all()
        for k in range(HORIZON):
            assert rollout.stretch_by_inputs[k, tendon, k * loose.size] == pytest.approx(1.0, abs=1e-12)
            assert not rollout.by_inputs[k, :, :, :, :: loose.size].any()


def spoilt(measurement, chance, rng):
    """What one sample in four is: not there, with a number missing, without inputs, or absurdly fast."""
    if chance < 0.05:
        return None
    nodes, velocities, inputs = measurement.nodes.copy(), measurement.velocities, measurement.inputs
    if chance < 0.1:
        nodes[rng.integers(len(nodes))] = np.nan
    elif chance < 0.15:
        inputs = np.nan * inputs
    elif chance < 0.25:
        velocities = 1e7 * velocities
    return tc.Measurement(nodes, velocities, measurement.lengths, measurement.tensions, inputs)


class Faulty:
    """A controller behind faulty sensors."""

    def __init__(self, controller):
        self.controller, self.dt, self.rng = controller, controller.dt, np.random.default_rng(5)

    def reset(self):
        self.controller.reset()

    def step(self, t, measurement):
        return self.controller.step(t, spoilt(measurement, self.rng.random(), self.rng))


class Counted:
    """A path that notes for which times its nodes are asked."""

    def __init__(self, path):
        self.path, self.times = path, []

    def __getattr__(self, name):
        return getattr(self.path, name)

    def nodes_at(self, t):
        self.times.append(t)
        return self.path.nodes_at(t)


class Rough:
    """A reference that jumps about."""

    def __init__(self, equilibrium):
        self.equilibria = (equilibrium,)

    def inputs_at(self, t):
        size = self.equilibria[0].inputs.size
        noise = [np.random.default_rng(round(1e6 * s)).standard_normal(size) for s in np.ravel(t)]
        return 0.4 * np.reshape(noise, (*np.shape(t), size))

    def tensions_at(self, t):
        return np.broadcast_to(self.equilibria[0].tensions, (*np.shape(t), self.equilibria[0].tensions.size))

    def nodes_at(self, t):
        return self.equilibria[0].nodes

    def velocities_at(self, t):
        return 0 * self.equilibria[0].nodes

    def knot_at(self, t):
        return 0


class TestLoop:
    def test_hard_limits_hold_whatever_is_asked(self, mast):
        dynamics, rest, _ = mast
        controller = tc.NonlinearMPC(dynamics, Rough(rest), horizon=HORIZON, rate_max=RATE, u_max=0.05)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=0.3)
        assert 0.05 * (1 - 1e-12) < np.abs(run.inputs).max() < 0.05 * (1 + 1e-12)
        rates = np.diff(run.rest_lengths, axis=0) / np.diff(run.time)[:, None]
        assert 0.99 * RATE < np.abs(rates).max() <= RATE * (1 + 1e-9)
        assert (run.rest_lengths >= dynamics.members.floors * (1 - 1e-12)).all()

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("name", ["free", "pinned", "joints, guides, weight"])
    def test_faulty_samples_pushes_and_references_out_of_reach(self, name):
        """No exception, no hard limit broken, and every step says what it was."""
        dynamics, rest = tc.build_dynamics(SCENES[name]), tc.find_equilibrium(SCENES[name])
        controller = tc.NonlinearMPC(dynamics, Rough(rest), horizon=HORIZON, rate_max=RATE, u_max=0.4)
        free = dynamics.structure.free.all(axis=1)
        node = dynamics.structure.node_labels[np.flatnonzero(free)[-1]]
        pushes = [tc.Push(node, (20.0, -15.0, 5.0), start=0.2, stop=0.3)]
        run = tc.simulate(dynamics, rest, controller=Faulty(controller), t_end=1.0, pushes=pushes)
        rates = np.diff(run.rest_lengths, axis=0) / np.diff(run.time)[:, None]
        assert np.abs(rates).max() <= RATE * (1 + 1e-9)
        assert (run.rest_lengths >= dynamics.members.floors * (1 - 1e-12)).all()
        assert np.abs(run.inputs).max() <= 0.4 * (1 + 1e-12)
        statuses = [r.status for r in controller.records]
        assert len(statuses) == 51
        assert statuses.count("no measurement") > 2
        assert statuses.count("fallback") > 2
        assert set(statuses) <= {"no measurement", "fallback", "daqp", "primal", "primal relaxed", "primal bounded"}
        optima = [r.kkt for r in controller.records if r.status in ("daqp", "primal", "primal relaxed")]
        assert max(optima) < 1e-9

    def test_modes_too_fast_for_samples(self):
        """A tendon 100 times stiffer: roll-outs have its mode, and keep it taut where a linear model without cannot."""
        stiffness = {"*": 100.0, "t5_1_1": 1e4}
        dynamics, rest, linear = solved(shell_scene(pins=["P1_*_1"], tendons={"stiffness": stiffness}), outputs=())
        with pytest.raises(tc.SynthesisError, match='modes = "truncate"'):
            tc.NonlinearMPC(dynamics, rest, horizon=HORIZON)
        ours = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, modes="truncate")
        assert [mode.index for mode in ours.measure.linear.condensed] == [20]
        known, seen = tc.MPC(linear.flexible, horizon=HORIZON, modes="truncate"), disturbed(rest, 1.0)
        start, ends = (seen.nodes, seen.velocities), []
        for controller in (ours, known):
            run = tc.simulate(dynamics, start, controller=controller, t_end=1.0)
            ends.append(run.distance_to(rest.nodes)[-1])
        assert ends[0] < 0.5 * ends[1]
        assert max(r.kkt for r in ours.records) < 1e-9

    @pytest.mark.parametrize(("ratio", "told"), [(1e4, r"1e\+04"), (1e8, r"1e\+08"), (1e12, r"1e\+12")])
    def test_tendons_too_stiff_to_roll_out(self, ratio, told):
        """The sentence names the tendon, and the period and the controller that it tells to try do."""
        scene = shell_scene(pins=["P1_*_1"], tendons={"stiffness": {"*": 100.0, "t5_2_1": 100.0 * ratio}})
        dynamics, rest, linear = solved(scene, outputs=())
        sentence = (
            rf"tendon t5_2_1 has .* N/m, {told} times the median.* so take dt below (\S+) s, or tc\.MPC, which with"
        )
        with pytest.raises(tc.SynthesisError, match=sentence) as refused:
            tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, modes="truncate")
        dt = 0.99 * float(re.search(sentence, str(refused.value))[1])
        assert 60 <= rolling(dynamics, dt).steps <= 64
        known = tc.MPC(linear.flexible, horizon=HORIZON, modes="truncate")
        assert np.abs(known.step(0.0, disturbed(rest, 0.0)) - rest.inputs).max() < 1e-9

    def test_rods_too_light_to_roll_out(self):
        scene = shell_scene(pins=["P1_*_1"], rods={"mass": {"*": 1.0, "r1_1_1": 1e-8}})
        dynamics, rest, _ = solved(scene, outputs=())
        with pytest.raises(tc.SynthesisError, match=r"the lightest rod 1e-08 kg, of 1 at most\); at most 64"):
            tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, modes="truncate")

    def test_when_every_solver_fails(self, mast, controller, monkeypatch):
        """The last plan goes on, a period later, and the record says so."""
        seen = disturbed(mast[1], 1.0)
        controller.step(0.0, seen)
        plan = controller.state()["plan"]
        failed = Solution(None, None, "failed", np.inf)
        for solver in ("solve_lazily", "solve_dense"):
            monkeypatch.setattr(f"tensctl.synthesis.qp_anew.{solver}", lambda *_, **__: failed)
        monkeypatch.setattr("tensctl.synthesis.qp_anew.PrimalSolver.solve", lambda *_: failed)
        later = tc.Measurement(seen.nodes, seen.velocities, seen.lengths, seen.tensions, plan[0])
        assert np.abs(controller.step(DT, later) - plan[1]).max() < 1e-15
        assert controller.records[-1].status == "fallback"
        assert np.isnan(controller.records[-1].kkt)

    def test_a_sample_that_tells_nothing(self, mast, controller):
        """Rest lengths stay before there is a plan, and then the plan goes on."""
        seen = disturbed(mast[1], 1.0)
        blind = tc.Measurement(np.nan * seen.nodes, seen.velocities, seen.lengths, seen.tensions, seen.inputs)
        assert (controller.step(0.0, blind) == seen.inputs).all()
        controller.step(DT, seen)
        plan = controller.state()["plan"]
        assert (controller.step(2 * DT, None) == plan[1]).all()
        assert [r.status for r in controller.records] == ["no measurement", "daqp", "no measurement"]

    def test_stall_limits(self, mast):
        """Tensions are kept below force_max as `tc.MPC` keeps them, to second order."""
        sizes, differences, acting = np.array([0.3, 0.1]), [], []
        for size in sizes:
            labels, most = mast[0].structure.tendon_labels, mast[1].tensions + 0.5 * size
            limited = {labels[k]: float(most[k]) for k in mast[0].members.inputs}
            scene = shell_scene(pins=["P1_*_1"], actuators={"force_max": limited})
            dynamics, rest, linear = solved(scene, outputs=())
            ours, known = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON), tc.MPC(linear, horizon=HORIZON)
            seen = disturbed(rest, size)
            free = tc.NonlinearMPC(*mast[:2], horizon=HORIZON).step(0.0, seen)
            asked = ours.step(0.0, seen)
            differences.append(np.abs(asked - known.step(0.0, seen)).max())
            acting.append(np.abs(asked - free).max())
        assert order_of(sizes, differences) > 1.6
        assert min(np.array(acting) / differences) > 5

    def test_a_delay_is_bridged_by_the_structure_itself(self, mast, controller):
        """The command is that of a controller without delay, shown the state in which the command begins to act."""
        dynamics, rest, _ = mast
        late = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, rate_max=RATE, delay=0.3 * DT)
        late.step(0.0, disturbed(rest, 2.0, seed=2))
        seen, coming = disturbed(rest, 2.0), late.state()["plan"][0]
        controller.restore(late.state())
        then = Rolling(dynamics, 0.3 * DT, 20)(seen.nodes, seen.velocities, seen.inputs, coming[None], columns=False)
        shown = tc.Measurement(then.nodes[0], then.velocities[0], seen.lengths, seen.tensions, coming)
        wanted = controller.step(DT, shown)
        assert np.abs(late.step(DT, seen) - wanted).max() < 1e-6
        controller.restore({})
        assert np.abs(controller.step(DT, seen) - wanted).max() > 1e-3

    def test_goes_on_from_its_state(self, mast, controller):
        seen, other = disturbed(mast[1], 1.0), disturbed(mast[1], 1.0, seed=2)
        controller.step(0.0, seen)
        kept = controller.state()
        wanted = controller.step(DT, other)
        controller.restore(kept)
        assert (controller.step(DT, other) == wanted).all()

    def test_a_path_is_asked_once_for_each_time(self, mast):
        """States of the reference that are known from the step before change no command."""
        scene = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.1, "duration": 2.0}, mpc={})
        path = tc.plan_shape(scene, start=mast[1])
        asked = Counted(path)
        controller = tc.NonlinearMPC(mast[0], asked, horizon=HORIZON, rate_max=RATE)
        seen = disturbed(mast[1], 0.5)
        controller.step(0.0, seen)
        asked.times.clear()
        kept = controller.state()
        wanted = controller.step(DT, seen)
        assert asked.times == pytest.approx([DT * (HORIZON + 1)], abs=1e-9)
        fresh = tc.NonlinearMPC(mast[0], path, horizon=HORIZON, rate_max=RATE)
        fresh.restore(kept)
        assert (fresh.step(DT, seen) == wanted).all()

    def test_a_start_with_every_tendon_slack(self, mast):
        """Tendons are taken in at the rate limit, and the record says by how much floors miss."""
        dynamics, rest, _ = mast
        controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, rate_max=2.0)
        u = -0.35 * dynamics.members.rest_lengths[dynamics.members.inputs]
        slack = rest.lengths < dynamics.members.shortened(u)
        assert slack[~dynamics.structure.grounded_tendons].all()
        seen = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, 0 * rest.tensions, u)
        asked = controller.step(0.0, seen)
        assert controller.records[0].status.endswith("relaxed")
        assert controller.records[0].relaxed > 1.0
        assert controller.records[0].kkt < 1e-6
        assert (asked - u).max() == pytest.approx(2.0 * DT, rel=1e-9)

    @pytest.mark.parametrize(
        ("name", "part"),
        [
            ("joints, guides, weight", 0.1),
            ("guides, damped EA", 0.4),
            ("plane, joint, guide, cable", 0.6),
            ("cables", 0.4),
            ("gangs", 0.6),
        ],
    )
    def test_a_structure_of_any_kind_comes_to_rest(self, name, part):
        """Joints, guides, cables, gangs: 0.5 s leave at most a part of the deviation that is left without control."""
        gangs = {"gangs": {"top": {"t6_*": 1.0}, "side": {"t5_*": 1.0, "t8_*": -0.5}}}
        scene = SCENES[name] if name in SCENES else shell_scene(pins=["P1_*_1"], actuators=gangs)
        dynamics, at_rest, linear = solved(scene, outputs=())
        floor = 0.05 * at_rest.tensions[at_rest.tensions > 0].min()
        controller = tc.NonlinearMPC(dynamics, at_rest, horizon=HORIZON, rate_max=RATE, tension_min=floor)
        seen = disturbed(at_rest, 1.0)
        start = seen.nodes, seen.velocities
        held, loose = (tc.simulate(dynamics, start, controller=c, t_end=0.5) for c in (controller, None))
        ends = [np.linalg.norm(linear.flexible.state_of(r.nodes[-1], r.velocities[-1])) for r in (held, loose)]
        assert ends[0] < part * ends[1]
        rates = np.diff(held.rest_lengths, axis=0) / np.diff(held.time)[:, None]
        assert np.abs(rates).max() <= RATE * (1 + 1e-9)
        assert {r.status for r in controller.records} == {"daqp"}
        assert max(r.kkt for r in controller.records) < 1e-9

    def test_a_cut_tendon_that_the_controller_does_not_know_of(self, mast):
        dynamics, rest, _ = mast
        stiffness = dynamics.members.stiffness.copy()
        stiffness[dynamics.members.inputs[4]] = 1e-9
        controller = tc.NonlinearMPC(dynamics, rest, horizon=HORIZON, rate_max=RATE)
        run = tc.simulate(dynamics.varied(stiffness=stiffness), rest, controller=controller, t_end=0.5)
        assert {r.status for r in controller.records} == {"daqp", "primal relaxed"}
        rates = np.diff(run.rest_lengths, axis=0) / np.diff(run.time)[:, None]
        assert np.abs(rates).max() <= RATE * (1 + 1e-9)
        assert (run.rest_lengths >= dynamics.members.floors * (1 - 1e-12)).all()

    def test_stiff_tendons(self):
        """k = 1e6: the same scene with time scaled by the root of stiffness over mass asks for the same inputs."""
        asked = []
        for k in (100.0, 1e6):
            dynamics, rest, _ = solved(shell_scene(pins=["P1_*_1"], tendons={"stiffness": k}), outputs=())
            pace = np.sqrt(k / 100.0)
            controller = tc.NonlinearMPC(
                dynamics, rest, horizon=HORIZON, dt=DT / pace, tension_min=1e-3 * k, rate_max=RATE * pace
            )
            seen = disturbed(rest, 2.0)
            seen = tc.Measurement(seen.nodes, pace * seen.velocities, seen.lengths, seen.tensions, seen.inputs)
            asked.append(controller.step(0.0, seen))
            assert controller.records[0].kkt < 1e-9
        assert np.abs(asked[1] - asked[0]).max() < 1e-7

    def test_a_step_of_the_reference_beyond_one_linear_model(self):
        """30 % taller at once: floors are kept where a linear model of the target lets tendons go slack."""
        scene = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.3, "duration": 60.0}, mpc={})
        dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
        target = tc.plan_shape(scene, start=rest).target
        known = tc.MPC(tc.linearize(dynamics, target, outputs=()), horizon=10)
        ours, theirs = (
            tc.simulate(dynamics, rest, controller=controller, t_end=0.6, rate_max=RATE)
            for controller in (tc.NonlinearMPC(dynamics, target, horizon=10), known)
        )
        assert ours.tensions[:, dynamics.members.inputs].min() > 0.09
        assert theirs.tensions[:, dynamics.members.inputs].min() == 0.0
        assert ours.distance_to(target.nodes)[-1] < 0.25 * ours.distance_to(target.nodes)[0]


def test_a_scene_asks_for_it(tmp_path):
    """`[mpc] model = "nonlinear"`: the whole run, its certificate and its summary."""
    scene = shell_scene(
        pins=["P1_*_1"],
        target={"height_scale": 1.1, "duration": 3.0},
        mpc={"model": "nonlinear", "horizon": HORIZON, "iterations": 2, "u_max": 0.6, "modes": "truncate"},
        simulation={"t_end": 0.2, "controller": "mpc"},
    )
    results = tc.run(scene, tmp_path)
    assert isinstance(results.mpc, tc.NonlinearMPC)
    assert results.mpc.iterations == 2
    told = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["mpc"]
    assert told["statuses"] == {"daqp": 11}
    assert told["hard_limit_violations"] == told["samples_below_tension_floor"] == 0
    assert told["worst_kkt"] < 1e-9
    assert told["cvxpy_cost_difference"] < 1e-8
    assert told["cvxpy_input_difference_m"] < 1e-8
    assert told["variables"] == HORIZON * 21
    assert 0 < told["largest_share_of_u_max"] < 1
    assert told["terminal_riccati_residual"] < 1e-12


class TestRefusals:
    def test_periods_too_long(self, mast):
        stiff = shell_scene(pins=["P1_*_1"], tendons={"stiffness": 1e6})
        with pytest.raises(tc.SynthesisError, match="take dt below"):
            tc.NonlinearMPC(tc.build_dynamics(stiff), tc.find_equilibrium(stiff))
        with pytest.raises(tc.SynthesisError, match="too long for mode"):
            tc.NonlinearMPC(mast[0], mast[1], dt=0.2)

    def test_stiff_dampers(self):
        scene = shell_scene(pins=["P1_*_1"], tendons={"damping": 5e4})
        with pytest.raises(tc.SynthesisError, match=r"dampers and drag stop it.* take dt below"):
            tc.NonlinearMPC(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    @pytest.mark.parametrize(
        ("given", "match"),
        [
            ({"iterations": 0}, "iterations is 0"),
            ({"tension_min": np.nan}, "tension_min is nan"),
            ({"delay": 1.0}, "delay is 1.0 s"),
        ],
    )
    def test_settings(self, mast, given, match):
        with pytest.raises(tc.SynthesisError, match=match):
            tc.NonlinearMPC(mast[0], mast[1], **given)
