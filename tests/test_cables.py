"""Cables: tendons that run through several nodes with one tension."""

import json
import re
from itertools import pairwise

import numpy as np
import pytest
from support import (
    MAST,
    MIXED_PINS,
    clustered,
    mast_scene,
    network_scene,
    random_motion,
    shell_scene,
    solved,
    taylor_order,
)  # fmt: skip

import tensctl as tc
from tensctl.elements import Potential
from tensctl.elements.cables import cable_terms
from tensctl.errors import StructureError
from tensctl.model.joint_kernel import constrain
from tensctl.model.kernel import accelerations
from tensctl.model.shell_equations import ShellEquations
from tensctl.pipeline.case import checks
from tensctl.simulation import momenta, total_energy
from tensctl.simulation.rod_forces import end_forces
from tensctl.statics import find_symmetry, settle, static_influence, stretch_map, tension_influence
from tensctl.statics.algebra import Network
from tensctl.statics.balance import residual
from tensctl.statics.prestress import cyclic_orbits, equilibrium_matrix, stress_matrix, super_stability

NODES = {"a": [0, 0, 0], "b": [0, 0, 3], "c": [4, 0, 0], "d": [4, 0, 3]}
RODS = {"r": ["a", "b"], "s": ["c", "d"]}


def built(tendons, **parts):
    return tc.network(parts.get("nodes", NODES), parts.get("rods", RODS), tendons, parts.get("pins", ()))


def test_a_cable_is_as_long_as_its_segments():
    structure = built({"t": ["a", "c"], "loop": ["a", "b", "d", "c", "a"], "u": ["b", "c", "b", "d"]})
    assert structure.tendon_lengths.tolist() == [4, 14, 14]
    assert structure.segments[structure.segment_tendon == 1].tolist() == [[0, 1], [1, 3], [3, 2], [2, 0]]
    assert structure.has_cables
    assert structure.tendons.tolist() == [[0, 2], [0, 0], [1, 3]]
    moved = np.stack([structure.nodes, 2 * structure.nodes])
    assert structure.lengths_at(moved).tolist() == [[4, 14, 14], [8, 28, 28]]


def test_without_cables_segments_are_the_tendons():
    structure = tc.prism(3)
    assert structure.segments is structure.tendons
    assert not structure.has_cables
    assert structure.segment_tendon.tolist() == list(range(9))


def test_a_cable_is_on_the_ground_when_all_its_nodes_are():
    structure = built({"t": ["a", "b", "c"], "u": ["a", "d", "b"], "v": ["a", "b"]}, pins=["a", "b", "c"])
    assert structure.grounded_tendons.tolist() == [True, False, True]


def test_a_cable_goes_into_a_scene_and_back():
    structure = built({"t": ["a", "c", "d"], "u": ["a", "b", "d", "c", "a"], "v": ["b", "c"]})
    again = tc.build_structure(tc.Scene(structure=json.loads(json.dumps(structure.as_recipe()))))
    assert again.vias == structure.vias == ((2,), (1, 3, 2), ())
    assert again.paths == structure.paths


@pytest.mark.parametrize("room", [equilibrium_matrix, Network.of, cyclic_orbits, lambda s: stress_matrix(s, 1, 1)])
def test_rooms_for_tendons_of_two_nodes_refuse_cables(room):
    with pytest.raises(StructureError, match=r"^tendon t is a cable of 3 nodes, and .*; give .*\.$"):
        room(built({"v": ["b", "c"], "t": ["a", "c", "d"]}))


ALL = {
    "pins": MIXED_PINS,
    "tendons": {"stiffness": {"*": 100.0, "top": 30.0}, "rest_ratio": 0.9, "damping": {"*": 0.5, "side": 2.0}},
    "gravity": {"g": 9.8},
    "loads": {"P4_2_2": [1.0, 2.0, 3.0]},
    "drag": {"coefficient": 0.7},
    "actuators": {"tendons": ["top", "side", "t1_*_1"]},
    "simulation": {"t_end": 1.0, "push": [{"node": "P4_*", "force": [1, 0, 0], "from": 0, "to": 1}]},
}


