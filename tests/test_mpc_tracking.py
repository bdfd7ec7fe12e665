"""Weighted outputs that follow a signal: against dynamic programming, stage costs and cvxpy; on the nonlinear mast."""

from dataclasses import replace

import numpy as np
import pytest
from support import prism_scene, shell_scene, solved

import tensctl as tc
from tensctl.simulation import Measurement
from tensctl.synthesis.qp_cvxpy import reference_optimum
from tensctl.synthesis.qp_solvers import SOLVERS, new_solver
from tensctl.synthesis.signal import Courses

TIP = {"nodes:P4_1_1": 1e-3}
FAR = {"tension_min": 0.0, "rate_max": 1e6}  # limits that never act on deviations as small as these


@pytest.fixture(scope="module")
def prism():
    return solved(prism_scene(pins=["a*"]))


def seen(case, reach=0.0, speed=0.0):
    """What the controller is shown of a random disturbance of the equilibrium."""
    rest, rng = case[1], np.random.default_rng(3)
    manifold = rest.potential.manifold
    nodes = manifold.retract(rest.nodes, reach * rng.standard_normal(manifold.size))
    velocities = (manifold.tangent(nodes) @ (speed * rng.standard_normal(manifold.size))).reshape(-1, 3)
    return Measurement(nodes, velocities, rest.lengths, rest.tensions, rest.inputs)


def at_rest(rest, labels):
    """Outputs at an equilibrium, in total, by label."""
    structure = rest.structure
    axes = [f"{node}_{axis}" for node in structure.node_labels for axis in "xyz"]
    values = dict(zip(axes, rest.nodes.ravel(), strict=True))
    values |= {f"l_{t}": v for t, v in zip(structure.tendon_labels, rest.lengths, strict=True)}
    values |= {f"T_{t}": v for t, v in zip(structure.tendon_labels, rest.tensions, strict=True)}
    if "lean" in labels:
        values["lean"] = 0.5 * (values["b2_x"] + values["b3_x"])
    return np.array([values[label] for label in labels])


def wandering(case, outputs, horizon, size=1e-4):
    """A signal that jumps about at random until the horizon ends, and is held after it."""
    labels = tc.linearize(*case[:2], outputs=tuple(outputs)).outputs
    rest = at_rest(case[1], labels)
    steps = size * np.random.default_rng(0).standard_normal((horizon, len(labels)))
    return lambda t: rest + steps[min(round(t / DT), horizon) - 1]


OUTPUTS = {"nodes:b1": 2e-3, "tensions:side*": 0.3, tc.Mix({"lean": {"b2_x": 0.5, "b3_x": 0.5}}): 1e-3}
HORIZON, INPUT, DT = 6, 1.0, 0.02


