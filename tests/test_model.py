"""One statement of the dynamics against another: CasADi model, compiled kernel, and multipliers in plain NumPy."""

from itertools import pairwise

import numpy as np
import pytest
from support import MIXED_PINS, mast_scene, network_scene, order_of, prism_scene, random_motion, shell_scene, solved

import tensctl as tc
from tensctl.model.kernel import accelerations

EVERYTHING = {
    "pins": MIXED_PINS,
    "rods": {"mass": {"*": 1.0, "r2_*": 2.5}},
    "tendons": {"stiffness": {"*": 100.0, "t5_*": 250.0}, "rest_ratio": 0.9, "damping": {"*": 1.5, "t3_*": 0.0}},
    "gravity": {"g": 9.8},
    "loads": {"P4_2_1": [1.0, 2.0, 3.0], "P1_1_1": [5.0, 0.0, 0.0]},
    "drag": {"coefficient": 0.7},
    "actuators": {"tendons": ["t1_*", "t5_*"]},
    "simulation": {"t_end": 1.0, "push": [{"node": "P4_*", "force": [1, 0, 0], "from": 0, "to": 1}]},
}
SCENES = {
    "(3,1)": shell_scene(),
    "(3,1) primal": shell_scene(primal=True),
    "(3,1) pinned": shell_scene(pins=["P1_*_1"]),
    "(3,1) everything": shell_scene(**EVERYTHING),
    "(3,1) EA": shell_scene(**EVERYTHING | {"tendons": {"EA": 150.0, "rest_ratio": 0.9, "damping": 2.0}}),
    "(4,2) heads pinned": shell_scene(4, 2, pins=["P2_*_2"], gravity={"g": [1.0, 2.0, 3.0]}),
    "(4,2) damped": shell_scene(4, 2, tendons={"damping": 3.0}),
    "(8,4)": shell_scene(8, 4),
    "cables": mast_scene(),
    "cables everything": mast_scene(**EVERYTHING | {"pins": MIXED_PINS, "actuators": {"tendons": ["top", "side"]}}),
    "cables EA": mast_scene(**EVERYTHING | {"tendons": {"EA": 150.0, "rest_ratio": 0.9, "damping": 2.0}}),
    "prism": prism_scene(4, drag={"coefficient": 0.2}),
}


@pytest.fixture(scope="module", params=SCENES)
def dynamics(request):
    return tc.build_dynamics(SCENES[request.param])


def drawn(dynamics, seed):
    """A random state far from rest, where many tendons are slack, with random inputs and pushes."""
    rng = np.random.default_rng(seed)
    nodes, velocities = random_motion(dynamics.potential, rng, reach=0.4, speed=2.0)
    members = dynamics.members
    u = 0.3 * rng.uniform(-1, 1, members.inputs.size) * members.rest_lengths[members.inputs]
    w = 10 * rng.standard_normal((members.pushed.size, 3))
    return nodes, velocities, u, w


def by_casadi(dynamics, nodes, velocities, u, w):
    return np.asarray(dynamics.f(dynamics.pack(nodes, velocities), u, w.ravel())).ravel()


def by_kernel(dynamics, nodes, velocities, u, w):
    """The same right-hand side, made of the kernel's accelerations of the rods."""
    members = dynamics.members
    rest, force = members.rest_lengths.copy(), members.forces.copy()
    rest[members.inputs] -= u
    force[members.pushed] += w
    q, v = dynamics.rod_coordinates(nodes), dynamics.rod_coordinates(velocities)
    pushed = np.zeros_like(q)
    accelerations(dynamics.kernel, q, v, rest, force, pushed)
    nodal = np.zeros_like(nodes)
    nodal[dynamics.structure.rods[:, 0]] = (pushed[:, :3] - pushed[:, 3:]) / 2
    nodal[dynamics.structure.rods[:, 1]] = (pushed[:, :3] + pushed[:, 3:]) / 2
    return dynamics.pack(velocities, nodal)


def laid_out(path, nodes, velocities):
    """Unit vectors from node to node along a tendon, its length and the rate of that."""
    pieces = [(nodes[b] - nodes[a], velocities[b] - velocities[a]) for a, b in pairwise(path)]
    units = [d / np.linalg.norm(d) for d, _ in pieces]
    return units, sum(np.linalg.norm(d) for d, _ in pieces), sum(u @ v for u, (_, v) in zip(units, pieces, strict=True))


