"""Stall limits: planned shapes and predicted tensions stay below `actuators.force_max`; without one nothing changes."""

import numpy as np
import pytest
from compiled import Compiled, flat
from support import shell_scene
from test_mpc import disturbed

import tensctl as tc
from tensctl.synthesis.input_limits import powered_rates
from tensctl.synthesis.qp_cvxpy import reference_optimum
from tensctl.synthesis.qp_solvers import new_solver
from tensctl.synthesis.relaxed import relax
from tensctl.synthesis.sensors import Reading

LAWS = {"k": {}, "EA": {"EA": 80.0}}
# Below the largest tension of the unlimited target, above that of the start: 12.97 and 13.11 N; 14.09 and 15.65 N.
CEILING = {"k": 13.0, "EA": 14.5}
HORIZON = 8


def mast(law="k", **actuators):
    target = {"height_scale": 1.2, "duration": 3.0}
    return shell_scene(pins=["P1_*_1"], tendons=LAWS[law], target=target, actuators=actuators)


@pytest.fixture(scope="module", params=LAWS)
def limited(request):
    """Scene, path and stall limit."""
    scene = mast(request.param, force_max=CEILING[request.param])
    return scene, tc.plan_shape(scene, tension_min=0.1), CEILING[request.param]


class TestPath:
    def test_limit_is_kept_and_acts(self, limited):
        _, path, most = limited
        path.verify(0.1)
        assert path.tensions[:, ~path.target.structure.grounded_tendons].max() == pytest.approx(most, rel=1e-9)

    def test_least_change(self, limited):
        """KKT by re-solved equilibria: u mixes gradients of the height and of tensions at the limit, theirs <= 0."""
        scene, path, most = limited
        last = path.target
        at = np.flatnonzero(~last.structure.grounded_tendons & (last.tensions > most - 1e-6))
        top = [last.structure.node_labels.index(f"P4_{i}_1") for i in (1, 2, 3)]

        def seen(u):
            found = tc.find_equilibrium(scene, start=last.nodes, inputs=u)
            return np.append(found.tensions[at], found.nodes[top, 2].mean())

        step, u = 1e-4, last.inputs
        slopes = np.array([(seen(u + d) - seen(u - d)) / (2 * step) for d in step * np.eye(u.size)])
        multipliers, *_ = np.linalg.lstsq(slopes, u, rcond=None)
        assert at.size == 3
        assert np.abs(u - slopes @ multipliers).max() < 1e-5 * np.abs(u).max()
        assert (multipliers[:-1] < 0).all()

    def test_a_limit_that_does_not_act_changes_nothing(self):
        free, limited = (tc.plan_shape(scene, tension_min=0.1) for scene in (mast(), mast(force_max=100.0)))
        assert np.abs(free.rest_lengths - limited.rest_lengths).max() < 1e-9

    def test_out_of_reach(self):
        """The sentence names both limits, and the tendons at them."""
        limits = r"above 12.9 N and up to force_max: t.* at tension_min and t.* at force_max .*raise actuators.force"
        with pytest.raises(tc.SynthesisError, match=limits):
            tc.plan_shape(mast(force_max=13.0), tension_min=12.9)

    def test_a_start_beyond_its_limit(self):
        with pytest.raises(tc.SynthesisError, match=r"start has 12.96 N in t5_._1, above its force_max = 12 N; raise"):
            tc.plan_shape(mast(force_max={"t5_*": 12.0}))

    def test_a_broken_path_is_found(self):
        path = tc.plan_shape(mast(force_max=13.0), tension_min=0.1)
        members = path.target.potential.members
        members.force_max[members.inputs] = 10.0
        with pytest.raises(tc.SynthesisError, match=r"planned shape 0 has 12.96 N in t"):
            path.verify()


class TestMembers:
    def test_by_label_and_actuated_only(self):
        members = tc.build_dynamics(mast(force_max={"*": 20.0, "t5_*": 9.0}, tendons=["t5_*", "t6_1_1"])).members
        labels = np.array(tc.build_dynamics(mast()).structure.tendon_labels)
        limits = dict(zip(labels, members.force_max, strict=True))
        assert limits["t5_2_1"] == 9.0
        assert limits["t6_1_1"] == 20.0
        assert np.isfinite(members.force_max).sum() == 4

    def test_a_tendon_without_actuator(self):
        with pytest.raises(tc.StructureError, match=r'force_max: "t6_\*" names no tendon with an acting actuator'):
            tc.build_dynamics(mast(tendons=["t5_*"], force_max={"t6_*": 9.0}))

    def test_a_limit_of_zero(self):
        with pytest.raises(tc.SceneError, match=r"actuators.force_max is 0.* > 0"):
            mast(force_max=0.0)