class Stated:
    """The problem of a prism stated again from its linear model: z = (x, u), outputs over sizes, targets at rest."""

    def __init__(self, case, energy, shown):
        linear = tc.linearize(*case[:2], outputs=tuple(OUTPUTS)).flexible
        sampled = linear.sample(DT, method="ramp")
        self.A, self.B, (self.nx, self.nu) = sampled.A, sampled.B, linear.B.shape
        self.start = np.concatenate([linear.state_of(shown.nodes, shown.velocities), np.zeros(self.nu)])
        sizes = np.concatenate([np.full(3, 2e-3), np.full(3, 0.3), [1e-3]])
        rows = np.hstack([linear.C, linear.D]) / sizes[:, None]
        told, rest = wandering(case, OUTPUTS, HORIZON), at_rest(case[1], linear.outputs)
        wanted = [(told(k * DT) - rest) / sizes for k in range(1, HORIZON + 1)]
        still = np.vstack([-np.linalg.solve(linear.A, linear.B), np.eye(self.nu)])
        targets = [still @ np.linalg.lstsq(rows @ still, r, rcond=1e-9)[0] for r in wanted]
        # |L z - l|^2 dt of each stage, the inputs u among z; all tendons are alike, so all inputs cost the same.
        weights = np.concatenate([np.full(self.nx, energy), np.full(self.nu, 100.0 * INPUT)])
        self.left = np.vstack([rows, np.diag(np.sqrt(weights))])
        self.right = [np.concatenate([r, np.sqrt(weights) * z]) for r, z in zip(wanted, targets, strict=True)]

    def plan(self, stages):
        """Optimal inputs of the horizon, by dynamic programming from a far end; the last wish is held."""
        S, s, laws = np.zeros((len(self.A), len(self.A))), np.zeros(len(self.A)), []
        Q = DT * self.left.T @ self.left
        for k in reversed(range(stages)):
            S, s = S + Q, s - DT * self.left.T @ self.right[min(k, HORIZON - 1)]
            back = np.linalg.solve(self.B.T @ S @ self.B, np.column_stack([self.B.T @ S @ self.A, self.B.T @ s]))
            K, ahead = back[:, :-1], back[:, -1]
            laws.append((K, ahead))
            S, s = self.A.T @ S @ (self.A - self.B @ K), (self.A - self.B @ K).T @ s
        found, z = [], self.start
        for K, ahead in laws[: -HORIZON - 1 : -1]:
            found.append(-K @ z - ahead)
            z = self.A @ z + self.B @ found[-1]
        return np.array(found)

    def cost(self, plan, P, p):
        """Stage by stage, with the quadratic form of P and the slope p in place of the last stage's own."""
        total, z = 0.0, self.start
        for k, v in enumerate(plan):
            z = self.A @ z + self.B @ v
            miss = self.left @ z - self.right[k]
            if k == len(plan) - 1:
                total += 0.5 * z @ P @ z + p @ z
                miss = miss[-self.nu :]
            total += 0.5 * DT * miss @ miss
        return total


def following(case, outputs, energy=1.0, **options):
    options = {"horizon": HORIZON} | FAR | options
    signal = wandering(case, outputs, options["horizon"], options.pop("size", 1e-4))
    return tc.MPC(case[2], weights=tc.Weights(energy, INPUT, outputs), signal=signal, **options)


