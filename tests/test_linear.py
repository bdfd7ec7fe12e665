"""The linear model is the derivative of the nonlinear one, in coordinates whose square is the energy."""

import inspect

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from linear_support import KITE, SCENES, STEPS, Neighbour, directions
from scipy.optimize import linear_sum_assignment
from support import reference_prism, replaced, rotation, shell_scene, solved, taylor_order

import tensctl as tc
from tensctl.linear import sample_ramped


@pytest.fixture(scope="module", params=SCENES)
def case(request):
    return solved(SCENES[request.param], outputs=("nodes", "lengths", "tensions"))


class TestTaylor:
    @pytest.mark.parametrize("part", ["A", "B", "both"])
    def test_motion(self, case, rng, part):
        near, linear = Neighbour(case), case[2]
        x, u = directions(linear, rng)
        x, u = x * (part != "B"), u * (part != "A")

        def left(h):
            return near.rate(h * x, h * u) - h * (linear.A @ x + linear.B @ u)

        assert np.abs(near.rate(0 * x, 0 * u)).max() < 1e-8
        if part == "B" and case[0].members.law == "k":
            size = np.abs(linear.B @ u).max()
            assert np.abs(left(1e-2)).max() < 1e-6 * 1e-2 * size, "forces of taut tendons are linear in u"
        else:
            assert 1.9 < taylor_order(left, STEPS) < 2.2

    def test_outputs(self, case, rng):
        near, linear = Neighbour(case), case[2]
        x, u = directions(linear, rng)
        still = near.outputs(0 * x, 0 * u)

        def left(h):
            return near.outputs(h * x, h * u) - still - h * (linear.C @ x + linear.D @ u)

        for rows in self.kinds(linear):
            assert 1.9 < taylor_order(lambda h, rows=rows: left(h)[rows], STEPS) < 2.2

    def kinds(self, linear):
        first = np.array([label.split("_")[0] for label in linear.outputs])
        return [first == "l", first == "T", ~np.isin(first, ["l", "T"])]

    def test_state_of_undoes_placing(self, case, rng):
        near, linear = Neighbour(case), case[2]
        x, _ = directions(linear, rng)
        order = taylor_order(lambda h: linear.state_of(*near.placed(h * x)) - h * x, STEPS)
        rounding = 1e-9 * np.sqrt(near.mass.max())
        exact = np.abs(linear.state_of(*near.placed(1e-2 * x)) - 1e-2 * x).max() < rounding
        assert exact or order > 1.9


def test_poles_are_the_frequencies(case):
    dynamics, rest, linear = case
    if dynamics.damped:
        assert np.linalg.eigvals(linear.flexible.A).real.max() < 0
        return
    flexible = rest.omega2[rest.spectrum.rigid_count :]
    wanted = np.sort(np.concatenate([np.sqrt(flexible)] * 2))
    poles = np.linalg.eigvals(linear.flexible.A)
    assert np.abs(np.sort(np.abs(poles.imag)) - wanted).max() < 1e-12 * wanted.max()
    assert np.abs(poles.real).max() < 1e-12 * wanted.max()


def test_state_is_the_energy(case, rng):
    """|x|^2/2 = kinetic + potential energy - that at rest; what is left falls with order 3."""
    near, (dynamics, rest, linear) = Neighbour(case), case
    x, _ = directions(linear, rng)
    kept = np.array([name[0] != "r" for name in linear.states])
    x = x * kept
    rods, mass = dynamics.structure.rods, dynamics.members.mass

    def left(h):
        nodes, velocities = near.placed(h * x)
        a, b = velocities[rods[:, 0]], velocities[rods[:, 1]]
        kinetic = (mass / 6 * (a * a + a * b + b * b).sum(axis=1)).sum()
        return kinetic + rest.potential.at(nodes).energy - rest.energy - h**2 / 2 * x @ x

    assert taylor_order(left, np.array([0.2, 0.1, 0.05, 0.025])) > 2.8


