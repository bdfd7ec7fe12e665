"""Nodes held in single directions: the cut manifold is exact, the ground carries its part, motions are counted."""

from dataclasses import replace

import numpy as np
import pytest
from support import order_of, prism_scene, random_motion, shell_scene, solved

import tensctl as tc
from tensctl.elements import JointedManifold, Potential
from tensctl.interop.mjcf import mjcf
from tensctl.model.joint_kernel import constrain
from tensctl.model.kernel import accelerations
from tensctl.model.shell_equations import ShellEquations
from tensctl.statics.prestress import self_stress
from tensctl.statics.rigid import rigid_motions

GUIDES = {"P1_1_1": "xyz", "P1_2_1": "z", "P1_3_1": "xz", "P4_1_1": "y"}


def guided_shell(**sections):
    return shell_scene(3, 1, pins=GUIDES, **sections)


def guided_class_two(**sections):
    """Guides on a free end, on a node where two rods meet, and a pin where two rods meet."""
    pins = {"P1_1_1": "z", "P2_1_1": "x", "P4_1_1": "xyz"}
    return shell_scene(3, 2, cls=2, pins=pins, **sections)


SCENES = {"guided": guided_shell, "jointed and guided": guided_class_two}
scenes = pytest.mark.parametrize("make", SCENES.values(), ids=SCENES.keys())


def network(nodes, rods, tendons, pins, /, **sections):
    return tc.Scene(structure=tc.network(nodes, rods, tendons, pins), **sections)


def slider(**sections):
    """A rod along y whose tail slides along x, tied both ways to the ground, its head free."""
    nodes = {"o": [0, 0, 0], "head": [0, 1, 0], "left": [-1, 0, 0], "right": [1, 0, 0]}
    tendons = {"l": ["left", "o"], "r": ["o", "right"]}
    return network(nodes, {"rod": ["o", "head"]}, tendons, {"o": "yz", "left": "xyz", "right": "xyz"}, **sections)


class TestManifold:
    @scenes
    def test_gradient_and_hessian(self, make):
        """Remainders of the energy along `retract` shrink as h^2 and h^3, away from rest and under load."""
        scene = make(loads={"P2_*_1*": [0.3, 0.2, -1.0]})
        potential = Potential.of(scene)
        manifold, rng = potential.manifold, np.random.default_rng(0)
        nodes = manifold.retract(potential.structure.nodes, 0.1 * rng.normal(size=manifold.size))
        point, way = potential.at(nodes), rng.normal(size=manifold.size)
        steps = np.array([4e-3, 2e-3, 1e-3])
        energy = np.array([potential.at(manifold.retract(nodes, h * way)).energy for h in steps])
        linear = point.energy + steps * (point.gradient @ way)
        first = np.abs(energy - linear)
        second = np.abs(energy - linear - steps**2 / 2 * (way @ point.hessian @ way))
        assert order_of(steps, first) == pytest.approx(2, abs=0.1)
        assert order_of(steps, second) == pytest.approx(3, abs=0.2)

    @scenes
    def test_rods_joints_and_guides_stay_exact(self, make):
        potential = Potential.of(make())
        structure, manifold, rng = potential.structure, potential.manifold, np.random.default_rng(1)
        assert isinstance(manifold, JointedManifold)
        nodes = structure.nodes
        for _ in range(5):
            nodes = manifold.retract(nodes, 0.2 * rng.normal(size=manifold.size))
        assert (nodes[structure.held] == structure.nodes[structure.held]).all()
        assert np.abs(nodes - structure.nodes).max() > 0.2
        ends = nodes[structure.rods]
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        assert np.abs(lengths / structure.rod_lengths - 1).max() < 1e-14

    @scenes
    def test_each_held_direction_takes_a_freedom(self, make):
        structure = tc.build_structure(make())
        free = 5 * len(structure.rods)
        ends = np.bincount(structure.rods.ravel(), minlength=len(structure.nodes))
        rows = 3 * (ends - 1)[ends > 0].sum() + structure.held.sum()
        assert Potential.of(make()).manifold.size == free - rows

    @scenes
    def test_logarithm_and_its_rate(self, make):
        manifold, nodes = Potential.of(make()).manifold, tc.build_structure(make()).nodes
        way, onward = np.random.default_rng(2).normal(size=(2, manifold.size))
        steps = np.array([1e-2, 1e-3])
        chart = [manifold.logarithm(nodes, manifold.retract(nodes, h * way)) for h in steps]
        errors = [np.abs(xi - h * way).max() for xi, h in zip(chart, steps, strict=True)]
        assert errors[0] / errors[1] > 90
        there, h = manifold.retract(nodes, 0.1 * way), 1e-5
        forth, back = (manifold.retract(there, sign * h * onward) for sign in (1, -1))
        rate = (manifold.logarithm(nodes, forth) - manifold.logarithm(nodes, back)) / (2 * h)
        assert manifold.velocity(nodes, there, (forth - back) / (2 * h)) == pytest.approx(rate, abs=1e-8)

    def test_pins_are_guides_in_all_directions(self):
        """A manifold whose pins are given as three guides each is the one with pins."""
        whole = tc.shell(3, 1, pins=["P1_*_1"])
        parts = replace(whole, pinned=np.zeros_like(whole.pinned), guides=whole.held)
        loads = {"P4_*_1": [0, 0, -1.0]}
        by_pins = tc.find_equilibrium(tc.Scene(structure=whole, loads=loads))
        potential = Potential.of(tc.Scene(structure=whole, loads=loads))
        other = replace(potential, structure=parts, manifold=JointedManifold.of(parts, potential.members.mass))
        by_guides = tc.statics.settle(other)
        assert np.abs(by_guides.nodes - by_pins.nodes).max() < 1e-10
        assert by_guides.omega2 == pytest.approx(by_pins.omega2, rel=1e-9)
        moving = by_pins.potential.manifold.moving
        assert by_guides.rod_forces[moving] == pytest.approx(by_pins.rod_forces[moving], rel=1e-9)