def class_two_scene(**sections):
    """Rods that share nodes, the lowest and the highest ring as cables."""
    shell = tc.shell(3, 2, cls=2)
    rings = {"bottom": ("P1", 1), "top": ("P4", 2)}
    paths = {name: [labelled(shell, f"{p}_{i}_{j}") for i in (1, 2, 3, 1)] for name, (p, j) in rings.items()}
    return tc.Scene(structure=clustered(shell, paths), **sections)


def labelled(structure, part):
    """The node that a label names, or that was merged from it."""
    return next(label for label in structure.node_labels if part in label.split("+"))


SCENES = {
    "free": mast_scene(),
    "EA": mast_scene(tendons={"EA": 150.0, "rest_ratio": 0.9, "damping": 2.0}),
    "everything": mast_scene(**ALL),
    "guides": mast_scene({"P1_*_1": "z", "P4_1_2": "xy"}),
    "joints": class_two_scene(),
    "EA, everything": mast_scene(**ALL | {"tendons": {"EA": 150.0, "rest_ratio": 0.9, "damping": 2.0}}),
}


@pytest.fixture(scope="module")
def mast():
    return solved(mast_scene())


class TestPotential:
    STEPS = 2.0 ** -np.arange(4, 10)

    @pytest.fixture(params=["free", "EA", "everything", "guides", "joints"])
    def point(self, request):
        potential, rng = Potential.of(SCENES[request.param]), np.random.default_rng(3)
        nodes, _ = random_motion(potential, rng, reach=0.05)
        rest = 0.75 * potential.members.rest_lengths
        assert (potential.structure.lengths_at(nodes) > 1.05 * rest).all(), "taut, and away from where it would not be"
        return potential.at(nodes, rest)

    def moved(self, point, xi):
        return point.potential.at(point.potential.manifold.retract(point.nodes, xi), point.rest_lengths)

    def test_derivatives_along_the_manifold(self, point):
        xi = 0.05 * np.random.default_rng(1).standard_normal(point.potential.manifold.size)
        slope, bend = point.gradient @ xi, xi @ point.hessian @ xi
        first = lambda h: self.moved(point, h * xi).energy - point.energy - h * slope  # noqa: E731
        second = lambda h: first(h) - 0.5 * h**2 * bend  # noqa: E731
        assert taylor_order(first, self.STEPS) == pytest.approx(2, abs=0.1)
        assert taylor_order(second, self.STEPS) == pytest.approx(3, abs=0.1)

    def test_derivatives_at_the_nodes(self, point):
        """The stiffness against the gradient, in every node component, and the input map against rest lengths."""
        move = 0.05 * np.random.default_rng(2).standard_normal(point.nodes.shape)
        cut = 0.05 * np.random.default_rng(4).standard_normal(point.rest_lengths.size)

        def bent(h):
            there = point.potential.at(point.nodes + h * move, point.rest_lengths)
            return (there.terms.gradient - point.terms.gradient).ravel() - h * point.terms.stiffness @ move.ravel()

        def shortened(h):
            there = point.potential.at(point.nodes, point.rest_lengths - h * cut)
            return (there.terms.gradient - point.terms.gradient).ravel() - h * point.terms.input_map @ cut

        assert taylor_order(bent, self.STEPS) == pytest.approx(2, abs=0.1)
        if point.potential.members.law == "k":
            assert np.abs(shortened(0.1)).max() < 1e-12 * point.terms.tensions.max()
        else:
            assert taylor_order(shortened, self.STEPS) == pytest.approx(2, abs=0.1)

    def test_a_cable_is_the_sum_of_its_segments_for_one_tension(self, point):
        """Independent of the assembly: T n at both ends of every segment, in a loop."""
        structure, members = point.potential.structure, point.potential.members
        forces = np.zeros_like(point.nodes)
        for t, path in enumerate(structure.paths):
            length = sum(np.linalg.norm(point.nodes[b] - point.nodes[a]) for a, b in pairwise(path))
            k = members.stiffness[t] / (point.rest_lengths[t] if members.law == "EA" else 1.0)
            for a, b in pairwise(path):
                d = point.nodes[b] - point.nodes[a]
                pull = max(0.0, k * (length - point.rest_lengths[t])) * d / np.linalg.norm(d)
                forces[a] += pull
                forces[b] -= pull
        assert np.abs(forces + point.terms.gradient).max() < 1e-13 * np.abs(forces).max()