def test_damping_takes_energy(case):
    """x'(A + A')x = -2 (energy lost per second) is never positive, and zero without damping."""
    dynamics, _, linear = case
    power = np.linalg.eigvalsh(linear.flexible.A + linear.flexible.A.T)
    size = np.abs(linear.A).max()
    assert power.max() < 1e-13 * size
    assert (power.min() < -1e-3) if dynamics.damped else (power.min() > -1e-13 * size)


class TestShape:
    def test_free_shell_has_sixty_states(self, free):
        _, _, linear = free
        assert linear.A.shape == (60, 60)
        assert linear.flexible.A.shape == (48, 48)
        assert [mode.kind for mode in linear.modes] == ["rigid-body"] * 6 + ["flexible"] * 24

    def test_pinned_mast_has_forty_two(self, mast):
        _, _, linear = mast
        assert linear.A.shape == (42, 42)
        assert linear.B.shape == (42, 21)

    def test_rigid_body_modes_stand_first_and_alone(self, free):
        _, _, linear = free
        assert np.abs(linear.A[:12, 12:]).max() < 1e-13
        assert np.abs(linear.A[12:, :12]).max() < 1e-13
        assert np.abs(linear.B[:12]).max() < 1e-12 * np.abs(linear.B).max()
        assert (linear.A[12:, 12:] == linear.flexible.A).all()

    def test_no_length_constraint_leaves_a_zero(self, mast):
        _, rest, linear = mast
        assert np.abs(np.linalg.eigvals(linear.A)).min() == pytest.approx(np.sqrt(rest.smallest), rel=1e-10)

    def test_verify(self, case):
        case[2].verify(1e-12)

    def test_verify_tells_wrong_modes(self, free):
        _, _, linear = free
        wrong = tuple(replaced(mode, omega2=mode.omega2 * (1 + 1e-6)) for mode in linear.modes)
        with pytest.raises(tc.LinearizationError, match="the modes miss the Hessian"):
            replaced(linear, modes=wrong).verify()


class TestStateSpace:
    def test_labels(self, mast):
        _, _, linear = mast
        system = linear.to_statespace()
        assert system.input_labels[:2] == ["u_t1_1_1", "u_t3_1_1"]
        assert system.output_labels[0] == "P2_1_1_x"
        assert system.output_labels[-1] == "T_t8_3_1"
        assert system.state_labels == list(linear.states)
        assert len(set(system.state_labels)) == 42
        assert (system.A == linear.A).all()
        assert (system.D == linear.D).all()

    def test_no_dots(self):
        network = {
            "kind": "network",
            "nodes": {"o": [0, 0, 0], "e": [1, 0, 0], "w": [3, 0, 0]},
            "rods": {"rod": ["o", "e"]},
            "tendons": {"tie": ["e", "w"]},
            "pins": ["o", "w"],
        }
        structure = tc.build_structure(tc.Scene(structure=network))
        dotted = replaced(structure, node_labels=("o.1", "e.1", "w.1"), tendon_labels=("tie.1",))
        dynamics, rest, _ = solved(tc.Scene(structure=network))
        members = replaced(dynamics.members, gearing=replaced(dynamics.members.gearing, labels=("tie.1",)))
        potential = replaced(rest.potential, structure=dotted, members=members)
        linear = tc.linearize(replaced(dynamics, potential=potential), replaced(rest, potential=potential))
        system = linear.to_statespace()
        assert system.input_labels == ["u_tie_1"]
        assert system.output_labels == ["e_1_x", "e_1_y", "e_1_z", "T_tie_1"]

    def test_outputs_in_the_order_asked(self, mast):
        dynamics, rest, linear = mast
        turned = tc.linearize(dynamics, rest, outputs=("tensions", "nodes"))
        assert turned.outputs == linear.outputs[-24:] + linear.outputs[:-24]
        assert tc.linearize(dynamics, rest, outputs=()).C.shape == (0, 42)