class TestRest:
    @scenes
    def test_balance_and_stability(self, make):
        rest = tc.find_equilibrium(make(gravity={"g": 1.0}))
        rest.verify()
        assert rest.stable
        assert rest.residual < 1e-11

    def test_frequency_of_a_rod_on_a_guide(self):
        """Held in y and z at one end, the rod slides with 2 EA-like springs k on mass M_xx, its turn being free.

        Coordinates x of the guided end and a of the turn about z: T = m/2 x'^2 - m L/2 x' a' + m L^2/6 a'^2, only x has
        stiffness 2k, so omega^2 = 2k / (m - (m L/2)^2 / (m L^2/3)) = 8 k/m beside two free turns.
        """
        m, k = 3.0, 50.0
        rest = tc.find_equilibrium(slider(rods={"mass": m}, tendons={"stiffness": k, "rest_ratio": 0.5}))
        assert rest.omega2 == pytest.approx([0.0, 0.0, 8 * k / m], abs=1e-10)

    def test_pendulum_on_a_cart(self):
        """Under weight the turns are pendulums: x with 2k couples to one of them, the other swings at 3g/2L."""
        m, k, g = 3.0, 50.0, 9.0
        scene = slider(rods={"mass": m}, tendons={"stiffness": k, "rest_ratio": 0.5}, gravity={"g": [0, g, 0]})
        rest = tc.find_equilibrium(scene)
        M, K = m * np.array([[1, 0.5], [0.5, 1 / 3]]), np.diag([2 * k, m * g / 2])
        coupled = np.linalg.eigvals(np.linalg.solve(M, K)).real
        assert rest.omega2 == pytest.approx(np.sort([*coupled, 1.5 * g]), rel=1e-12)
        assert rest.rod_forces == pytest.approx([-m * g / 2], rel=1e-12)

    def test_the_ground_takes_the_weight_through_guides(self):
        """A shell that stands on three guided nodes rests as on a table and keeps three rigid motions."""
        rest = tc.find_equilibrium(shell_scene(3, 1, pins={"P1_*_1": "z"}, gravity={"g": 1.0}))
        assert rest.stable
        assert rest.spectrum.rigid.names == ("translation x", "translation y", "rotation z")
        weight = rest.potential.members.forces.sum(axis=0)
        ground = -rest.point.nodal_forces
        rods = rest.rod_forces[:, None] * rest.potential.manifold.directions(rest.nodes)
        np.add.at(ground, rest.structure.rods[:, 0], rods)
        np.subtract.at(ground, rest.structure.rods[:, 1], rods)
        assert ground.sum(axis=0) == pytest.approx(-weight, rel=1e-10, abs=1e-10)
        assert (ground[rest.structure.guides] > 0).all()

    def test_axes_and_units_may_be_exchanged(self):
        """The same structure on its side has the same energies and frequencies."""
        upright = tc.shell(3, 1, pins={"P1_*_1": "z", "P1_1_1": "xz"})
        turn = [1, 2, 0]
        lying = replace(upright, nodes=upright.nodes[:, turn], guides=upright.guides[:, turn])
        rests = [tc.find_equilibrium(tc.Scene(structure=s)) for s in (upright, lying)]
        assert rests[1].energy == pytest.approx(rests[0].energy, rel=1e-12)
        assert rests[1].omega2 == pytest.approx(rests[0].omega2, rel=1e-9, abs=1e-9)

    def test_linear_model(self):
        _, rest, linear = solved(guided_shell())
        linear.verify()
        free = rest.structure.free
        assert linear.outputs[: free.sum()] == tuple(
            f"{label}_{axis}"
            for label, row in zip(rest.structure.node_labels, free, strict=True)
            for axis, at in zip("xyz", row, strict=True)
            if at
        )
        assert linear.frame(rest.nodes, 0 * rest.nodes) is None

    @scenes
    def test_static_response_is_that_of_the_nonlinear_rest(self, make):
        """What the linear model leaves out of the static balance shrinks as h^2."""
        scene = make()
        rest = tc.find_equilibrium(scene)
        response = tc.statics.static_influence(rest)
        way = np.random.default_rng(3).normal(size=response.shape[1])
        steps, off = np.array([4e-3, 2e-3, 1e-3]), []
        for h in steps:
            moved = tc.find_equilibrium(scene, start=rest.nodes, inputs=h * way)
            xi = rest.potential.manifold.logarithm(rest.nodes, moved.nodes)
            off.append(np.abs(xi - h * (response @ way)).max())
        assert order_of(steps, off) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize(
    ("pins", "count"),
    [({}, 6), ({"P1_1_1": "z"}, 5), ({"P1_*_1": "z"}, 3), ({"P1_*_1": "z", "P1_1_1": "xz"}, 2),
     ({"P1_*_1": "z", "P1_1_1": "xyz"}, 1), ({"P1_1_1": "xyz"}, 3), ({"P1_1_1": "xyz", "P1_2_1": "z"}, 2),
     ({"P1_1_1": "xyz", "P1_2_1": "xz", "P1_3_1": "z"}, 0), ({"P*": "z"}, 3)],
)  # fmt: skip
def test_rigid_motions_are_counted(pins, count):
    """As many as the ground leaves, and as many zeros as that in the spectrum."""
    rest = tc.find_equilibrium(shell_scene(3, 1, pins=pins))
    assert len(rest.spectrum.rigid.names) == count
    assert (np.abs(rest.omega2) < 1e-8 * rest.omega2[-1]).sum() == count
    assert rest.stable