def built(**actuators):
    scene = mast(**actuators)
    dynamics, rest = tc.build_dynamics(scene), tc.find_equilibrium(scene)
    return dynamics, rest, tc.linearize(dynamics, rest, outputs=())


@pytest.fixture(scope="module")
def steering():
    case = built(force_max=13.5)
    return *case, tc.MPC(case[2], horizon=HORIZON, tension_min=0.5)


class TestPredictiveControl:
    def test_rows(self, steering):
        """Floors of 21 tendons, then their limits turned about; margins in newtons are those of the tensions."""
        _, rest, _, controller = steering
        problem = controller.problem
        assert problem.tendons.size == 42
        room = problem.margin(rest.tensions, 0.5) * problem.tension_scale
        loose = ~rest.structure.grounded_tendons
        assert np.abs(room[:21] - (rest.tensions[loose] - 0.5)).max() < 1e-12
        assert np.abs(room[21:] - (13.5 - rest.tensions[loose])).max() < 1e-12

    def test_every_solver_and_cvxpy(self, steering):
        """Limits act from above, and all statements agree on the optimum."""
        _, _, _, controller = steering
        problem, limits, qp = controller.statement(0.0, disturbed(steering, 0.01, 0.1))
        cost, inputs = reference_optimum(problem, limits)
        for name in ("daqp", "piqp"):
            found = new_solver(name, problem, soft=False).solve(qp)
            assert found.kkt < 1e-8
            assert qp.objective(found.z) + problem.constant(limits.start) == pytest.approx(cost, rel=1e-7)
            assert np.abs(found.z[: inputs.shape[1]] - inputs[0]).max() < 1e-7
        tensions = problem.tension_from_state @ limits.start + problem.rows[: limits.tension_margin.size] @ found.z
        room = tensions.reshape(HORIZON, -1) + limits.tension_margin
        assert (room[:, problem.side < 0] < 1e-9).sum() > 10

    def test_gives_way_upwards(self, steering):
        """Out of reach, slack raises the limit: by the same amount in both solvers, and it is the plan's own excess."""
        _, _, _, controller = steering
        problem, limits, hard = controller.statement(0.0, disturbed(steering, 0.03, 1.5))
        soft, n = relax(hard, HORIZON), hard.f.size
        found = {name: new_solver(name, problem, soft=True).solve(soft) for name in ("daqp", "piqp")}
        assert np.abs(found["piqp"].z - found["daqp"].z)[n:].max() < 1e-8
        rows = slice(0, limits.tension_margin.size)
        broken = hard.lower[n:][rows] - hard.A[rows] @ found["daqp"].z[:n]
        assert np.abs(broken.reshape(HORIZON, -1).max(axis=1) - found["daqp"].z[n:]).max() < 1e-8
        excess = broken.reshape(HORIZON, -1)[:, problem.side < 0]
        assert excess.max() > 1e-3
        plan = found["daqp"].z[:n].reshape(HORIZON, -1)
        newtons = (broken.reshape(HORIZON, -1) * problem.tension_scale).max()
        assert limits.shortfall(problem, plan) == pytest.approx(newtons, rel=1e-9)

    def test_is_kept_where_it_can_be(self):
        """A push that lifts tensions to 16 N without a limit; with one, what is left is what one period lets pass."""
        highest = {}
        for limit in (None, 14.0):
            dynamics, rest, linear = built(**({} if limit is None else {"force_max": limit}))
            push = tc.Push("P4_1_1", [5.0, 0.0, 0.0], 0.1, 0.2)
            controller = tc.MPC(linear, horizon=10, tension_min=0.5)
            run = tc.simulate(dynamics, rest, controller=controller, t_end=1.0, pushes=[push])
            highest[limit] = run.tensions[:, controller.problem.floored].max()
            assert run.relaxed.max() == 0
        assert highest[None] > 15.5
        assert highest[14.0] < 14.3

    def test_from_sensors(self, steering):
        """Whatever the filter believes of a tension, floor and limit of it stay as far apart as they are."""
        dynamics, rest, linear, _ = steering
        eyes = tc.sensors(dynamics.structure, lengths=1e-4, tensions=1e-2)
        controller = tc.OutputMPC(linear, eyes, horizon=HORIZON, tension_min=0.5)
        reading = Reading(eyes.of(rest) + np.random.default_rng(0).normal(0.0, 0.01, eyes.noise.size), rest.inputs)
        for k in range(3):
            controller.step(0.02 * k, reading)
        margin, problem = controller.limits(0.06, reading).tension_margin, controller.problem
        apart = (margin[:, :21] + margin[:, 21:]) * problem.tension_scale[:21]
        assert np.abs(apart - 13.0).max() < 1e-9
        assert np.abs(margin - problem.margin(rest.tensions, 0.5)).max() > 1e-5

    def test_as_c_source(self, steering, tmp_path):
        """The exported controller answers as Python does, where limits act and where they give way."""
        _, _, _, controller = steering
        tc.export_c(controller, tmp_path)
        compiled = Compiled(tmp_path / "controller.c", 21)
        for motion, gives_way in (((0.01, 0.1), False), ((0.03, 1.5), True)):
            controller.reset()
            compiled.reset()
            seen = disturbed(steering, *motion)
            wanted = controller.step(0.0, seen)
            outcome, u = compiled.step(flat(seen))
            assert outcome == gives_way
            assert np.abs(u - wanted).max() < 1e-8
            assert compiled.last.relaxed == pytest.approx(controller.records[-1].relaxed, abs=1e-7)