@pytest.fixture(scope="module", params=["shell", "plane", "turning about a pin"])
def dragged(request):
    drag = {"coefficient": 0.3}
    scene = {
        "shell": shell_scene(drag=drag, rods={"mass": {"*": 1.0, "r1_*": 2.5}}),
        "plane": tc.Scene(structure=KITE, drag=drag),
        "turning about a pin": shell_scene(drag=drag, pins=["P1_1_1"]),
    }[request.param]
    return solved(scene)


class TestDragOnAFreeStructure:
    """Drag couples the rates of rigid-body motion to the modes: the flexible model keeps these rates."""

    def test_taylor(self, dragged, rng):
        """The flexible states of the nonlinear structure in its own frame, at any rate of rigid-body motion."""
        near, flexible = Neighbour(dragged), dragged[2].flexible
        x = directions(near.linear, rng)[0]
        u = 0.1 * rng.standard_normal(near.linear.B.shape[1])
        count = len(near.linear.modes) - len(flexible.modes)
        assert len(flexible.drifting) == count > 0

        def left(h):
            rate = near.rate(h * x, h * u, flexible)
            return rate - flexible.A @ flexible.state_of(*near.placed(h * x)) - h * (flexible.B @ u)

        assert 1.9 < taylor_order(left, STEPS) < 2.2

    def test_no_pole_is_lost(self, dragged):
        """The poles are those of the whole model but the zeros of rigid-body positions, which nothing depends on."""
        linear, flexible = dragged[2], dragged[2].flexible
        kept = np.array([not name.startswith("rq") for name in linear.states])
        assert not linear.A[np.ix_(kept, ~kept)].any()
        wanted, found = np.linalg.eigvals(linear.A[np.ix_(kept, kept)]), np.linalg.eigvals(flexible.A)
        apart = np.abs(wanted[:, None] - found)  # a sorted order of conjugate pairs is decided by rounding
        assert wanted.size == found.size
        assert apart[linear_sum_assignment(apart)].max() < 1e-9
        without = len(flexible.modes) * 2
        assert flexible.states[without:] == tuple(name for name in linear.states if name.startswith("rv"))
        assert np.abs(flexible.A[:without, without:]).max() > 1e-3, "the coupling is there"

    def test_outputs_follow_the_drift(self, dragged, rng):
        """Lengths and tensions are those of the whole model, whose rigid-body positions they do not see."""
        linear, flexible = (model.showing(("lengths", "tensions")) for model in (dragged[2], dragged[2].flexible))
        moving = [linear.states.index(name) for name in flexible.states]
        assert np.abs(linear.C[:, moving] - flexible.C).max() < 1e-12 * np.abs(linear.C).max()

    def test_control_takes_it(self, dragged):
        controller = tc.lqr(dragged[2])
        controller.verify()
        assert tc.controllability(dragged[2].flexible).controllable_modes

    def test_without_drag_nothing_drifts(self, free):
        assert free[2].flexible.drifting == ()