def test_without_cables_the_cable_terms_are_the_tendon_terms():
    """Two-node tendons through the assembly of cables: the same energy, forces, stiffness and input map."""
    potential = Potential.of(shell_scene(3, 2, tendons={"EA": 150.0, "rest_ratio": 0.9}))
    nodes, _ = random_motion(potential, np.random.default_rng(0))
    members = potential.members
    ours = cable_terms(nodes, potential.structure, members.rest_lengths, members.stiffness, members.law)
    theirs = potential.at(nodes).terms
    for name in ("energies", "tensions", "gradient"):
        close(getattr(ours, name), getattr(theirs, name))
    close(ours.stiffness.toarray(), theirs.stiffness.toarray())
    close(ours.input_map.toarray(), theirs.input_map.toarray())


def close(ours, theirs, tol=1e-13):
    assert np.abs(ours - theirs).max() <= tol * np.abs(theirs).max()


class TestStatics:
    def test_mast_rests_stably(self, mast):
        _, equilibrium, _ = mast
        equilibrium.verify(1e-12)
        assert equilibrium.stable is tc.Stability.YES
        assert (equilibrium.tensions > 1).all()
        assert "sector" not in equilibrium.way

    def test_balance_with_a_tendon_of_the_same_tension_for_each_piece(self, mast):
        """Cutting every cable into tendons that carry its tension leaves the shape at rest."""
        _, equilibrium, _ = mast
        structure, members = equilibrium.structure, equilibrium.potential.members
        pieces = structure.segments
        tension = equilibrium.tensions[structure.segment_tendon]
        apart = np.linalg.norm(equilibrium.nodes[pieces[:, 1]] - equilibrium.nodes[pieces[:, 0]], axis=1)
        cut = tc.network(equilibrium.nodes, structure.rods, pieces)
        rest = dict(zip(cut.tendon_labels, (apart - tension / members.stiffness[0]).tolist(), strict=True))
        scene = tc.Scene(structure=cut.as_recipe(), tendons={"rest_length": rest})
        again = Potential.of(scene).at(equilibrium.nodes)
        close(again.terms.gradient, equilibrium.point.terms.gradient, 1e-12)
        assert residual(again) < 1e-12

    def test_equal_tendons_by_symmetry_make_one_cable(self):
        """The rings of a shell have one tension by symmetry: as cables of k/n they change neither shape nor forces."""
        rings = {name: MAST[name] for name in ("bottom", "top")}
        k = {"*": 100.0, "bottom": 100.0 / 3, "top": 100.0 / 3}
        plain = tc.find_equilibrium(shell_scene(3, 2))
        scene = tc.Scene(structure=clustered(tc.shell(3, 2), rings), tendons={"stiffness": k})
        ringed = tc.find_equilibrium(scene)
        close(ringed.nodes, plain.nodes, 1e-10)
        close(ringed.rod_forces, plain.rod_forces, 1e-10)
        assert ringed.energy == pytest.approx(plain.energy, rel=1e-10)

    def test_response_to_inputs_against_equilibria(self, mast):
        """Influence on lengths and tensions against equilibria found anew, by central differences."""
        _, equilibrium, _ = mast
        lengths = stretch_map(equilibrium) @ static_influence(equilibrium)
        tensions, h = tension_influence(equilibrium), 1e-4
        for column in (0, tensions.shape[1] - 1):
            u = h * np.eye(tensions.shape[1])[column]
            more, less = (settle(equilibrium.potential, start=equilibrium.nodes, inputs=s * u) for s in (1, -1))
            close((more.lengths - less.lengths) / (2 * h), lengths[:, column], 1e-5)
            close((more.tensions - less.tensions) / (2 * h), tensions[:, column], 1e-5)

    def test_compliance_is_symmetric(self, mast):
        soft = tc.compliance(mast[1])
        close(soft, soft.T, 1e-10)