class TestCost:
    def test_without_outputs_nothing_is_added(self, mast):
        problem = tc.MPC(mast[2], horizon=3).problem
        assert problem.following is None
        assert (problem.Q[:42, :42] == 0.02 * np.eye(42)).all()
        assert not problem.Q[42:].any()

    @pytest.mark.parametrize("energy", [1.0, 0.0], ids=["beside energy", "instead of energy"])
    def test_plan_is_the_optimal_tracking(self, prism, energy):
        """Against dynamic programming over 5000 periods; the horizon has 6 and knows the rest from its last weight."""
        shown = seen(prism, 1e-4, 1e-3)
        best = Stated(prism, energy, shown).plan(5000)
        plan = following(prism, OUTPUTS, energy).solve(0.0, shown)
        assert np.abs(plan - best).max() < 1e-11
        assert np.abs(plan).max() > 1e-3

    def test_gradient_is_that_of_the_stages(self, prism, rng):
        """H z + f against central differences of the cost written out, and the constant that condensing drops."""
        shown = seen(prism, 1e-4, 1e-3)
        controller, stated = following(prism, OUTPUTS), Stated(prism, 1.0, shown)
        problem, limits, qp = controller.statement(0.0, shown)
        p = problem.following.last @ limits.wanted[-1]
        plan, way = (0.01 * rng.standard_normal((HORIZON, stated.nu)) for _ in range(2))
        slope = (stated.cost(plan + way, problem.P, p) - stated.cost(plan - way, problem.P, p)) / 2
        assert slope == pytest.approx((qp.H @ plan.ravel() + qp.f) @ way.ravel(), rel=1e-9)

    def test_cost_is_the_same_in_cvxpy_with_acting_limits_for_all_solvers(self, mast):
        controller = following(mast, TIP, size=0.005, tension_min=2.0, rate_max=0.5)
        problem, limits, qp = controller.statement(0.0, seen(mast))
        cost, inputs = reference_optimum(problem, limits)
        for name in SOLVERS:
            found = new_solver(name, problem, soft=False).solve(qp)
            ours = qp.objective(found.z) + problem.constant(limits.start, limits.wanted)
            assert abs(ours - cost) < 1e-7 * abs(cost)
            assert np.abs(found.z[:21] - inputs[0]).max() < 1e-7
            assert (np.abs(found.y) > 1e-6).sum() > 20, "few limits act, so little is proven"

    @pytest.mark.parametrize("outputs", [TIP, {"lengths": 1e-3}], ids=["reachable", "unreachable"])
    def test_a_constant_signal_is_met_as_far_as_rest_lengths_go(self, mast, rng, outputs):
        """From the rest that it asks for no plan moves away, and no rest is nearer."""
        controller = following(mast, outputs)
        problem, follows = controller.problem, controller.problem.following
        linear, sizes = follows.weighed.linear, follows.weighed.sizes
        r = 0.002 * rng.standard_normal(sizes.size)
        goal = follows.rest @ (r / sizes)
        limits = controller.limits(0.0, seen(mast))
        qp = replace(limits, start=goal, wanted=np.tile(r / sizes, (HORIZON, 1))).assemble(problem)
        assert np.abs(np.linalg.solve(qp.H, -qp.f).reshape(HORIZON, -1) - goal[-21:]).max() < 1e-9
        gain = linear.D - linear.C @ np.linalg.solve(linear.A, linear.B)
        missed = linear.C @ goal[:-21] + linear.D @ goal[-21:] - r
        least = gain @ np.linalg.lstsq(gain, r, rcond=1e-9)[0] - r
        assert np.abs(missed - least).max() < 1e-11
        assert (np.linalg.norm(least) > 1e-4) == (outputs is not TIP)

    def test_rest_lengths_by_size(self, mast):
        sizes = {"*": 0.1, "t5_*": 0.02}
        weights = tc.Weights(rest_lengths=sizes)
        expected = [0.02 if label.startswith("u_t5_") else 0.1 for label in mast[2].inputs]
        assert (np.diag(weights.of_inputs(mast[2])) == 1 / np.square(expected)).all()
        with pytest.raises(tc.SynthesisError, match="names no size for t"):
            tc.MPC(mast[2], horizon=2, weights=tc.Weights(rest_lengths={"t5_*": 0.02}))


class TestClosedLoop:
    """On the full nonlinear mast."""

    def test_a_reachable_place_is_reached(self, mast):
        dynamics, rest, linear = mast
        tip = rest.structure.node_labels.index("P4_1_1")
        goal = rest.nodes[tip] + [0.004, -0.003, 0.005]
        controller = tc.MPC(linear, horizon=10, weights=tc.Weights(outputs=TIP), signal=lambda t: goal)
        run = tc.simulate(dynamics, rest, controller=controller, t_end=1.5)
        missed = np.linalg.norm(run.nodes[:, tip] - goal, axis=1)
        assert missed[0] > 7e-3
        assert missed[-1] < 1e-5

    def test_preview_beats_none(self, mast):
        """The tip swings by 2 cm at 1 Hz: known ahead, and held at what is wanted now."""
        dynamics, rest, linear = mast
        tip = rest.structure.node_labels.index("P4_1_1")

        def swing(t):
            return rest.nodes[tip] + [0.02 * np.sin(2 * np.pi * t), 0, 0]

        worst = {}
        for preview in (True, False):
            controller = tc.MPC(linear, horizon=10, weights=tc.Weights(outputs=TIP), signal=swing, preview=preview)
            run = tc.simulate(dynamics, rest, controller=controller, t_end=2.0)
            assert {record.status for record in controller.records} == {"dual"}
            missed = run.nodes[:, tip] - [swing(t) for t in run.time]
            worst[preview] = np.linalg.norm(missed, axis=1)[50:].max()
        assert worst[True] < 2e-4
        assert worst[False] > 20 * worst[True]

    def test_on_a_path_the_signal_that_it_is_changes_nothing(self, mast):
        """Outputs wanted where the path has them anyway: the same commands as without a signal."""
        _, rest, linear = mast
        scene = shell_scene(pins=["P1_*_1"], target={"height_scale": 1.02, "duration": 0.4})
        path = tc.plan_shape(scene, start=rest)
        tip = rest.structure.node_labels.index("P4_1_1")
        options = {"horizon": 4, "weights": tc.Weights(outputs=TIP), "path": path}
        with_signal = tc.MPC(linear, signal=lambda t: path.nodes_at(t)[tip], **options)
        without = tc.MPC(linear, **options)
        shown = seen(mast, 0.001, 0.01)
        for t in (0.0, 0.2, 0.6):
            difference = with_signal.step(t, shown) - without.step(t, shown)
            assert np.abs(difference).max() < 1e-10