def nodal_forces(dynamics, nodes, velocities, u, w):
    """Tendons, dampers, drag, loads and pushes, tendon by tendon in plain NumPy."""
    structure, members = dynamics.structure, dynamics.members
    rest, forces = members.rest_lengths.copy(), members.forces - dynamics.drag * velocities
    rest[members.inputs] -= u
    forces[members.pushed] += w
    for t, path in enumerate(structure.paths):
        units, length, rate = laid_out(path, nodes, velocities)
        if length > rest[t]:
            k = members.stiffness[t] / (rest[t] if members.law == "EA" else 1)
            tension = max(0, k * (length - rest[t]) + dynamics.damping[t] * rate)
            for unit, (a, b) in zip(units, pairwise(path), strict=True):
                forces[a] += tension * unit
                forces[b] -= tension * unit
    return forces


def by_multipliers(dynamics, nodes, velocities, u, w):
    """Node accelerations of M a + G' y = f, G a = -(|v2|^2 per rod, 0 per pin), M the uniform rods' mass matrix."""
    structure, size = dynamics.structure, nodes.size
    mass, rows, right = np.zeros((size, size)), [], []
    for m, (a, b) in zip(dynamics.members.mass, structure.rods, strict=True):
        for p, q, share in ((a, a, 3), (b, b, 3), (a, b, 6), (b, a, 6)):
            mass[3 * p : 3 * p + 3, 3 * q : 3 * q + 3] += m / share * np.eye(3)
        if structure.pinned[[a, b]].all():
            continue
        row, d, rate = np.zeros(size), nodes[b] - nodes[a], velocities[b] - velocities[a]
        row[3 * a : 3 * a + 3], row[3 * b : 3 * b + 3] = -d, d
        rows.append(row)
        right.append(-(rate @ rate))
    for node in np.flatnonzero(structure.pinned):
        rows += list(np.eye(size)[3 * node : 3 * node + 3])
        right += [0.0] * 3
    G = np.array(rows)
    matrix = np.block([[mass, G.T], [G, np.zeros((len(G), len(G)))]])
    forces = nodal_forces(dynamics, nodes, velocities, u, w).ravel()
    return np.linalg.solve(matrix, np.concatenate([forces, right]))[:size].reshape(-1, 3)


def slack_count(dynamics, nodes, velocities, u, w):
    x = dynamics.pack(nodes, velocities)
    return int((np.asarray(dynamics.y_f(x, u)) == 0).sum())


@pytest.mark.parametrize("seed", range(3))
def test_kernel_equals_casadi_to_rounding(dynamics, seed):
    state = drawn(dynamics, seed)
    one, other = by_casadi(dynamics, *state), by_kernel(dynamics, *state)
    assert 0 < slack_count(dynamics, *state) < len(dynamics.structure.tendons)
    assert np.abs(one - other).max() < 1e-13 * np.abs(one).max()


def test_kernel_equals_casadi_all_taut(dynamics):
    nodes, velocities, u, w = drawn(dynamics, 7)
    members = dynamics.members
    if members.inputs.size < len(members.rest_lengths):
        start, u = dynamics.structure.nodes, 0 * u
        velocities = np.zeros_like(start)
    else:
        start, u = nodes, 0.9 * members.rest_lengths
    state = (start, velocities, u, w)
    assert slack_count(dynamics, *state) == 0
    one, other = by_casadi(dynamics, *state), by_kernel(dynamics, *state)
    assert np.abs(one - other).max() < 1e-13 * np.abs(one).max()


@pytest.mark.parametrize("seed", range(2))
def test_casadi_equals_multipliers_in_plain_numpy(dynamics, seed):
    state = drawn(dynamics, seed)
    rate = by_casadi(dynamics, *state)
    wanted = dynamics.pack(state[1], by_multipliers(dynamics, *state))
    assert np.abs(rate - wanted).max() < 1e-11 * np.abs(wanted).max()


class TestOutputs:
    def test_nodes_lengths_tensions(self, dynamics):
        nodes, velocities, u, _ = drawn(dynamics, 5)
        x, structure, members = dynamics.pack(nodes, velocities), dynamics.structure, dynamics.members
        assert np.abs(np.asarray(dynamics.y_p(x)).reshape(-1, 3) - nodes).max() < 1e-14
        length, rate = np.transpose([laid_out(path, nodes, velocities)[1:] for path in structure.paths])
        assert np.abs(np.asarray(dynamics.y_l(x)).ravel() - length).max() < 1e-14 * max(length.max(), 1)
        rest = members.rest_lengths.copy()
        rest[members.inputs] -= u
        k = members.stiffness / (rest if members.law == "EA" else 1)
        wanted = np.where(length > rest, np.maximum(0, k * (length - rest) + dynamics.damping * rate), 0)
        tensions = np.asarray(dynamics.y_f(x, u)).ravel()
        assert np.abs(tensions - wanted).max() < 1e-12 * max(wanted.max(), 1)

    def test_unpack_undoes_pack(self, dynamics):
        nodes, velocities, *_ = drawn(dynamics, 6)
        again = dynamics.unpack(dynamics.pack(nodes, velocities))
        assert np.abs(again[0] - nodes).max() < 1e-14
        assert np.abs(again[1] - velocities).max() < 1e-13

    def test_state_size(self):
        """q1, q2 of a free rod, q2 of a rod held at one end, nothing of a rod held at both."""
        assert tc.build_dynamics(shell_scene()).pack(shell_nodes := tc.shell(3, 1).nodes).size == 72
        assert tc.build_dynamics(shell_scene(pins=["P1_*_1"])).pack(shell_nodes).size == 2 * (3 * 3 + 3 * 6)
        assert tc.build_dynamics(shell_scene(pins=MIXED_PINS)).pack(shell_nodes).size == 2 * (3 * 6 + 2 * 3)