@pytest.mark.parametrize(("lift", "count"), [(0.0, 1), (0.3, 2)])
def test_a_turn_that_would_lift_a_guided_node_is_no_rigid_motion(lift, count):
    """On a pin, with a node guided along the line to the pin, a body turns about that line only."""
    shell = tc.shell(3, 1, pins={"P1_1_1": "xyz", "P1_2_1": "x"})
    a, b = (shell.node_labels.index(label) for label in ("P1_1_1", "P1_2_1"))
    line = shell.nodes[b] - shell.nodes[a]
    x = line / np.linalg.norm(line)
    across = np.linalg.svd(x[None])[2][1:]
    nodes = (shell.nodes - shell.nodes[a]) @ np.vstack([x, across]).T
    turn = np.array([[np.cos(lift), 0, np.sin(lift)], [0, 1, 0], [-np.sin(lift), 0, np.cos(lift)]])
    potential = Potential.of(tc.Scene(structure=replace(shell, nodes=nodes @ turn.T)))
    assert len(rigid_motions(potential, potential.structure.nodes).names) == count


class TestRefusals:
    def test_a_locked_rod(self):
        """A rod along the direction in which its end is guided."""
        nodes = {"a": [0, 0, 0], "b": [0, 0, 1], "c": [1, 0, 0]}
        scene = network(nodes, {"r": ["a", "b"]}, {"t": ["b", "c"]}, {"a": "xyz", "b": "z", "c": "xyz"})
        with pytest.raises(tc.StructureError, match="joints and guides lock or branch at the structure's own nodes"):
            tc.find_equilibrium(scene)

    def test_nothing_takes_the_weight(self):
        scene = shell_scene(3, 1, pins={"P1_*_1": "x"}, gravity={"g": 1.0})
        with pytest.raises(tc.EquilibriumError, match="nothing takes the sum of the loads"):
            tc.find_equilibrium(scene)

    def test_a_guided_node_without_rod(self):
        nodes = {"a": [0, 0, 0], "b": [0, 0, 1], "c": [1, 0, 0]}
        with pytest.raises(tc.StructureError, match="node c belongs to no rod and is not pinned"):
            tc.network(nodes, {"r": ["a", "b"]}, {"t": ["b", "c"]}, {"c": "z"})

    @pytest.mark.parametrize(
        ("ask", "words"),
        [
            (lambda scene: self_stress(tc.build_structure(scene)), "prestress is found for whole pins in space only"),
            (lambda scene: tc.inverse_statics(Potential.of(scene), tension_min=1.0), "prestress is found for"),
            (lambda scene: tc.nearest_shape(Potential.of(scene), tension_min=1.0), "prestress is found for"),
            (lambda scene: mjcf(tc.build_dynamics(scene)), "MuJoCo holds single directions by springs only"),
        ],
        ids=["prestress", "inverse", "nearest", "mujoco"],
    )
    def test_rooms_without_guides(self, ask, words):
        with pytest.raises(tc.StructureError, match=f"node P4_1_1 is held in y only, and {words}"):
            ask(guided_shell())

    def test_equations_of_the_paper(self):
        with pytest.raises(tc.StructureError, match="the shell has pins"):
            ShellEquations.of(shell_scene(3, 1, pins={"P1_1_1": "z"}))

    def test_symmetry_is_not_used(self):
        """A prism large enough for the search in one sector rests the same way when it is searched as a whole."""
        rest = tc.find_equilibrium(prism_scene(14, pins={"a*": "z"}))
        assert rest.symmetry is None
        assert rest.stable is not tc.Stability.NO