def guyed(across, **sections):
    """A rod of length 1 on a pin, upright, held at its head from four pinned nodes at distance 2 around it.

    Along x and y run, `across`, a cable from ground to ground through the head; else a tendon to each pinned node.
    """
    nodes = {"foot": [0, 0, 0], "head": [0, 0, 1]}
    nodes |= {"w": [-2, 0, 1], "e": [2, 0, 1], "s": [0, -2, 1], "n": [0, 2, 1], "post": [5, 0, 1]}
    each = {name: [name, "head"] for name in "wesn"}
    through = {"x": ["w", "head", "e"], "y": ["s", "head", "n"]}
    pins = ["foot", "w", "e", "s", "n", "post"]
    return network_scene(nodes, {"rod": ["foot", "head"]}, through if across else each, pins, **sections)


class TestPulleys:
    """Closed forms: head displacement xi across the rod, mass m/3 there."""

    def omega2(self, scene):
        equilibrium = tc.find_equilibrium(scene)
        return equilibrium, np.sort(equilibrium.omega2)

    def test_separate_tendons_stretch(self):
        equilibrium, omega2 = self.omega2(guyed(False, tendons={"stiffness": 100.0, "rest_length": 1.5}))
        assert equilibrium.tensions == pytest.approx([50.0] * 4, rel=1e-12)
        assert omega2 == pytest.approx([3 * (2 * 100.0 + 2 * 50.0 / 2)] * 2, rel=1e-12)

    def test_a_cable_slides_along_itself(self):
        """Along the cable nothing stretches, and the other cable's T/l is all that is left."""
        equilibrium, omega2 = self.omega2(
            guyed(True, tendons={"stiffness": 100.0, "rest_length": {"x": 3.5, "y": 3.0}})
        )
        assert equilibrium.tensions == pytest.approx([50.0, 100.0], rel=1e-12)
        assert omega2 == pytest.approx([3 * 2 * 50.0 / 2, 3 * 2 * 100.0 / 2], rel=1e-12)

    @pytest.mark.parametrize("law", ["stiffness", "EA"])
    def test_over_a_fixed_pulley_the_length_beyond_it_counts(self, law):
        """From the head over e to a post 3 m beyond: rest length 4.5 m for 5 m, stiffness k, or EA/4.5."""
        scene = guyed(False, tendons={law: 100.0, "rest_length": {"*": 1.5, "e": 4.5}})
        recipe = tc.build_structure(scene).as_recipe()
        recipe["tendons"]["e"] = ["head", "e", "post"]
        k = {"stiffness": np.array([100.0, 100.0]), "EA": np.array([100 / 1.5, 100 / 4.5])}[law]
        equal = {"*": 1.5, "e": 5 - k[0] * 0.5 / k[1] if law == "stiffness" else 5 / (1 + 0.5 / 1.5)}
        k_e = 100.0 if law == "stiffness" else 100.0 / equal["e"]
        equilibrium, omega2 = self.omega2(tc.Scene(structure=recipe, tendons={law: 100.0, "rest_length": equal}))
        T = k[0] * 0.5
        assert equilibrium.tensions == pytest.approx([T] * 4, rel=1e-12)
        wanted = [3 * (k[0] + k_e + T), 3 * (2 * k[0] + T)]
        assert omega2 == pytest.approx(sorted(wanted), rel=1e-12)

    def test_a_tackle_pulls_twice(self):
        """From the head over e and back to the head, 4 m with rest length 3 m, against one tendon to w."""
        recipe = tc.build_structure(guyed(False)).as_recipe()
        recipe["tendons"] = {"tackle": ["head", "e", "head"], "w": ["w", "head"]}
        scene = tc.Scene(structure=recipe, tendons={"stiffness": 100.0, "rest_length": {"tackle": 3.0, "w": 1.0}})
        point = Potential.of(scene).at(tc.build_structure(scene).nodes)
        assert point.terms.tensions == pytest.approx([100.0, 100.0], rel=1e-14)
        assert point.nodal_forces[1] == pytest.approx([200.0 - 100.0, 0.0, 0.0], abs=1e-12)

    def test_small_swings_have_that_period(self):
        scene = guyed(True, tendons={"stiffness": 100.0, "rest_length": 3.5})
        dynamics = tc.build_dynamics(scene)
        nodes, omega = dynamics.structure.nodes.copy(), np.sqrt(150.0)
        nodes[1] = [np.sin(1e-4), 0, np.cos(1e-4)]
        run = tc.simulate(dynamics, nodes, timepts=[0.0, np.pi / omega, 2 * np.pi / omega], tol=1e-10)
        assert run.nodes[:, 1, 0] == pytest.approx(1e-4 * np.array([1, -1, 1]), rel=1e-6)