ZERO = {
    "dampers": {"tendons": {"damping": 0.0}},
    "drag": {"drag": {"coefficient": 0.0}},
    "gravity": {"gravity": {"g": 0.0}},
    "loads": {"loads": {"P4_*": [0.0, 0.0, 0.0]}},
}


class TestLeaveOut:
    """A model without a term is the model whose coefficient is zero, and is not larger than it."""

    @pytest.mark.parametrize("term", ZERO)
    def test_zero_coefficient(self, term):
        without, with_zero = (tc.build_dynamics(shell_scene(**sections)) for sections in ({}, ZERO[term]))
        state = drawn(without, 1)
        assert (by_casadi(without, *state) == by_casadi(with_zero, *state)).all()
        assert with_zero.f.n_instructions() == without.f.n_instructions()

    @pytest.mark.parametrize(
        "sections",
        [{"tendons": {"damping": 1e-300}}, {"drag": {"coefficient": 1e-300}}],
        ids=["dampers", "drag"],
    )
    def test_vanishing_coefficient(self, sections):
        """With a coefficient too small to matter the term is in the model, and the numbers are the same."""
        without, vanishing = tc.build_dynamics(shell_scene()), tc.build_dynamics(shell_scene(**sections))
        state = drawn(without, 2)
        one, other = by_casadi(without, *state), by_casadi(vanishing, *state)
        assert np.abs(one - other).max() < 1e-14 * np.abs(one).max()
        assert vanishing.f.n_instructions() > without.f.n_instructions()

    def test_pushes_are_inputs_only_where_asked(self):
        push = {"node": "P4_1_1", "force": [1, 0, 0], "from": 0, "to": 1}
        plain, pushed = (
            tc.build_dynamics(shell_scene(**more)) for more in ({}, {"simulation": {"t_end": 1, "push": [push]}})
        )
        nodes, velocities, u, _ = drawn(plain, 3)
        none, zero = np.zeros((0, 3)), np.zeros((1, 3))
        assert plain.f.size1_in("w") == 0
        assert pushed.f.size1_in("w") == 3
        assert (by_casadi(plain, nodes, velocities, u, none) == by_casadi(pushed, nodes, velocities, u, zero)).all()

    def test_unactuated_tendons_are_no_inputs(self):
        some = tc.build_dynamics(shell_scene(actuators={"tendons": ["t5_*"]}))
        assert some.input_labels == ("t5_1_1", "t5_2_1", "t5_3_1")
        assert some.f.size1_in("u") == 3

    def test_tendons_between_pins_are_no_inputs(self):
        mast = tc.build_dynamics(shell_scene(pins=["P1_*_1"]))
        assert len(mast.input_labels) == 21
        assert not {"t2_1_1", "t2_2_1", "t2_3_1"} & set(mast.input_labels)


class TestExplain:
    def terms(self, **given):
        return {term.name: term for term in tc.build_dynamics(shell_scene(**given)).explain().terms}

    def test_least_model(self):
        inside = {name for name, term in self.terms().items() if term.included}
        assert inside == {"tendons", "inputs", "third dimension"}

    def test_full_model(self):
        outside = {
            name
            for name, term in self.terms(
                **EVERYTHING | {"actuators": {"tendons": ["t1_*", "t5_*"], "lag": 0.1}}
            ).items()
            if not term.included
        }
        assert outside == {"mass matrix", "multipliers"}

    def test_says_which_tendons_are_no_input(self):
        terms = self.terms(pins=["P1_*_1"])
        assert terms["inputs"].why.startswith("21 of 24 tendons; between two pinned nodes, so no input: t2_1_1")

    def test_says_the_cost_of_what_is_left_out(self):
        assert all(self.terms()[name].operations > 0 for name in ("dampers", "drag", "weight and loads"))

    def test_is_a_table(self):
        table = str(tc.build_dynamics(shell_scene()).explain()).splitlines()
        assert table[0].split() == ["term", "in", "operations", "why"]
        assert len(table) == 1 + len(self.terms())


