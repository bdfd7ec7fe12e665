"""The nonlinear model as python-control has it: its Jacobians, its motion, its labels."""

import control as ct
import numpy as np
import pytest
from linear_support import SCENES, STEPS, Neighbour, directions
from support import shell_scene, solved, taylor_order

import tensctl as tc

OUTPUTS = ("nodes", "velocities", "lengths", "tensions")
GANGED = shell_scene(pins=["P1_*_1"], actuators={"gangs": {"top": {"t6_*": 1.0, "t6_1_1": -0.5}}})
FEW = ["free damped", "pinned damped EA", "weight", "joints", "guides, damped EA", "plane, joint, guide, cable",
       "three rods in a joint, EA, damped, weight", "gang"]  # fmt: skip


@pytest.fixture(scope="module", params=FEW)
def case(request):
    scene = GANGED if request.param == "gang" else SCENES[request.param]
    dynamics, rest, linear = solved(scene, OUTPUTS)
    return (dynamics, rest, linear), tc.iosystem(dynamics, rest, outputs=OUTPUTS)


class TestJacobians:
    def test_equal_the_linear_model_at_rest(self, case):
        (_, _, linear), system = case
        found = ct.linearize(system, system.x_eq, system.u_eq)
        for name in "ABCD":
            wanted = getattr(linear, name)
            assert np.abs(getattr(found, name) - wanted).max() < 1e-12 * np.abs(wanted).max()
        assert np.abs(system.updfcn(0, system.x_eq, system.u_eq, {})).max() < 1e-9

    def test_taylor_at_rest(self, case, rng):
        (_, _, linear), system = case
        x, u = directions(linear, rng)
        still = system.outfcn(0, system.x_eq, system.u_eq, {})

        def rate(h):
            return system.updfcn(0, h * x, system.u_eq + h * u, {}) - h * (linear.A @ x + linear.B @ u)

        def shown(h):
            return system.outfcn(0, h * x, system.u_eq + h * u, {}) - still - h * (linear.C @ x + linear.D @ u)

        assert 1.9 < taylor_order(rate, STEPS) < 2.2
        assert 1.9 < taylor_order(shown, STEPS) < 2.2

    def test_taylor_away_from_rest(self, case, rng):
        """Exact Jacobians where the structure is bent and moves."""
        (_, _, linear), system = case
        x0 = 0.1 * directions(linear, rng)[0]
        x, u = directions(linear, rng)
        here = ct.linearize(system, x0, system.u_eq)
        at = system.updfcn(0, x0, system.u_eq, {}), system.outfcn(0, x0, system.u_eq, {})

        def left(h):
            rate = system.updfcn(0, x0 + h * x, system.u_eq + h * u, {}) - at[0] - h * (here.A @ x + here.B @ u)
            shown = system.outfcn(0, x0 + h * x, system.u_eq + h * u, {}) - at[1] - h * (here.C @ x + here.D @ u)
            return np.concatenate([rate, shown])

        assert 1.9 < taylor_order(left, STEPS / 4) < 2.2


def test_is_the_model_that_the_chart_measures(case, rng):
    """dx/dt at a finite amplitude is the rate of `state_of` along the nonlinear motion, put there by other means."""
    solution, system = case
    near, linear = Neighbour(solution), solution[2]
    nodes, velocities = near.placed(0.1 * directions(linear, rng)[0])
    x = linear.state_of(nodes, velocities)
    free = solution[0].structure.free
    shown = system.outfcn(0, x, system.u_eq, {})
    assert np.abs(shown[: free.sum()] - nodes[free]).max() < 1e-9
    assert np.abs(shown[free.sum() : 2 * free.sum()] - velocities[free]).max() < 1e-7
    rate = near.rate(0.1 * directions(linear, np.random.default_rng(5))[0], system.u_eq)
    at = linear.state_of(*near.placed(0.1 * directions(linear, np.random.default_rng(5))[0]))
    assert np.abs(system.updfcn(0, at, system.u_eq, {}) - rate).max() < 1e-5 * np.abs(rate).max()


@pytest.mark.parametrize("name", ["pinned damped EA", "plane, joint, guide, cable"])
def test_moves_as_simulate_does(name, rng):
    """A short motion from a bent start, by python-control's integrator and by the project's own."""
    dynamics, rest, _ = solved(SCENES[name])
    system = tc.iosystem(dynamics, rest, outputs=("nodes",))
    near = Neighbour((dynamics, rest, system.linear))
    nodes, velocities = near.placed(0.4 * directions(system.linear, rng)[0])
    times = np.linspace(0, 0.3, 7)
    u = np.repeat(system.u_eq[:, None], times.size, axis=1)
    found = ct.input_output_response(
        system, times, u, system.state_of(nodes, velocities), solve_ivp_method="DOP853",
        solve_ivp_kwargs={"rtol": 1e-10, "atol": 1e-11},
    )  # fmt: skip
    run = tc.simulate(dynamics, (nodes, velocities), timepts=times, tol=1e-11)
    free = dynamics.structure.free
    moved = run.nodes[:, free]
    assert np.abs(moved[-1] - moved[0]).max() > 0.01
    assert np.abs(found.outputs.T - moved).max() < 1e-8


class TestLabels:
    def test_are_those_of_the_state_space(self):
        dynamics, rest, linear = solved(SCENES["pinned"])
        system = tc.iosystem(dynamics, rest)
        wanted = linear.to_statespace()
        found = ct.linearize(system, system.x_eq, system.u_eq, copy_names=True)
        for kind in ("input_labels", "output_labels", "state_labels"):
            assert getattr(system, kind) == getattr(found, kind) == getattr(wanted, kind)

    def test_chosen_and_mixed_outputs(self):
        dynamics, rest, _ = solved(SCENES["pinned"])
        mix = tc.Mix({"height": {f"P4_{i}_1_z": 1 / 3 for i in (1, 2, 3)}})
        system = tc.iosystem(dynamics, rest, outputs=("tensions:t5_*", mix))
        shown = system.outfcn(0, system.x_eq, system.u_eq, {})
        top = [dynamics.structure.node_labels.index(f"P4_{i}_1") for i in (1, 2, 3)]
        assert system.output_labels == ["T_t5_1_1", "T_t5_2_1", "T_t5_3_1", "height"]
        assert shown[-1] == pytest.approx(rest.nodes[top, 2].mean(), abs=1e-12)

    def test_operating_point(self):
        dynamics, rest, linear = solved(SCENES["pinned"])
        system = tc.iosystem(dynamics, rest)
        point = ct.OperatingPoint(system.x_eq, system.u_eq)
        assert np.abs(ct.linearize(system, point).A - linear.A).max() < 1e-12 * np.abs(linear.A).max()