class TestCoMovingFrame:
    def carried(self, nodes, velocities, rng):
        """The same motion seen after a rigid motion, with a rigid velocity on top."""
        Q, shift, drift, spin = rotation(rng), *rng.standard_normal((3, 3))
        moved = nodes @ Q.T + shift
        return moved, velocities @ Q.T + drift + np.cross(spin, moved - moved.mean(axis=0))

    @pytest.mark.parametrize("name", ["free", "free EA", "prism, two actuators"])
    def test_rigid_motion_changes_no_flexible_state(self, name, rng):
        near = Neighbour(solved(SCENES[name]))
        flexible = near.linear.flexible
        nodes, velocities = near.placed(0.3 * directions(near.linear, rng)[0])
        here = flexible.state_of(nodes, velocities)
        assert np.linalg.norm(here) > 0.05
        for _ in range(5):
            there = flexible.state_of(*self.carried(nodes, velocities, rng))
            assert np.abs(there - here).max() < 1e-12 * 20

    def test_rigid_motion_is_no_state(self, free, rng):
        _, rest, linear = free
        moved = self.carried(rest.nodes, np.zeros_like(rest.nodes), rng)
        assert np.abs(linear.flexible.state_of(*moved)).max() < 1e-12

    def test_flexible_states_agree_with_the_world_to_first_order(self, free, rng):
        """A flexible mode has no rigid-body part, so both frames see the same up to second order."""
        near = Neighbour(free)
        x = directions(near.linear, rng)[0] * np.repeat([0, 1], [12, 48])

        def left(h):
            state = near.placed(h * x)
            return near.linear.flexible.state_of(*state) - near.linear.state_of(*state)[12:]

        assert taylor_order(left, STEPS) > 1.9

    def along_rods(self, structure, nodes):
        """Gauss points of every rod, (rods, 3, 3); with weights 5/18, 8/18, 5/18 exact for products of two."""
        ends, place = nodes[structure.rods], 0.5 + np.array([-0.5, 0, 0.5]) * np.sqrt(0.6)
        return ends[:, None, 0] + place[:, None] * (ends[:, None, 1] - ends[:, None, 0])

    def test_fits_the_distributed_mass(self, rng):
        """Seen from its frame, the mass has no momentum, and no turn would bring it nearer to the reference."""
        scene = shell_scene(rods={"mass": {"*": 1.0, "r2_*": 3.0}})
        near = Neighbour(solved(scene))
        structure, reference = near.dynamics.structure, near.rest.nodes
        weight = near.mass[:, None] * np.array([5, 8, 5]) / 18
        nodes, velocities = self.carried(*near.placed(0.5 * directions(near.linear, rng)[0]), rng)
        frame = near.linear.frame(nodes, velocities)
        seen = self.along_rods(structure, frame.nodes(nodes))
        rate = self.along_rods(structure, frame.velocities(nodes, velocities))
        wanted = self.along_rods(structure, reference)
        centre = np.einsum("rg,rgi->i", weight, wanted) / weight.sum()
        assert np.abs(np.einsum("rg,rgi->i", weight, seen) / weight.sum() - centre).max() < 1e-13
        assert np.abs(np.einsum("rg,rgi->i", weight, rate)).max() < 1e-12
        assert np.abs(np.einsum("rg,rgi->i", weight, np.cross(seen - centre, rate))).max() < 1e-12
        assert np.abs(np.einsum("rg,rgi->i", weight, np.cross(seen - centre, wanted - centre))).max() < 1e-12
        assert np.linalg.det(frame.rotation) == pytest.approx(1)

    def test_pinned_structure_has_none(self, mast):
        _, rest, linear = mast
        assert linear.frame(rest.nodes, rest.nodes) is None