class TestSignal:
    def test_a_table_is_a_function(self, mast):
        rest = mast[1].nodes[mast[1].structure.node_labels.index("P4_1_1")]
        times, values = np.array([0.0, 0.1]), rest + np.array([[0, 0, 0], [0.01, 0, 0]])
        options = {"horizon": 10, "weights": tc.Weights(outputs=TIP)}
        table = tc.MPC(mast[2], signal=(times, values), **options)
        function = tc.MPC(mast[2], signal=lambda t: rest + np.array([0.1 * min(t, 0.1), 0, 0]), **options)
        assert np.abs(table.step(0.03, seen(mast)) - function.step(0.03, seen(mast))).max() < 1e-12

    def test_changes_count_from_the_path(self, mast):
        """A course of one coordinate, the others as they are: the same as all of them in total."""
        rest = mast[1].nodes[mast[1].structure.node_labels.index("P4_1_1")]
        options = {"horizon": 10, "weights": tc.Weights(outputs=TIP)}
        course = Courses({"P4_1_1_y": ([0.0, 0.1], [0.0, 0.01])})
        changes = tc.MPC(mast[2], signal=course, **options)
        total = tc.MPC(mast[2], signal=([0.0, 0.1], rest + np.array([[0, 0, 0], [0, 0.01, 0]])), **options)
        asked = changes.step(0.03, seen(mast))
        assert np.abs(asked - total.step(0.03, seen(mast))).max() < 1e-12
        assert np.abs(asked).max() > 1e-3

    @pytest.mark.parametrize(
        ("weights", "signal", "sentence"),
        [
            (TIP, Courses({"P4_2_1_x": ([0.0], [0.1])}), "P4_2_1_x has a course, but no weight"),
            (TIP, Courses({"P4_1_1_x": ([0.0], [0.1, 0.2])}), r"of shape \(2,\)"),
            ({}, lambda t: 0.0, "a signal is given, but no output"),
            (TIP, lambda t: [1.0, 2.0], r"signal\(0\) is of shape \(2,\).*P4_1_1_x, P4_1_1_y, P4_1_1_z"),
            (TIP, lambda t: [1.0, 2.0, np.nan], "not all finite"),
            (TIP, ([0.0, 0.0], np.zeros((2, 3))), "do not ascend"),
            (TIP, ([0.0, 1.0], np.zeros((3, 3))), r"table is of shape \(3, 3\)"),
            ({"nodes:P4_1_1": 0.0}, None, 'weights.outputs."nodes:P4_1_1" is 0'),
        ],
    )
    def test_refused(self, mast, weights, signal, sentence):
        with pytest.raises(tc.SynthesisError, match=sentence):
            tc.MPC(mast[2], horizon=2, weights=tc.Weights(outputs=weights), signal=signal)

    def test_what_no_output_shows_needs_energy(self, mast):
        """The mean of a ring shows symmetric modes only: without energy the others would swing for ever."""
        ring = tc.Mix({"mean": {f"l_t6_{i}_1": 1.0 for i in (1, 2, 3)}})
        tc.MPC(mast[2], horizon=2, weights=tc.Weights(outputs={ring: 1e-3}))
        with pytest.raises(tc.SynthesisError, match="do not show every mode"):
            tc.MPC(mast[2], horizon=2, weights=tc.Weights(energy=0.0, outputs={ring: 1e-3}))

    def test_outputs_that_count_too_little_need_smaller_sizes(self, mast):
        """Places of all nodes show every mode, however large their sizes: these are blamed, and smaller ones do."""
        tc.MPC(mast[2], horizon=2, weights=tc.Weights(energy=0.0, outputs={"nodes": 1.0}))
        with pytest.raises(tc.SynthesisError, match="count too little beside what rest lengths cost, so lower the si"):
            tc.MPC(mast[2], horizon=2, weights=tc.Weights(energy=0.0, outputs={"nodes": 1e8}))

    def test_outputs_that_show_too_little_are_blamed_at_any_size(self, mast):
        """One coordinate of one node does not show every mode, and no size changes that."""
        for size in (1e-3, 1e8):
            with pytest.raises(tc.SynthesisError, match="do not show every mode, so add outputs"):
                tc.MPC(mast[2], horizon=2, weights=tc.Weights(energy=0.0, outputs={"nodes:P4_1_1_z": size}))

    def test_weights_too_far_apart_are_no_fault_of_a_mode(self, mast):
        """All modes are driven and seen; a millionth of a millionth of a metre is beyond double precision."""
        for energy in (0.0, 1.0):
            with pytest.raises(tc.SynthesisError, match="weights of states and inputs are too far apart"):
                tc.MPC(mast[2], horizon=2, weights=tc.Weights(energy=energy, outputs={"nodes": 1e-12}))