class TestDampingRatio:
    """Of critical: phi' C phi = 2 ratio omega for the lowest mode with phi' M phi = 1."""

    def lowest(self, scene):
        _, rest, linear = solved(scene)
        dynamics = linear.dynamics
        modes = [mode for mode in linear.modes if mode.kind == "flexible"]
        lowest = [mode for mode in modes if mode.cluster == modes[0].cluster]
        ends = rest.nodes[rest.structure.tendons]
        along = (ends[:, 1] - ends[:, 0]) / rest.lengths[:, None]
        taut = rest.tensions > 0
        modal = []
        for mode in lowest:
            moved = mode.shape[rest.structure.tendons]
            rate = np.einsum("ti,ti->t", along, moved[:, 1] - moved[:, 0])
            modal.append((dynamics.damping * taut * rate**2).sum() + dynamics.drag * (mode.shape**2).sum())
        return np.mean(modal) / (2 * np.sqrt(lowest[0].omega2)), dynamics

    @pytest.mark.parametrize("ratio", [0.02, 1.0])
    @pytest.mark.parametrize("pins", [(), ("P1_*_1",)], ids=["free", "pinned"])
    def test_dampers(self, ratio, pins):
        found, dynamics = self.lowest(shell_scene(pins=pins, tendons={"damping": {"ratio": ratio}}))
        assert found == pytest.approx(ratio, rel=1e-12)
        assert np.ptp(dynamics.damping) == 0

    def test_drag(self):
        found, dynamics = self.lowest(shell_scene(pins=["P1_*_1"], drag={"coefficient": {"ratio": 1.0}}))
        assert found == pytest.approx(1.0, rel=1e-12)
        assert not dynamics.damping.any()

    def test_critical_damping_of_a_single_mode(self):
        """One rod on a pin between two equal ties: its lowest mode has a double real pole at ratio 1."""
        nodes = {"o": [0, 0, 0], "e": [0, 0, 1], "a": [2, 0, 1], "b": [-2, 0, 1], "c": [0, 3, 1], "d": [0, -3, 1]}
        ties = {"p": ["e", "a"], "q": ["e", "b"], "r": ["e", "c"], "s": ["e", "d"]}
        damped = network_scene(
            nodes, {"rod": ["o", "e"]}, ties, ["o", "a", "b", "c", "d"],
            tendons={"stiffness": {"*": 100.0, "p": 50.0, "q": 50.0}, "damping": {"ratio": 1.0}},
        )  # fmt: skip
        _, _, linear = solved(damped)
        omega = np.sqrt(linear.modes[0].omega2)
        poles = np.linalg.eigvals(linear.A)
        near = np.abs(poles + omega)
        assert np.sort(near)[:2].max() < 1e-6 * omega

    def test_refuses_where_nothing_holds(self):
        with pytest.raises(tc.EquilibriumError, match="a damping ratio needs a stable equilibrium"):
            tc.build_dynamics(shell_scene(tendons={"rest_ratio": 1.2, "damping": {"ratio": 1.0}}))


def test_energy_rate_is_the_power_of_drag_and_dampers(rng):
    """Of the whole structure: elastic, kinetic and potential energy change only by what is lost."""
    dynamics = tc.build_dynamics(SCENES["(3,1) everything"])
    potential, members = dynamics.potential, dynamics.members
    nodes, velocities = random_motion(potential, rng)
    none = np.zeros(members.inputs.size), np.zeros((members.pushed.size, 3))

    def energy(h):
        acceleration = by_multipliers(dynamics, nodes, velocities, *none)
        moved, speed = nodes + h * velocities + h**2 / 2 * acceleration, velocities + h * acceleration
        a, b = speed[dynamics.structure.rods[:, 0]], speed[dynamics.structure.rods[:, 1]]
        kinetic = (members.mass / 6 * (a * a + a * b + b * b).sum(axis=1)).sum()
        return kinetic + potential.at(moved).energy

    conservative = members.forces * 1.0
    elastic = -potential.at(nodes).terms.gradient
    lost = ((nodal_forces(dynamics, nodes, velocities, *none) - conservative - elastic) * velocities).sum()
    assert lost < 0
    steps = np.array([1e-2, 3e-3, 1e-3])
    errors = [abs((energy(h) - energy(-h)) / (2 * h) - lost) for h in steps]
    assert 1.8 < order_of(steps, errors) < 2.2


def test_a_structure_without_tendons():
    """A level rod on a pin under gravity alone: its tip falls with 3/2 g."""
    scene = network_scene({"o": [0, 0, 0], "e": [2, 0, 0]}, {"rod": ["o", "e"]}, {}, ["o"], gravity={"g": 9.8})
    dynamics = tc.build_dynamics(scene)
    rate = np.asarray(dynamics.f(dynamics.pack(dynamics.structure.nodes), [], [])).ravel()
    assert rate == pytest.approx([0, 0, 0, 0, 0, -1.5 * 9.8])