@pytest.fixture(scope="module")
def thrown():
    """The free mast released far from rest, turning and drifting, with tendons and cables that go slack."""
    dynamics = tc.build_dynamics(mast_scene())
    nodes = dynamics.structure.nodes
    velocities = np.array([0.3, -0.2, 0.5]) + np.cross([0.5, 1.0, -0.7], nodes)
    return dynamics, (nodes, velocities), tc.simulate(dynamics, (nodes, velocities), t_end=2.0, tol=1e-8)


class TestMotion:
    def test_energy_and_momenta_stay(self, thrown):
        dynamics, _, run = thrown
        energy, (linear, angular) = total_energy(dynamics, run), momenta(dynamics, run)
        assert run.switches > 5
        assert np.abs(energy / energy[0] - 1).max() < 1e-8
        assert np.abs(linear - linear[0]).max() < 1e-12 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-11 * np.abs(angular).max()

    def test_integrators_agree(self, thrown):
        dynamics, start, run = thrown
        assert run.method == "splitting6"
        other = tc.simulate(dynamics, start, t_end=2.0, tol=1e-12, method="dopri5")
        assert np.abs(other.nodes - run.nodes).max() < 1e-6

    def test_recorded_tensions(self, thrown):
        dynamics, _, run = thrown
        close(run.lengths, dynamics.structure.lengths_at(run.nodes))
        taut = dynamics.members.stiffness * np.maximum(run.lengths - run.rest_lengths, 0)
        close(run.tensions, taut)

    def test_dampers_take_energy_and_no_momentum(self):
        dynamics = tc.build_dynamics(mast_scene(tendons={"damping": 2.0}))
        velocities = np.random.default_rng(0).standard_normal((len(dynamics.structure.nodes), 3))
        tangent = dynamics.potential.manifold.tangent(dynamics.structure.nodes)
        velocities = (tangent @ (tangent.T @ velocities.ravel())).reshape(-1, 3)
        run = tc.simulate(dynamics, (dynamics.structure.nodes, velocities), t_end=0.5)
        energy, (linear, angular) = total_energy(dynamics, run), momenta(dynamics, run)
        assert (np.diff(energy) < 0).all()
        assert energy[-1] < 0.8 * energy[0]
        assert np.abs(linear - linear[0]).max() < 1e-9 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-9 * np.abs(angular).max()

    def test_forces_at_rod_ends_are_those_of_the_potential(self, thrown):
        dynamics, _, run = thrown
        forces, _ = end_forces(dynamics, run)
        for k in (0, -1):
            close(forces[k], dynamics.potential.at(run.nodes[k]).nodal_forces, 1e-12)