class TestSampling:
    @pytest.mark.parametrize("dt", [0.005, 0.05, 0.3])
    def test_equals_fine_integration(self, mast, rng, dt):
        _, _, linear = mast
        sampled = sample_ramped(linear.A, linear.B, dt)
        x0, (u0, u1) = rng.standard_normal(42), rng.standard_normal((2, 21))

        def rate(t, x):
            return linear.A @ x + linear.B @ (u0 + t / dt * (u1 - u0))

        fine = scipy.integrate.solve_ivp(rate, (0, dt), x0, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        coarse = sampled.F @ x0 + sampled.G0 @ u0 + sampled.G1 @ u1
        assert np.abs(coarse - fine).max() < 1e-10 * np.abs(fine).max()

    def test_two_halves_are_one_whole(self, mast, rng):
        _, _, linear = mast
        whole, half = (sample_ramped(linear.A, linear.B, dt) for dt in (0.1, 0.05))
        x, (u0, u1) = rng.standard_normal(42), rng.standard_normal((2, 21))
        mid = (u0 + u1) / 2
        twice = half.F @ (half.F @ x + half.G0 @ u0 + half.G1 @ mid) + half.G0 @ mid + half.G1 @ u1
        once = whole.F @ x + whole.G0 @ u0 + whole.G1 @ u1
        assert np.abs(twice - once).max() < 1e-12 * np.abs(once).max()

    def test_input_state(self, mast, rng):
        _, _, linear = mast
        sampled = sample_ramped(linear.A, linear.B, 0.02)
        A, B = sampled.with_input_state()
        x, (u0, u1) = rng.standard_normal(42), rng.standard_normal((2, 21))
        following = A @ np.concatenate([x, u0]) + B @ u1
        assert np.abs(following[:42] - sampled.F @ x - sampled.G0 @ u0 - sampled.G1 @ u1).max() < 1e-12
        assert (following[42:] == u1).all()


class TestRefusals:
    def test_slack_boundary(self):
        """A tendon exactly as long as its rest length has two linear models."""
        _, rest, _ = solved(shell_scene())
        edge = rest.rest_lengths.copy()
        edge[4] = rest.lengths[4] * (1 + 3e-10)
        label = rest.structure.tendon_labels[4]
        with pytest.raises(tc.LinearizationError, match=f"tendon {label} is -.* m from slack.*on_boundary"):
            tc.linearize(tc.build_dynamics(shell_scene()), replaced(rest, rest_lengths=edge))

    def test_all_slack(self):
        scene = shell_scene(tendons={"rest_ratio": 1.2})
        with pytest.raises(tc.LinearizationError, match="every tendon is slack"):
            tc.linearize(tc.build_dynamics(scene), tc.find_equilibrium(scene))

    def test_unknown_output(self, free):
        """Asked past the type check that only tests have."""
        dynamics, rest, _ = free
        with pytest.raises(tc.LinearizationError, match='output "angles" is unknown; choose from nodes'):
            inspect.unwrap(tc.linearize)(dynamics, rest, outputs=("angles",))

    def test_slack_tendon_away_from_the_boundary_is_taken(self):
        """A tendon that is plainly slack pulls nothing, neither now nor to first order."""
        slack = shell_scene(pins=["P1_*_1"], tendons={"rest_ratio": {"*": 0.8, "t5_1_1": 2.5}})
        _, rest, linear = solved(slack)
        k = rest.structure.tendon_labels.index("t5_1_1")
        assert rest.tensions[k] == 0
        row = linear.outputs.index("T_t5_1_1")
        assert not linear.C[row].any()
        assert not linear.B[:, linear.inputs.index("u_t5_1_1")].any()


def test_published_prism_frequencies():
    """The reference's prism, rigid rods, base pinned and free: frequencies in Hz."""
    pinned = [2.188274508, 4.970573614, 4.970573614, 10.840783026, 10.840783026, 12.767044727]
    free = [
        2.665597479, 8.052123287, 8.052123287, 9.992079002, 9.992079002, 14.38628877, 16.27651360, 16.27651360,
        19.12518900,
    ]  # fmt: skip
    for scene, wanted in ((reference_prism(pins=["a", "b", "c"]), pinned), (reference_prism(), free)):
        rest = tc.find_equilibrium(scene)
        found = np.sqrt(rest.spectrum.omega2[rest.spectrum.rigid_count :]) / (2 * np.pi)
        assert np.abs(found / wanted - 1).max() < 1e-8


def test_disturbances_enter_as_the_nonlinear_model_has_them():
    """E w is the rate of the state at rest under a force w on the pushed nodes, a head and a tail of two rods."""
    push = [{"node": node, "force": [1.0, 0.0, 0.0], "from": 0.0, "to": 1.0} for node in ("P4_1_1", "P3_2_1")]
    dynamics, rest, linear = solved(shell_scene(pins=["P1_*_1"], simulation={"t_end": 1.0, "push": push}))
    force = np.array([0.3, -0.2, 0.5, -0.1, 0.4, 0.2])
    at_rest = dynamics.pack(rest.nodes)
    rate = np.asarray(dynamics.f(at_rest, np.zeros(21), force)).ravel()
    step = 1e-6
    ahead, back = (linear.state_of(*dynamics.unpack(at_rest + sign * step * rate)) for sign in (1, -1))
    assert linear.E.shape == (42, 6)
    assert (ahead - back) / (2 * step) == pytest.approx(linear.E @ force, abs=1e-8)