BEYOND = {
    "function": lambda rest, far: lambda t: rest + far * (t >= 0.0),
    "later": lambda rest, far: lambda t: rest + far * (t > 0.1),
    "table": lambda rest, far: ([0.0, 1.0, 9.0], [rest, rest, rest + far]),
    "courses": lambda rest, far: Courses({"P4_1_1_z": ([0.0, 9.0], [0.0, far])}),
}


@pytest.mark.parametrize("feedback", ["state", "outputs"])
@pytest.mark.parametrize("kind", BEYOND)
def test_a_signal_beyond_all_lengths(mast, kind, feedback):
    """Refused when it is given, and that of a function when it comes; just within the bound there is an answer."""
    dynamics, rest, linear = mast
    height = rest.nodes[dynamics.structure.node_labels.index("P4_1_1"), 2]
    weights, size = tc.Weights(outputs={"nodes:P4_1_1_z": 1e-3}), 1e-3
    still = tc.Measurement(rest.nodes, 0 * rest.nodes, rest.lengths, rest.tensions, rest.inputs)
    eyes = tc.sensors(dynamics.structure, nodes=1e-3)

    def stepped(far):
        common = {"horizon": 2, "weights": weights, "signal": BEYOND[kind](height, far)}
        if feedback == "state":
            controller, seen = tc.MPC(linear, **common), still
        else:
            controller = tc.OutputMPC(linear, eyes, **common)
            seen = controller.sensors.read(still, 0)
        controller.step(0.0, seen)
        controller.step(0.2, seen)
        return controller.records

    for far in (1.001e6 * size, 1e12, -1e30):
        with pytest.raises(tc.SynthesisError, match=r"^the signal wants \S+ of P4_1_1_z at \S+ s, .* a larger size\.$"):
            stepped(far)
    assert {record.status for record in stepped(0.99e6 * size)} <= {"dual", "primal", "primal bounded"}
