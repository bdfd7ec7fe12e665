"""Equilibria balance, agree with an independent code, and say truthfully whether they hold."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import (
    MIXED_PINS,
    pendulum_scene,
    prism_scene,
    random_motion,
    replaced,
    rotation,
    shell_scene,
    taylor_order,
)

import tensctl as tc

SIZES = [(3, 1), (4, 1), (6, 1), (3, 2), (4, 2), (3, 3), (6, 3), (8, 4)]


def plain_tensions(equilibrium, law="k"):
    """Tensions written out again, from nodes and rest lengths only."""
    ends = equilibrium.nodes[equilibrium.structure.tendons]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    rest, k = equilibrium.rest_lengths, equilibrium.potential.members.stiffness
    return np.maximum(k * (length - rest) if law == "k" else k * (length / rest - 1), 0)


def plain_residual(equilibrium, law="k"):
    """Largest force left at a free node by the best rod forces (least squares), over the largest tension or load."""
    structure, nodes = equilibrium.structure, equilibrium.nodes
    T, loads = plain_tensions(equilibrium, law), equilibrium.potential.members.forces
    forces = loads.copy()
    for (a, b), pull in zip(structure.tendons, T, strict=True):
        along = (nodes[b] - nodes[a]) / np.linalg.norm(nodes[b] - nodes[a])
        forces[a] += pull * along
        forces[b] -= pull * along
    rods = np.zeros((len(nodes), 3, len(structure.rods)))
    for r, (a, b) in enumerate(structure.rods):
        along = (nodes[b] - nodes[a]) / np.linalg.norm(nodes[b] - nodes[a])
        rods[a, :, r], rods[b, :, r] = -along, along
    free = ~structure.pinned
    matrix, right = rods[free].reshape(-1, len(structure.rods)), -forces[free].ravel()
    left = right - matrix @ np.linalg.lstsq(matrix, right, rcond=None)[0]
    scale = max(T.max(), np.linalg.norm(loads, axis=1).max())
    return np.linalg.norm(left.reshape(-1, 3), axis=1).max() / scale


@pytest.fixture(scope="module")
def rest(reference_scene):
    return tc.find_equilibrium(reference_scene)


class TestReference:
    def test_energy(self, rest, reference):
        assert rest.energy == pytest.approx(reference["equilibrium"]["energy_J"], rel=1e-11)

    def test_tensions_and_lengths(self, rest, reference):
        tensions = np.array(reference["equilibrium"]["tensions_N"])
        assert np.abs(rest.tensions - tensions).max() < 1e-9 * tensions.max()
        assert np.abs(rest.lengths - reference["equilibrium"]["lengths_m"]).max() < 1e-10

    def test_frequencies(self, rest, reference):
        omega2 = np.array(reference["equilibrium"]["omega2_rad2_s2"])
        assert np.abs(rest.omega2 - omega2).max() < 1e-9 * omega2.max()
        assert rest.omega2.size == 10 * reference["n"] * reference["m"]


class TestNewton:
    def check(self, n, m, **given):
        rest = tc.find_equilibrium(shell_scene(n, m, **given))
        assert rest.iterations <= 10
        assert rest.residual < 1e-12
        assert plain_residual(rest) < 1e-12
        assert rest.tensions.min() > 0
        rest.verify(1e-12)
        return rest

    @pytest.mark.parametrize("pins", [(), ("P1_*_1",)], ids=["free", "pinned"])
    @pytest.mark.parametrize(("n", "m"), SIZES)
    def test_few_steps(self, n, m, pins):
        assert self.check(n, m, pins=pins).stable

    def test_few_steps_for_the_largest(self):
        self.check(12, 6)

    def test_strain_law(self):
        rest = tc.find_equilibrium(shell_scene(tendons={"EA": 100.0}))
        assert plain_residual(rest, "EA") < 1e-12
        assert np.abs(rest.tensions - plain_tensions(rest, "EA")).max() < 1e-13 * rest.tensions.max()

    def test_converges_quadratically(self):
        """Residuals after each further step, as long as none is rounding, square on the way in."""
        scene, left = shell_scene(), []
        for steps in range(3, 7):
            try:
                loose = scene.replaced(equilibrium={"tol": 1e-13, "max_iterations": steps})
                left.append(tc.find_equilibrium(loose).residual)
            except tc.EquilibriumError as error:
                left.append(float(str(error).split("steps: ")[1].split(" ")[0]))
        inside = [(a, b) for a, b in pairwise(left) if a < 1e-2 and b > 1e-14]
        assert inside
        assert all(b < 10 * a**1.8 for a, b in inside)

    def test_refuses_too_few_steps(self):
        with pytest.raises(tc.EquilibriumError, match="no equilibrium was reached in 2 steps"):
            tc.find_equilibrium(shell_scene(equilibrium={"max_iterations": 2}))

    def test_verify_tells_a_wrong_answer(self, free, rng):
        _, rest, _ = free
        shifted, _ = random_motion(rest.potential, rng, reach=1e-3)
        with pytest.raises(tc.EquilibriumError, match="no equilibrium"):
            replaced(rest, nodes=shifted).verify()
        with pytest.raises(tc.EquilibriumError, match="rods are rigid"):
            replaced(rest, nodes=rest.nodes * (1 + 1e-11)).verify()

    def test_rest_length_change_starts_from_what_is_given(self, mast):
        _, rest, _ = mast
        u = np.full(rest.inputs.size, 0.01)
        moved = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]), start=rest.nodes, inputs=u)
        assert np.abs(moved.inputs - u).max() < 1e-16
        assert moved.tensions.sum() > rest.tensions.sum()
        assert plain_residual(moved) < 1e-12


class TestStability:
    @pytest.mark.parametrize("ratio", [0.95, 1.0, 1.2])
    def test_slack_shell_has_no_prestress(self, ratio):
        rest = tc.find_equilibrium(shell_scene(tendons={"rest_ratio": ratio}))
        assert rest.stable is tc.Stability.NO_PRESTRESS
        assert str(rest.stable) == "no prestress"
        assert not rest.stable
        assert plain_tensions(rest).max() < 1e-11

    @pytest.mark.parametrize("n", [3, 4, 5, 6])
    def test_prism_at_its_twist(self, n):
        rest = tc.find_equilibrium(prism_scene(n))
        assert rest.stable is tc.Stability.YES
        assert rest.rod_forces.min() > 0

    def test_rod_pulled_towards_its_pin_is_unstable(self):
        """l(theta) = |(cos, sin) - (-a, 0)| is longest at rest: omega^2 = -3 T a / ((1 + a) m) for L = 1 m."""
        rest = tc.find_equilibrium(pendulum_scene(anchor=(-1.5, 0, 0), rods={"mass": 2.0}))
        tension = 100 * (2.5 - 0.8 * 2.5)
        assert rest.stable is tc.Stability.NO
        assert rest.omega2[0] == pytest.approx(-3 * tension * 1.5 / (2.5 * 2.0), rel=1e-13)
        assert rest.rod_forces[0] == pytest.approx(tension, rel=1e-13)

    def test_rod_pulled_away_from_its_pin_is_stable(self):
        rest = tc.find_equilibrium(pendulum_scene(anchor=(3, 0, 0)))
        assert rest.stable is tc.Stability.YES
        assert rest.omega2 == pytest.approx(3 * 40 * 3 / 2 * np.ones(2), rel=1e-13)
        assert rest.rod_forces[0] == pytest.approx(-40, rel=1e-13)

    def test_standing_and_hanging_rod(self):
        """A heavy rod on a pin: omega^2 = +-3 g / (2 L)."""
        for up, verdict in ((1, tc.Stability.NO), (-1, tc.Stability.YES)):
            slack = {"rest_ratio": 2.0}
            rest = tc.find_equilibrium(pendulum_scene((0, 0, 2 * up), tendons=slack, gravity={"g": 9.8}))
            assert rest.stable is verdict
            assert rest.omega2 == pytest.approx(-up * 3 * 9.8 / 4 * np.ones(2), rel=1e-13)

    def test_spectrum_agrees_with_energies(self, free, rng):
        """Along a mode energy grows by omega^2 h^2 / 2; what is left falls with order 3."""
        _, rest, _ = free
        manifold = rest.potential.manifold
        for mode in (6, 15, 29):
            shape = rest.spectrum.shapes[:, mode]

            def left(h, shape=shape, mode=mode):
                moved = rest.potential.at(manifold.retract(rest.nodes, h * shape))
                return moved.energy - rest.energy - h**2 / 2 * rest.spectrum.omega2[mode]

            assert taylor_order(left, np.array([0.04, 0.02, 0.01])) > 2.8

    def test_disturbed_from_a_stable_rest_it_comes_back(self, mast, rng):
        _, rest, _ = mast
        start = rest.potential.manifold.retract(rest.nodes, 0.02 * rng.standard_normal(21))
        again = tc.find_equilibrium(shell_scene(pins=["P1_*_1"]), start=start)
        assert np.abs(again.nodes - rest.nodes).max() < 1e-11


class TestRigidMotions:
    NAMES = tuple(f"{kind} {axis}" for kind in ("translation", "rotation") for axis in "xyz")

    @pytest.mark.parametrize("scene", [shell_scene(), shell_scene(4, 2), prism_scene(5)], ids=["3,1", "4,2", "prism"])
    def test_free_structure_has_six(self, scene):
        rest = tc.find_equilibrium(scene)
        assert sorted(rest.spectrum.rigid.names) == sorted(self.NAMES)
        assert np.abs(rest.omega2[:6]).max() < rest.tolerance
        assert rest.omega2[6] > 1e6 * rest.tolerance

    @pytest.mark.parametrize(
        ("pins", "count"),
        [(("P1_1_1",), 3), (("P1_1_1", "P4_2_1"), 1), (("P1_*_1",), 0), (MIXED_PINS, 0)],
        ids=["one pin", "two pins", "base", "mixed"],
    )
    def test_pins_take_them_away(self, pins, count):
        rest = tc.find_equilibrium(shell_scene(pins=pins))
        names = rest.spectrum.rigid.names
        assert len(names) == count
        assert all(name.startswith("rotation") for name in names)
        if count == 3:
            assert sorted(names) == sorted(self.NAMES[3:])
        assert np.abs(rest.spectrum.omega2[:count]).max(initial=0) < rest.tolerance
        assert rest.smallest > 1e6 * rest.tolerance

    def test_they_move_nodes_rigidly_and_are_orthonormal_by_mass(self, free):
        _, rest, _ = free
        basis = rest.spectrum.rigid.basis
        mass = rest.potential.manifold.mass(rest.potential.members.mass)
        assert np.abs(basis.T @ (mass[:, None] * basis) - np.eye(6)).max() < 1e-14
        for column in basis.T:
            moved = (rest.point.tangent @ column).reshape(-1, 3)
            gaps = rest.nodes[:, None] - rest.nodes[None]
            stretch = np.einsum("abi,abi->ab", gaps, moved[:, None] - moved[None])
            assert np.abs(stretch).max() < 1e-14

    def test_dead_loads_turn_rotations_into_pendulums(self):
        """Under weight only the rotation about the vertical through the single pin stays free."""
        scene = shell_scene(pins=["P4_1_1"], gravity={"g": 9.8}, tendons={"stiffness": 1000.0})
        rest = tc.find_equilibrium(scene)
        assert rest.stable
        assert rest.spectrum.rigid.names == ("rotation z",)


def as_network(structure, nodes=None, order=None, flip=None, **sections):
    """The structure as a network, with moved nodes, members in another order and some tendons reversed."""
    recipe = structure.as_recipe()
    if nodes is not None:
        recipe["nodes"] = dict(zip(recipe["nodes"], nodes.tolist(), strict=True))
    if order is not None:
        for key in ("nodes", "rods", "tendons"):
            entries = list(recipe[key].items())
            np.random.default_rng(order).shuffle(entries)
            recipe[key] = dict(entries)
    if flip is not None:
        turned = np.random.default_rng(flip).random(len(recipe["tendons"])) < 0.5
        for key, swap in zip(recipe["tendons"], turned, strict=True):
            recipe["tendons"][key] = recipe["tendons"][key][:: -1 if swap else 1]
    return tc.Scene(structure=recipe, **sections)


class TestInvariance:
    @settings(max_examples=8)
    @given(seed=st.integers(0, 10**6))
    def test_rigid_motion(self, free, seed):
        _, rest, _ = free
        rng = np.random.default_rng(seed)
        Q, shift = rotation(rng), rng.uniform(-3, 3, 3)
        moved = tc.find_equilibrium(as_network(rest.structure, rest.structure.nodes @ Q.T + shift))
        assert np.abs(moved.nodes - rest.nodes @ Q.T - shift).max() < 1e-10
        assert np.abs(moved.tensions - rest.tensions).max() < 1e-10 * rest.tensions.max()
        assert np.abs(moved.omega2 - rest.omega2).max() < 1e-10 * rest.omega2.max()

    @settings(max_examples=8)
    @given(seed=st.integers(0, 10**6))
    def test_relabelling(self, mast, seed):
        _, rest, _ = mast
        other = tc.find_equilibrium(as_network(rest.structure, order=seed, flip=seed))
        by_label = dict(zip(other.structure.tendon_labels, other.tensions, strict=True))
        again = np.array([by_label[label] for label in rest.structure.tendon_labels])
        assert np.abs(again - rest.tensions).max() < 1e-10 * rest.tensions.max()
        places = dict(zip(other.structure.node_labels, other.nodes, strict=True))
        moved = np.array([places[label] for label in rest.structure.node_labels])
        assert np.abs(moved - rest.nodes).max() < 1e-10

    @settings(max_examples=10)
    @given(length=st.floats(1e-3, 1e3), stiffness=st.floats(1e-3, 1e3), mass=st.floats(1e-3, 1e3))
    def test_units(self, mast, length, stiffness, mass):
        """Other units of length, force and mass give the same equilibrium in these units."""
        _, rest, _ = mast
        scene = as_network(
            rest.structure,
            length * rest.structure.nodes,
            tendons={"stiffness": 100 * stiffness, "rest_ratio": 0.8},
            rods={"mass": mass},
        )
        other = tc.find_equilibrium(scene)
        force = length * stiffness
        assert np.abs(other.nodes / length - rest.nodes).max() < 1e-10
        assert np.abs(other.tensions / force - rest.tensions).max() < 1e-10 * rest.tensions.max()
        assert other.energy == pytest.approx(force * length * rest.energy, rel=1e-11)
        assert np.abs(other.omega2 * mass / stiffness - rest.omega2).max() < 1e-10 * rest.omega2.max()
        assert other.iterations == rest.iterations
        assert other.stable


def reactions(rest):
    """Forces of the ground on the pinned nodes, from tensions, rod forces and loads written out again."""
    structure, nodes = rest.structure, rest.nodes
    forces = rest.potential.members.forces.copy()
    for members, push in ((structure.tendons, -plain_tensions(rest)), (structure.rods, rest.rod_forces)):
        for (a, b), size in zip(members, push, strict=True):
            along = (nodes[b] - nodes[a]) / np.linalg.norm(nodes[b] - nodes[a])
            forces[a] -= size * along
            forces[b] += size * along
    assert np.abs(forces[~structure.pinned]).max() < 1e-10 * plain_tensions(rest).max()
    return -forces[structure.pinned]


@pytest.fixture(scope="module")
def loaded():
    scene = shell_scene(
        pins=["P1_*_1"],
        rods={"mass": {"*": 1.5, "r2_*": 0.5}},
        gravity={"g": [1.0, 0.0, -9.8]},
        loads={"P4_1_1": [3.0, -2.0, 4.0]},
        tendons={"stiffness": 500.0},
    )
    return tc.find_equilibrium(scene)


class TestLoads:
    def test_reactions_carry_weight_and_loads(self, loaded):
        weight = 3 * 1.5 * np.array([1, 0, -9.8]) + 3 * 0.5 * np.array([1, 0, -9.8])
        total = weight + np.array([3.0, -2.0, 4.0])
        assert np.abs(reactions(loaded).sum(axis=0) + total).max() < 1e-11

    def test_reactions_balance_moments(self, loaded):
        """Weight acts at the middle of each rod, whatever end forces stand for it."""
        structure, nodes = loaded.structure, loaded.nodes
        top = nodes[structure.node_labels.index("P4_1_1")]
        moment = np.cross(nodes[structure.pinned], reactions(loaded)).sum(axis=0) + np.cross(top, [3.0, -2.0, 4.0])
        masses = np.where([label.startswith("r1") for label in structure.rod_labels], 1.5, 0.5)
        for mass, (a, b) in zip(masses, structure.rods, strict=True):
            moment += np.cross((nodes[a] + nodes[b]) / 2, mass * np.array([1, 0, -9.8]))
        assert np.abs(moment).max() < 1e-11

    def test_energy_counts_the_work_of_loads(self, loaded):
        moved = loaded.nodes - loaded.structure.nodes
        middles = moved[loaded.structure.rods].mean(axis=1)
        masses = loaded.potential.members.mass
        work = (masses[:, None] * middles @ [[1.0], [0.0], [-9.8]]).sum()
        work += moved[loaded.structure.node_labels.index("P4_1_1")] @ [3.0, -2.0, 4.0]
        elastic = (plain_tensions(loaded) ** 2 / 1000).sum()
        assert loaded.energy == pytest.approx(elastic - work, rel=1e-12)

    def test_balances(self, loaded):
        assert plain_residual(loaded) < 1e-12
        assert loaded.stable

    def test_free_structure_with_a_load_has_no_rest(self):
        with pytest.raises(tc.EquilibriumError, match="of the largest force is left over; check that loads are held"):
            tc.find_equilibrium(shell_scene(loads={"P4_1_1": [0, 0, 1.0]}))

    def test_free_structure_with_balanced_loads(self):
        loads = {"P4_1_1": [0, 0, 1.0], "P4_2_1": [0, 0, 1.0], "P4_3_1": [0, 0, 1.0], "P1_*_1": [0, 0, -1.0]}
        rest = tc.find_equilibrium(shell_scene(loads=loads))
        assert plain_residual(rest) < 1e-12
        assert rest.stable

    def test_force_densities(self, free):
        _, rest, _ = free
        assert np.abs(rest.force_densities * rest.lengths - rest.tensions).max() < 1e-14 * rest.tensions.max()
        thrust = rest.rod_force_densities * rest.structure.rod_lengths
        assert np.abs(thrust - rest.rod_forces).max() < 1e-14 * rest.tensions.max()
        assert rest.rod_forces.min() > 0