class TestJoints:
    def test_kernel_and_casadi_agree(self):
        dynamics = tc.build_dynamics(class_two_scene(tendons={"damping": 1.0}))
        nodes, velocities = random_motion(dynamics.potential, np.random.default_rng(7), reach=0.05)
        q, v, data = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities), dynamics.kernel
        found, forces = np.zeros_like(q), dynamics.layout.spread(dynamics.members.forces)
        accelerations(data, q, v, dynamics.members.rest_lengths, forces, found)
        assert constrain(data, q, found, np.zeros(data.place[-1]), np.zeros(data.first.size))
        x = dynamics.pack(nodes, velocities)
        rate = np.asarray(dynamics.f(x, np.zeros(dynamics.members.inputs.size), np.zeros(0))).ravel()
        close(rate[x.size // 2 :], found.ravel(), 1e-12)

    def test_energy_and_momenta_stay(self):
        dynamics = tc.build_dynamics(class_two_scene())
        nodes = dynamics.structure.nodes
        velocities = np.array([0.3, -0.2, 0.5]) + np.cross([0.5, 1.0, -0.7], nodes)
        run = tc.simulate(dynamics, (nodes, velocities), t_end=0.5)
        energy, (linear, angular) = total_energy(dynamics, run), momenta(dynamics, run)
        assert np.abs(energy / energy[0] - 1).max() < 1e-8
        assert np.abs(linear - linear[0]).max() < 1e-9 * np.abs(linear).max()
        assert np.abs(angular - angular[0]).max() < 1e-9 * np.abs(angular).max()


@pytest.mark.parametrize("damping", [0.0, 1.5])
def test_tendons_of_one_segment_move_as_tendons(damping):
    """The kernels of cables given a structure without any: the same accelerations, undamped the same run."""
    scene = shell_scene(tendons={"damping": damping})
    plain, segmented = tc.build_dynamics(scene), tc.build_dynamics(scene)
    segmented.__dict__["kernel"] = plain.kernel._replace(cables=True)
    start = random_motion(plain.potential, np.random.default_rng(0), reach=0.2)
    q, v = (plain.rod_coordinates(part) for part in start)
    found = np.zeros((2, *q.shape))
    for dynamics, a in zip((plain, segmented), found, strict=True):
        accelerations(dynamics.kernel, q, v, dynamics.members.rest_lengths, dynamics.members.forces, a)
    close(found[1], found[0])
    if not damping:
        one, other = (tc.simulate(dynamics, start, t_end=0.3) for dynamics in (plain, segmented))
        assert one.switches == other.switches > 0
        close(other.nodes, one.nodes, 1e-11)


def test_equations_of_the_paper_see_a_cable():
    """The same ends under the same labels, but one tendon takes a longer way."""
    recipe = tc.shell(3, 1).as_recipe()
    recipe["tendons"]["t1_1_1"].insert(1, "P3_2_1")
    with pytest.raises(StructureError, match="no Class 1 shell"):
        ShellEquations.of(tc.Scene(structure=recipe))


def test_the_model_says_that_it_has_cables():
    terms = tc.build_dynamics(mast_scene()).explain().terms
    assert "40 tendons, 4 of them cables with 18 segments, law k" in terms[0].why


ROOMS = {
    "inverse statics": lambda potential: tc.inverse_statics(potential, tension_min=1.0),
    "nearest shape": lambda potential: tc.nearest_shape(potential, tension_min=1.0),
    "prestress": lambda potential: tc.admissible_prestress(potential.structure, tension_min=1.0),
    "self-stress": lambda potential: tc.self_stress(potential.structure),
    "stability orders": lambda potential: tc.stability_orders(
        potential.structure, None, np.ones(40), np.ones(12), stiffness=1.0
    ),
    "super-stability": lambda potential: super_stability(
        potential.structure, potential.structure.nodes, np.ones(40), np.ones(12)
    ),
}


@pytest.mark.parametrize("room", ROOMS.values(), ids=ROOMS)
def test_rooms_without_cables_refuse_a_mast(room):
    with pytest.raises(StructureError, match=r"^tendon bottom is a cable of 4 nodes, and .*; give each piece"):
        room(Potential.of(mast_scene()))


def test_symmetric_rings_are_solved_as_a_whole():
    """The symmetry is there, but a ring has no image in a sector."""
    rings = {name: MAST[name] for name in ("bottom", "top")}
    scene = tc.Scene(structure=clustered(tc.shell(3, 2), rings))
    assert find_symmetry(Potential.of(shell_scene(3, 2))) is not None
    assert find_symmetry(Potential.of(scene)) is None


def test_a_whole_scene_with_cables(tmp_path):
    """Rest, linear model, LQR, a pushed run, checks and report; the drawing has a line for every segment."""
    scene = mast_scene(
        ["P1_*_1"],
        tendons={"damping": 0.5},
        equilibrium={},
        linearize={},
        controllability={},
        lqr={},
        simulation={
            "t_end": 0.2,
            "controller": "lqr",
            "push": [{"node": "P4_1_2", "force": [2.0, 0.0, 0.0], "from": 0.0, "to": 0.05}],
        },
        report={},
    )
    results = tc.run(scene, out=tmp_path)
    failed = [check.name for check in checks(results) if not check.ok]
    assert not failed
    assert results.run.lengths.shape[1] == 40
    page = (tmp_path / "report.html").read_text()
    data = json.loads(re.search(r'<script[^>]*id="motion-data"[^>]*>(.*?)</script>', page, re.S)[1])
    assert len(data["model"]["tendons"]) == 2 * 54
    assert data["model"]["tendonOf"] == results.structure.segment_tendon.tolist()