GANGS = {"top": {"t6_*": 1.0, "t6_1_1": 0.5}, "tilt": {"t5_1_1": 1.0, "t5_2_1": -0.7}}
PUSH = tc.Push("P4_1_1", [6.0, 0.0, 0.0], 0.1, 0.2)


class TestPower:
    """Force times speed stays below the share of power_max that the force has of its stall limit."""

    @pytest.mark.parametrize("law", LAWS)
    @pytest.mark.parametrize("gangs", [None, GANGS], ids=["alone", "gangs"])
    def test_kept_under_pushes(self, law, gangs):
        asked = {"power_max": 1.5, "force_max": 20.0, "gangs": gangs}
        scene, free = mast(law, **asked), mast(law, **asked | {"power_max": None})
        rest, most = tc.find_equilibrium(scene), {}
        for name, wanted in (("kept", scene), ("free", free)):
            dynamics = tc.build_dynamics(wanted)
            controller = tc.MPC(tc.linearize(dynamics, rest, outputs=()), horizon=HORIZON)
            run = tc.simulate(dynamics, rest, controller=controller, t_end=1.0, rate_max=0.5, pushes=[PUSH])
            demand, members = tc.actuator_demand(run, dynamics, pushes=[PUSH]), dynamics.members
            force = run.tensions[:, members.inputs]
            force = force if law == "k" else force * (1 + force / (2 * members.stiffness[members.inputs]))
            share = np.abs(force @ members.gearing.matrix.toarray()) / members.stall
            share = np.maximum(share, np.vstack([share[:1], share[:-1]]))
            power = np.maximum(np.abs(demand.power), np.vstack([0 * share[:1], np.abs(demand.power_after[:-1])]))
            most[name] = float((power / share).max())
        assert most["kept"] == pytest.approx(1.5, rel=1e-9)
        assert most["free"] > 3.0

    def test_speeds(self):
        """Of a gang one side pulls with all its tendons, the other does not push."""
        members = tc.build_dynamics(mast(power_max=2.0, force_max={"*": 10.0, "t5_2_1": 20.0}, gangs=GANGS)).members
        rates = dict(zip(members.gearing.labels, powered_rates(members), strict=True))
        assert rates["top"] == pytest.approx(2.0 / 25.0)
        assert rates["tilt"] == pytest.approx(2.0 / 14.0)
        assert rates["t7_1_1"] == pytest.approx(0.2)

    def test_without_a_stall_limit_of_every_tendon_there_is_no_bound(self):
        members = tc.build_dynamics(mast(power_max=2.0, force_max={"t6_*": 10.0, "t5_1_1": 10.0}, gangs=GANGS)).members
        rates = dict(zip(members.gearing.labels, powered_rates(members), strict=True))
        assert np.isfinite(rates["top"])
        assert np.isinf(rates["tilt"])
        assert np.isinf(rates["t7_1_1"])