class TestMotion:
    @scenes
    def test_kernel_and_casadi_agree(self, make):
        dynamics = tc.build_dynamics(make(tendons={"damping": 1.0}, loads={"P2_*_1*": [0.3, 0.2, -1.0]}))
        nodes, velocities = random_motion(dynamics.potential, np.random.default_rng(4), reach=0.05)
        q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
        a, data = np.zeros_like(q), dynamics.kernel
        accelerations(data, q, v, dynamics.members.rest_lengths, dynamics.layout.spread(dynamics.members.forces), a)
        assert constrain(data, q, a, np.zeros(data.place[-1]), np.zeros(data.first.size))
        x = dynamics.pack(nodes, velocities)
        rate = np.asarray(dynamics.f(x, np.zeros(len(dynamics.members.inputs)), np.zeros(0))).ravel()
        assert np.abs(rate[x.size // 2 :] - a[dynamics.state_mask]).max() < 1e-12 * np.abs(a).max()

    @scenes
    def test_linear_model_is_that_of_the_motion(self, make):
        """State derivatives of f and of the linear model differ as h^2 near the rest, guides kept."""
        dynamics, rest, linear = solved(make())
        way, steps, off = np.random.default_rng(5).normal(size=linear.A.shape[0]), np.array([4e-4, 2e-4, 1e-4]), []
        manifold = rest.potential.manifold
        weight = manifold.mass(dynamics.members.mass)
        for h in steps:
            nodes = manifold.retract(rest.nodes, h * (linear.shapes @ way[: manifold.size]))
            x = dynamics.pack(nodes)
            _, a = dynamics.unpack(np.concatenate([x[: x.size // 2], np.asarray(dynamics.f(x, np.zeros(
                len(dynamics.members.inputs)), np.zeros(0))).ravel()[x.size // 2 :]]))  # fmt: skip
            state = linear.state_of(nodes, 0 * nodes)
            eta = linear.shapes.T @ (weight * manifold.velocity(rest.nodes, nodes, a))
            rate = (linear.A @ state)[np.argsort(linear.order)][manifold.size :]
            off.append(np.abs(eta - rate).max())
        assert order_of(steps, off) == pytest.approx(2, abs=0.1)

    @scenes
    def test_energy_and_guides_are_kept(self, make):
        scene = make()
        dynamics = tc.build_dynamics(scene)
        start = random_motion(dynamics.potential, np.random.default_rng(6), reach=0.02, speed=0.5)
        run = tc.simulate(dynamics, start, t_end=0.5, timepts=np.linspace(0, 0.5, 11))
        run.verify()
        structure = dynamics.structure
        off = np.abs(run.nodes - structure.nodes)[:, structure.held].max()
        assert off < 1e-13
        assert np.abs(run.velocities[:, structure.held]).max() < 1e-12
        energies = np.array([total_energy(dynamics, *state) for state in zip(run.nodes, run.velocities, strict=True)])
        assert np.ptp(energies) < 1e-8 * energies.max()

    def test_a_guided_node_cannot_start_elsewhere(self):
        dynamics = tc.build_dynamics(guided_shell())
        structure = dynamics.structure
        velocities = np.where(structure.guides, 1.0, 0.0)
        with pytest.raises(tc.SimulationError, match="guided ones in the directions that are held"):
            tc.simulate(dynamics, (structure.nodes, velocities), t_end=0.1)


def total_energy(dynamics, nodes, velocities):
    """Potential energy and that of slender rods, m/6 (v1.v1 + v1.v2 + v2.v2), J."""
    first, second = (velocities[dynamics.structure.rods[:, k]] for k in (0, 1))
    squares = (first * first + first * second + second * second).sum(axis=1)
    return dynamics.potential.at(nodes).energy + float(dynamics.members.mass @ squares) / 6
